#!/bin/sh
# pynmea2 1.19.0 (PyPI).
#
# What a good engineer would guess: a receiver without a fix sends its position fields empty (NMEA 0183: null fields),
# and `latitude` and `longitude` of such a sentence are None or NaN, or raise an error.
#
# What is seen: both are the number 0.0 for GGA, RMC and GLL. That is a valid position in the Gulf of Guinea, and it
# cannot be told from a real 0.0 by the properties alone. Only the raw fields `lat` and `lon` are empty, and the quality
# or status field says that there is no fix.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pynmea2==1.19.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
from functools import reduce
from importlib.metadata import version

import pynmea2

WITHOUT_FIX = (
    "GPGGA,120000.00,,,,,0,00,99.99,,,,,,",
    "GPRMC,120000.00,V,,,,,,,010126,,,N",
    "GPGLL,,,,,120000.00,V,N",
)


def sentence(body):
    return f"${body}*{reduce(lambda sum_, byte: sum_ ^ byte, body.encode()):02X}"


print(f"pynmea2 {version('pynmea2')}")
holds = True
for body in WITHOUT_FIX:
    message = pynmea2.parse(sentence(body))
    print(f"  {sentence(body)}: latitude {message.latitude!r}, longitude {message.longitude!r}, raw lat {message.lat!r}")
    holds &= (message.latitude, message.longitude, message.lat) == (0.0, 0.0, "")
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

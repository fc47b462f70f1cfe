#!/bin/sh
# mcap-ros2-support 0.6.0 with mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: writing a message whose field has a misspelled name, or whose field is missing,
# raises an error. The writer has the message's definition.
#
# What is seen: `write_message` ignores the name it does not know, writes the type's default for the field that is
# missing (0.0, an empty string, or the default of the definition), and reports nothing. A speed of 3.0 m/s under a
# misspelled name is recorded as 0.0 m/s.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mcap==1.6.0 mcap-ros2-support==0.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import io
import sys
import warnings
from importlib.metadata import version

from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer

warnings.simplefilter("error")
file = io.BytesIO()
writer = Writer(file)
schema = writer.register_msgdef("bench_msgs/msg/Speed", "float64 speed\nint32 gear 7\nstring source\n")
writer.write_message("/speed", schema, {"speeed": 3.0}, log_time=1, publish_time=1)
writer.finish()
file.seek(0)
read = next(iter(read_ros2_messages(file))).ros_msg

print(f"mcap-ros2-support {version('mcap-ros2-support')}")
print(f"  written: {{'speeed': 3.0}}; read: speed {read.speed!r}, gear {read.gear!r}, source {read.source!r}")
holds = (read.speed, read.gear, read.source) == (0.0, 7, "")
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

#!/bin/sh
# foxglove-sdk 0.30.3 with mcap 1.6.0 (PyPI), and Node.js.
#
# What a good engineer would guess: a JSON channel of the SDK, given a dict, writes JSON, which every reader of a
# recording can parse. A value that JSON does not have, NaN or infinity, is refused or becomes null.
#
# What is seen: the message is written as `{"speed": NaN}`, without an error. That is no JSON (RFC 8259): the strict
# parsers, JavaScript's among them, refuse the whole message with all its other fields, while Python's own module reads
# it, so that a test in Python passes. A sensor gives NaN just when something is wrong with it. The program must replace
# such values before it logs them.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
command -v node > /dev/null || exit 2
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check foxglove-sdk==0.30.3 mcap==1.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import json
import math
import subprocess
import sys
from importlib.metadata import version

from foxglove import Channel, open_mcap
from mcap.reader import make_reader

PARSE = "try { JSON.parse(process.argv[1]); console.log('read') } catch (error) { console.log(error.name) }"
path = f"{sys.argv[1]}/drive.mcap"
with open_mcap(path):
    channel = Channel("/speed", schema={"type": "object", "properties": {"speed": {"type": "number"}}})
    for speed in (1.5, math.nan, math.inf):
        channel.log({"speed": speed, "gear": 3})

print(f"foxglove-sdk {version('foxglove-sdk')}")
results = []
with open(path, "rb") as file:
    for _, channel, message in make_reader(file).iter_messages():
        text = message.data.decode()
        by_node = subprocess.run(["node", "-e", PARSE, text], capture_output=True, text=True).stdout.strip()
        by_python = json.loads(text)["gear"]
        print(f"  {channel.message_encoding}: {text}; JSON.parse: {by_node}; Python's json: read")
        results.append((channel.message_encoding, by_node, by_python))
holds = results == [("json", "read", 3), ("json", "SyntaxError", 3), ("json", "SyntaxError", 3)]
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"

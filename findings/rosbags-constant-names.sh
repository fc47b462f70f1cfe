#!/bin/sh
# rosbags 0.11.9 (PyPI).
#
# What a good engineer would guess: `get_types_from_msg` reads every definition that a ROS 1 bag can hold, because
# genmsg accepted it when the message was built. In genmsg a constant is a type, a name of letters, digits and
# underscores, and a value behind `=`; the text of a string may be empty.
#
# What is seen: a constant whose name has a small letter, and a string without text, make the whole definition
# unreadable, and with it every message of the type. Without these lines, which are not in the bytes, it is read.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
from importlib.metadata import version

from rosbags.typesys import TypesysError, get_types_from_msg


def is_read(line):
    """Whether a definition with this line before its only field is read."""
    try:
        found = get_types_from_msg(f"{line}\nfloat32 speed\n", "made_msgs/msg/State")
    except TypesysError:
        return False
    return [name for name, _ in found["made_msgs/msg/State"][1]] == ["speed"]


print(f"rosbags {version('rosbags')}")
expected = {"": True, "int8 LEFT=1": True, "int8 kLeft=1": False, "int8 left=1": False, "string NONE=": False}
rows = {line: is_read(line) for line in expected}
for line, read in rows.items():
    print(f"  {line or 'no constant'}: {'read' if read else 'refused'}")
print("The behaviour holds." if rows == expected else "The behaviour has changed.")
sys.exit(0 if rows == expected else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

#!/bin/sh
# rosbags 0.11.9 (PyPI).
#
# What a good engineer would guess: `get_types_from_msg` reads every definition that a ROS 1 bag can hold, because
# genmsg accepted it when the message was built. In genmsg a constant is a type, a name of letters, digits and
# underscores, and a value behind `=`; the text of a string may be empty.
#
# What is seen: a constant whose name has a small letter, and a string without text, make the whole definition
# unreadable, and with it every message of the type. With a space before its `=` such a constant is no error: it is taken
# for a field more, and the bytes of the next ones are read as its value. Without these lines it is read rightly.
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


def fields(line):
    """The fields of a definition with this line before its only field; "refused"."""
    try:
        found = get_types_from_msg(f"{line}\nfloat32 speed\n", "made_msgs/msg/State")
    except TypesysError:
        return "refused"
    return " ".join(name for name, _ in found["made_msgs/msg/State"][1])


print(f"rosbags {version('rosbags')}")
expected = {
    **{line: "speed" for line in ("", "int8 LEFT=1", "int8 LEFT = 1")},
    **{line: "refused" for line in ("int8 kLeft=1", "int8 left=1", "string NONE=")},
    "int8 kLeft = 1": "kLeft speed",
}
rows = {line: fields(line) for line in expected}
for line, found in rows.items():
    print(f"  {line or 'no constant'}: {found}")
print("The behaviour holds." if rows == expected else "The behaviour has changed.")
sys.exit(0 if rows == expected else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

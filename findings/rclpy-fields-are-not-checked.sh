#!/bin/sh
# ros-rclpy 9.1.2 with ros-std-msgs 5.5.1 and ros-rmw-fastrtps-cpp 9.3.3 (PyPI, Python 3.11).
#
# What a good engineer would guess: a number that does not fit its field raises the AssertionError of the older
# distributions: "The 'data' field must be an unsigned integer in [0, 255]".
#
# What is seen: the classes check a field only where the environment has ROS_PYTHON_CHECK_FIELDS=1, or where the
# message was made with `check_fields=True`. Without that 300 in a uint8 is sent as 44, 40000 in an int16 as -25536,
# 2 in a bool as False. Nothing raises or is logged, and the object that was published still shows the right number.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-rclpy==9.1.2 ros-std-msgs==5.5.1 \
  ros-rmw-fastrtps-cpp==9.3.3 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
from importlib.metadata import version

from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Bool, Int16, UInt8


def arrived(message):
    """The message as a subscriber gets it."""
    return deserialize_message(serialize_message(message), type(message))


versions = ", ".join(f"{name} {version(name)}" for name in ("ros-rclpy", "ros-std-msgs"))
print(f"{versions}, Python {sys.version.split()[0]}")
rows = {
    "UInt8(data=200)": (arrived(UInt8(data=200)).data, 200),
    "UInt8(data=300)": (arrived(UInt8(data=300)).data, 44),
    "Int16(data=40000)": (arrived(Int16(data=40000)).data, -25536),
    "Bool(data=2)": (arrived(Bool(data=2)).data, False),
}
for name, (found, _) in rows.items():
    print(f"  {name + ':':20} {found!r} arrives")
try:
    checked = str(UInt8(data=300, check_fields=True))
except AssertionError as error:
    checked = f"AssertionError: {error}"
print(f"  with check_fields:   {checked}")
holds = all(found == expected for found, expected in rows.values()) and checked.startswith("AssertionError")
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
env -u ROS_PYTHON_CHECK_FIELDS "$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

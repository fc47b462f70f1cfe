#!/bin/sh
# ros-rclpy 9.1.2 with ros-std-msgs 5.5.1 and ros-rmw-fastrtps-cpp 9.3.3, and rosbags 0.11.9 (PyPI, Python 3.11).
#
# What a good engineer would guess: what is put in the field `data` of a `std_msgs/String` arrives, or is refused. Strings
# have their length in CDR; programs of ROS 1 send serialized data in them, and every character of Python is allowed.
#
# What is seen: rclpy writes the string up to its first NUL character and drops the rest, without an error: of 21
# characters 5 arrive. The object that was published still has all of them. rosbags reads a string with a NUL whole, so
# the same message through a bag is not cut. Such data needs a `uint8[]`.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-rclpy==9.1.2 ros-std-msgs==5.5.1 \
  ros-rmw-fastrtps-cpp==9.3.3 rosbags==0.11.9 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
from importlib.metadata import version

from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import String

TEXT = "speed\0limit 3.0 m/s\0!"
store = get_typestore(Stores.ROS2_JAZZY)
sent = String(data=TEXT)
arrived = deserialize_message(serialize_message(sent), String).data
of_rosbags = store.deserialize_cdr(
    store.serialize_cdr(store.types["std_msgs/msg/String"](data=TEXT), "std_msgs/msg/String"), "std_msgs/msg/String"
).data

print(f"ros-rclpy {version('ros-rclpy')}, ros-std-msgs {version('ros-std-msgs')}, rosbags {version('rosbags')}")
print(f"  sent:              {sent.data!r}")
print(f"  arrived, rclpy:    {arrived!r}")
print(f"  arrived, rosbags:  {of_rosbags!r}")
holds = sent.data == of_rosbags == TEXT and arrived == "speed"
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

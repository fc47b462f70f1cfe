#!/bin/sh
# ros-diagnostic-msgs 5.5.1 with ros-rclpy 9.1.2, rosbags 0.11.9 and mcap-ros2-support 0.6.0 (PyPI, Python 3.11).
#
# What a good engineer would guess: `DiagnosticStatus.level` is a small integer, as in ROS 1, in every Python library
# that has the message. The definition says `byte level` with the constants OK=0, WARN=1, ERROR=2, STALE=3.
#
# What is seen: in the generated class of ROS 2 `level` and the constants are `bytes` of length one. `level == 0` is
# False for a status that is OK, without an error; `level >= 1` raises TypeError. rosbags and mcap-ros2-support decode
# the same message to an `int`. Code that compares with a number works on a recording and fails, partly in silence,
# on the live topic.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-rclpy==9.1.2 ros-diagnostic-msgs==5.5.1 \
  ros-rmw-fastrtps-cpp==9.3.3 rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import io
import sys
from importlib.metadata import version

from diagnostic_msgs.msg import DiagnosticStatus
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_typestore

TYPE = "diagnostic_msgs/msg/DiagnosticStatus"
DEFINITION = """byte level
string name
string message
string hardware_id
diagnostic_msgs/KeyValue[] values
================================================================================
MSG: diagnostic_msgs/KeyValue
string key
string value
"""

status = DiagnosticStatus(name="battery", message="well")
data = serialize_message(status)

file = io.BytesIO()
writer = Writer(file)
writer.start(profile="ros2")
schema = writer.register_schema(TYPE, "ros2msg", DEFINITION.encode())
channel = writer.register_channel("/status", "cdr", schema)
writer.add_message(channel, 1, data, 1)
writer.finish()
file.seek(0)
reader = make_reader(file, decoder_factories=[DecoderFactory()])
by_mcap = next(iter(reader.iter_decoded_messages())).decoded_message.level
by_rosbags = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(data, TYPE).level

print(", ".join(f"{name} {version(name)}" for name in ("ros-diagnostic-msgs", "rosbags", "mcap-ros2-support")))
print(f"  ROS 2's class:     level {status.level!r}, OK {DiagnosticStatus.OK!r}, level == 0 is {status.level == 0}")
print(f"  rosbags:           level {by_rosbags!r}")
print(f"  mcap-ros2-support: level {by_mcap!r}")
try:
    print(f"  level >= 1 is {status.level >= 1}")
    refused = False
except TypeError as error:
    print(f"  level >= 1: TypeError: {error}")
    refused = True
holds = refused and status.level == b"\x00" and status.level != 0 and by_rosbags == 0 and by_mcap == 0
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

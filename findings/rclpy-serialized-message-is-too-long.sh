#!/bin/sh
# ros-rclpy 9.1.2 with ros-sensor-msgs 5.5.1 and ros-rmw-fastrtps-cpp 9.3.3, and rosbags 0.11.9 (PyPI, Python 3.11).
#
# What a good engineer would guess: `serialize_message` gives the bytes of the message, as the topic has them. Programs
# write them to a recording, which any reader of ROS 2 reads again.
#
# What is seen: where a message ends with empty arrays of 8-byte numbers, as a `JointState` without velocity and effort,
# the result is longer than the message, here by 8 bytes whose values mean nothing. rosbags refuses such a message: "CDR
# message size mismatch". The drive was recorded without an error. mcap-ros2-support and rclpy pass over the rest. With
# the arrays filled, all agree.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-rclpy==9.1.2 ros-sensor-msgs==5.5.1 \
  ros-rmw-fastrtps-cpp==9.3.3 rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import io
import sys
from importlib.metadata import version

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState

TYPE = "sensor_msgs/msg/JointState"
store = get_typestore(Stores.ROS2_JAZZY)


def by_mcap(data):
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile="ros2")
    definition = store.generate_msgdef(TYPE, ros_version=2)[0]
    schema = writer.register_schema(TYPE, "ros2msg", definition.encode())
    writer.add_message(writer.register_channel("/joints", "cdr", schema), 1, data, 1)
    writer.finish()
    file.seek(0)
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    return next(iter(reader.iter_decoded_messages())).decoded_message


def by_rosbags(data):
    try:
        return store.deserialize_cdr(data, TYPE).position.tolist()
    except Exception as error:
        return f"{type(error).__name__}: {error}"


print(", ".join(f"{name} {version(name)}" for name in ("ros-rclpy", "ros-rmw-fastrtps-cpp", "rosbags", "mcap-ros2-support")))
holds = True
for name, joints in (
    ("filled", JointState(name=["wheel"], position=[1.5], velocity=[2.5], effort=[3.5])),
    ("without velocity and effort", JointState(name=["wheel"], position=[1.5])),
):
    data = serialize_message(joints)
    values = [list(getattr(joints, field)) for field in ("position", "velocity", "effort")]
    own = store.types[TYPE](
        store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), ""),
        ["wheel"],
        *(np.array(some, dtype=np.float64) for some in values),
    )
    right = len(store.serialize_cdr(own, TYPE))
    readings = [list(deserialize_message(data, JointState).position), list(by_mcap(data).position), by_rosbags(data)]
    print(f"  {name}: {len(data)} bytes, of which the message has {right}")
    print(f"    rclpy {readings[0]}, mcap-ros2-support {readings[1]}, rosbags {readings[2]}")
    if name == "filled":
        holds = holds and len(data) == right and readings == [[1.5]] * 3
    else:
        holds = holds and len(data) > right and readings[:2] == [[1.5]] * 2 and "size mismatch" in str(readings[2])
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

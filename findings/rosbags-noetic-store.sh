#!/bin/sh
# rosbags 0.11.9 (PyPI), which needs Python 3.10 or newer.
#
# What a good engineer would guess: the type store `Stores.ROS1_NOETIC` has the message types of a ROS 1 Noetic desktop.
# `tf2_msgs/TFMessage` is the type of /tf and /tf_static, so that the store decodes the transforms of any navigation bag.
#
# What is seen: no ROS 1 store has `tf2_msgs/msg/TFMessage`. Serializing or decoding it raises an error; the caller has
# to register the definition that the bag itself contains. The ROS 2 stores have the type.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

version=0.11.9
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "rosbags==$version" || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
from importlib.metadata import version
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TYPE = "tf2_msgs/msg/TFMessage"
DEFINITION = "geometry_msgs/TransformStamped[] transforms"
path = Path(sys.argv[1]) / "transforms.bag"

print(f"rosbags {version('rosbags')}")
stores = [one for one in Stores if one.name in ("ROS1_NOETIC", "ROS2_FOXY", "ROS2_HUMBLE", "ROS2_JAZZY")]
has = {one.name: TYPE in get_typestore(one).fielddefs for one in stores}
for name, found in has.items():
    print(f"  {name} has {TYPE}: {found}")

# A bag with one transform, as a robot would record it: its connection holds the definition.
full = get_typestore(Stores.ROS1_NOETIC)
full.register(get_types_from_msg(DEFINITION, TYPE))
types = full.types
stamped = types["geometry_msgs/msg/TransformStamped"](
    header=types["std_msgs/msg/Header"](seq=0, stamp=types["builtin_interfaces/msg/Time"](sec=1, nanosec=0), frame_id="base_link"),
    child_frame_id="laser",
    transform=types["geometry_msgs/msg/Transform"](
        translation=types["geometry_msgs/msg/Vector3"](x=1.0, y=0.0, z=0.0),
        rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    ),
)
with Writer(path) as writer:
    connection = writer.add_connection("/tf", TYPE, typestore=full)
    writer.write(connection, 1_000_000_000, full.serialize_ros1(types[TYPE](transforms=[stamped]), TYPE))

with AnyReader([path], default_typestore=get_typestore(Stores.ROS1_NOETIC)) as reader:
    connection, _, raw = next(reader.messages())
    print(f"  the bag's own definition decodes it: {reader.deserialize(raw, connection.msgtype).transforms[0].child_frame_id}")
    try:
        get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(raw, TYPE)
        refused = False
        print("  the store ROS1_NOETIC decodes it")
    except Exception as error:
        refused = True
        print(f"  the store ROS1_NOETIC does not: {type(error).__name__}: {error}")

holds = refused and not has["ROS1_NOETIC"] and has["ROS2_HUMBLE"]
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"

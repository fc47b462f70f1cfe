#!/bin/sh
# rosbags 0.11.9 (PyPI).
#
# What a good engineer would guess: the example of the documentation reads one topic: it collects the connections whose
# topic has the name, and passes the list to `reader.messages(connections=…)`. In a drive without that topic it gives no
# message.
#
# What is seen: an empty list is taken for "no filter". In a drive without `/estop` the loop gets each message of every
# other topic, and the program takes the camera's or the radio's messages for those of the emergency stop. The list must
# be tested before.
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
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

TYPE = "std_msgs/msg/Bool"
folder = Path(sys.argv[1])
ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
drives = {
    "bag of ROS 1": Writer1(folder / "one.bag"),
    "SQLite": Writer2(folder / "two", version=9),
    "MCAP": Writer2(folder / "three", version=9, storage_plugin=StoragePlugin.MCAP),
}
print(f"rosbags {version('rosbags')}, five messages of /radio_on in each drive")
holds = True
for name, writer in drives.items():
    store, encode = (ros1, ros1.serialize_ros1) if name == "bag of ROS 1" else (ros2, ros2.serialize_cdr)
    with writer:
        radio = writer.add_connection("/radio_on", TYPE, typestore=store)
        for number in range(1, 6):
            writer.write(radio, number, encode(store.types[TYPE](data=True), TYPE))
    with AnyReader([writer.path]) as reader:
        counts = {}
        for topic in ("/radio_on", "/estop"):
            connections = [one for one in reader.connections if one.topic == topic]
            counts[topic] = sum(1 for _ in reader.messages(connections=connections))
    print(f"  {name}: {counts['/radio_on']} messages for /radio_on, {counts['/estop']} for /estop")
    holds = holds and counts == {"/radio_on": 5, "/estop": 5}
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"

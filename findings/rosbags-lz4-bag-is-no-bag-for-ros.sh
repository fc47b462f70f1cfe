#!/bin/sh
# rosbags 0.11.9 (PyPI) with rosbag 1.15.15 (Debian 12, python3-rosbag).
#
# What a good engineer would guess: a bag of ROS 1 that rosbags compresses with LZ4, one of the two compressions of the
# format, is read by ROS 1 itself.
#
# What is seen: rosbags writes LZ4 blocks that need the ones before them; the reader of ROS takes blocks on their own
# only. Its index is read, so that `rosbag info` counts every message, and reading the first one raises OSError. With
# BZ2 and without compression the same messages are read. rosbags reads its own bag, so that a test with it alone passes.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
cd "$folder"
python3 -m venv venv || exit 2
venv/bin/pip install --quiet --disable-pip-version-check rosbags==0.11.9 || exit 2
# Those that it imports; unpacked here, not installed.
apt-get download -q=2 python3-rosbag=1.15.15+ds-2 python3-rospy python3-roslib python3-rosgraph python3-genpy \
  python3-genmsg python3-std-msgs python3-roscpp-msg python3-rosgraph-msgs python3-roslz4 libroslz4-1d python3-rospkg \
  python3-catkin python3-catkin-pkg python3-pycryptodome python3-gnupg python3-yaml python3-pyparsing \
  python3-dateutil python3-six python3-docutils 2> /dev/null || exit 2
for package in *.deb; do dpkg -x "$package" root; done

cat > write.py <<'PYTHON'
from importlib.metadata import version

from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

TYPE = "std_msgs/msg/String"
store = get_typestore(Stores.ROS1_NOETIC)
print(f"rosbags {version('rosbags')}, 100 messages written")
for name, compression in (("none", None), ("bz2", "BZ2"), ("lz4", "LZ4")):
    writer = Writer(f"{name}.bag")
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression])
    with writer:
        note = writer.add_connection("/note", TYPE, typestore=store)
        for number in range(1, 101):
            writer.write(note, number, store.serialize_ros1(store.types[TYPE](data=f"note {number} " * 10), TYPE))
    with AnyReader([writer.path]) as reader:
        print(f"  {name}, rosbags: {sum(1 for _ in reader.messages())} messages read")
PYTHON

cat > read.py <<'PYTHON'
import sys
from importlib.metadata import version

import rosbag

print(f"rosbag {version('rosbag')}")
results = []
for name in ("none", "bz2", "lz4"):
    with rosbag.Bag(f"{name}.bag") as bag:
        count, read = bag.get_message_count(), 0
        try:
            for _ in bag.read_messages():
                read += 1
            end = "the end"
        except Exception as error:
            end = f"{type(error).__name__}: {error}"
    print(f"  {name}, rosbag: {count} messages counted, {read} read, then {end}")
    results.append((count, read, end.split(":")[0]))
holds = results == [(100, 100, "the end"), (100, 100, "the end"), (100, 0, "OSError")]
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
venv/bin/python write.py || exit 2
PYTHONPATH=root/usr/lib/python3/dist-packages LD_LIBRARY_PATH=$(echo root/usr/lib/*-linux-gnu) /usr/bin/python3 -S read.py || status=$?
exit "$status"

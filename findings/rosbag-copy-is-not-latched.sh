#!/bin/sh
# rosbag 1.15.15 (Debian 12, python3-rosbag).
#
# What a good engineer would guess: the loop of rosbag's cookbook, `for topic, msg, t in bag.read_messages()` with
# `out.write(topic, msg, t)`, copies the messages as they are. A topic that was latched in the drive, a map or /tf_static,
# is latched in the copy, so that a node which starts later during `rosbag play` gets it.
#
# What is seen: latching and the publisher are in the header of the connection, which this loop does not pass on: the copy
# has neither, without a warning. `read_messages(return_connection_header=True)` gives the header, and `write` takes it as
# `connection_header`. `rosbag filter` does so; the loop does not.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
cd "$folder"
# Those that it imports; unpacked here, not installed.
apt-get download -q=2 python3-rosbag=1.15.15+ds-2 python3-rospy python3-roslib python3-rosgraph python3-genpy \
  python3-genmsg python3-std-msgs python3-roscpp-msg python3-rosgraph-msgs python3-roslz4 libroslz4-1d python3-rospkg \
  python3-catkin python3-catkin-pkg python3-pycryptodome python3-gnupg python3-yaml python3-pyparsing \
  python3-dateutil python3-six python3-docutils 2> /dev/null || exit 2
for package in *.deb; do dpkg -x "$package" root; done

cat > try.py <<'PYTHON'
import sys
from importlib.metadata import version

import genpy
import rosbag
from std_msgs.msg import String

header = {
    "topic": "/map_name",
    "type": String._type,
    "md5sum": String._md5sum,
    "message_definition": String._full_text,
    "callerid": "/map_server",
    "latching": "1",
}
with rosbag.Bag("drive.bag", "w") as bag:  # as `rosbag record` writes a latched topic
    bag.write("/map_name", String("yard"), genpy.Time(1), connection_header=header)
with rosbag.Bag("drive.bag") as bag, rosbag.Bag("copy.bag", "w") as copy:
    for topic, message, time in bag.read_messages():
        copy.write(topic, message, time)
with rosbag.Bag("drive.bag") as bag, rosbag.Bag("whole.bag", "w") as copy:
    for topic, message, time, one in bag.read_messages(return_connection_header=True):
        copy.write(topic, message, time, connection_header=one)


def found(name):
    """Latching and publisher of the topic."""
    with rosbag.Bag(name) as bag:
        (_, _, _, one) = next(bag.read_messages(return_connection_header=True))
    return tuple(one[key].decode() if key in one else None for key in ("latching", "callerid"))


print(f"rosbag {version('rosbag')}")
rows = {"drive": found("drive.bag"), "copy": found("copy.bag"), "copy with the headers": found("whole.bag")}
for name, (latching, publisher) in rows.items():
    print(f"  {name}: latching {latching}, publisher {publisher}")
holds = list(rows.values()) == [("1", "/map_server"), (None, None), ("1", "/map_server")]
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
PYTHONPATH=root/usr/lib/python3/dist-packages LD_LIBRARY_PATH=$(echo root/usr/lib/*-linux-gnu) /usr/bin/python3 -S try.py || status=$?
exit "$status"

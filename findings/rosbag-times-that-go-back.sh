#!/bin/sh
# rosbag 1.15.15 (Debian 12, python3-rosbag).
#
# What a good engineer would guess: `Bag.write` takes any time, and the index of the format has the time of every
# message. So a bag into which one drive was written behind a later one is read by time: `read_messages` yields what
# is between `start_time` and `end_time`, and `get_start_time` is before `get_end_time`.
#
# What is seen: so it is while the bag has one chunk. In a larger one the index of a topic has the order of the
# chunks, and is searched as if it were sorted: `read_messages` yields the order of writing, an `end_time` within the
# earlier drive yields nothing, and the bag begins after it ends. There is no error and no warning. The messages must
# be sorted before they are written.
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

LATER, EARLIER = (11, 12, 13, 14), (1, 2, 3, 4)  # seconds


def found(letters):
    """Of a bag of both drives, with messages of so many letters: all, those until 3 s, its beginning and end."""
    with rosbag.Bag("both.bag", "w") as bag:
        for second in (*LATER, *EARLIER):
            bag.write("/state", String("x" * letters), genpy.Time(second))
    with rosbag.Bag("both.bag") as bag:
        every = [time.secs for _, _, time in bag.read_messages()]
        until = [time.secs for _, _, time in bag.read_messages(end_time=genpy.Time(3))]
        return every, until, (bag.get_start_time(), bag.get_end_time())


print(f"rosbag {version('rosbag')}")
small, large = found(10), found(400_000)
for name, (every, until, span) in (("one chunk", small), ("several chunks", large)):
    print(f"  {name}:")
    print(f"    read_messages():           {every}")
    print(f"    read_messages(end_time=3): {until}")
    print(f"    start and end:             {span}")
holds = small == ([*EARLIER, *LATER], [1, 2, 3], (1.0, 14.0)) and large == ([*LATER, *EARLIER], [], (11.0, 4.0))
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
PYTHONPATH=root/usr/lib/python3/dist-packages LD_LIBRARY_PATH=$(echo root/usr/lib/*-linux-gnu) /usr/bin/python3 -S try.py || status=$?
exit "$status"

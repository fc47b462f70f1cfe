#!/bin/sh
# rosbag 1.15.15 (Debian 12, python3-rosbag), and rosbags 0.11.9 (PyPI).
#
# What a good engineer would guess: messages of one time come in the order in which they were written, as a recorder
# received them. With simulated time many have the same time: the clock stands still between two ticks.
#
# What is seen: both readers of a ROS 1 bag merge the topics by time only, so that all of one topic come before the
# next topic. A stop that was written between two commands is read behind both, or before both: which topic is first
# depends on the order of the connections. The place of each message in the file, which the index has, is not used.
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

cat > try.py <<'PYTHON'
import json
import sys
from importlib.metadata import version

import genpy
import rosbag
from std_msgs.msg import String

with rosbag.Bag("drive.bag", "w") as bag:
    for topic, text in (("/command", "go"), ("/stop", "pressed"), ("/command", "stand"), ("/stop", "released")):
        bag.write(topic, String(text), genpy.Time(10))
with rosbag.Bag("drive.bag") as bag:
    print(json.dumps([version("rosbag"), [message.data for _, message, _ in bag.read_messages()]]))
PYTHON

cat > other.py <<'PYTHON'
import json
import sys
from importlib.metadata import version

from rosbags.rosbag1 import Reader

ours, first = json.loads(sys.argv[1])
with Reader("drive.bag") as reader:
    second = [bytes(raw[4:]).decode() for _, _, raw in reader.messages()]
print(f"rosbag {ours}, rosbags {version('rosbags')}")
print("  written:         ['go', 'pressed', 'stand', 'released']")
print(f"  read by rosbag:  {first}")
print(f"  read by rosbags: {second}")
holds = first == ["go", "stand", "pressed", "released"] and second == first
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

first=$(PYTHONPATH=root/usr/lib/python3/dist-packages LD_LIBRARY_PATH=$(echo root/usr/lib/*-linux-gnu) /usr/bin/python3 -S try.py) || exit 2
status=0
venv/bin/python other.py "$first" || status=$?
exit "$status"

#!/bin/sh
# tf2 0.7.6 (Debian 12, python3-tf2-ros).
#
# What a good engineer would guess: a transform from /tf is valid at its own time. Who requests it for a later moment
# gets an ExtrapolationException, and so learns that the localization is silent. That does not depend on what came
# before on /tf_static, such as the pose at which a car was parked.
#
# What is seen: once a frame had a static transform, all its later ones are kept as static too, until the buffer is
# cleared. The newest is valid at every time: a pose of 100 s is the answer for 5000 s and for 50 s, without an
# exception. No warning is logged. A frame that never was static raises, as it should.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
cd "$folder"
# Those that it imports; unpacked here, not installed.
apt-get download -q=2 python3-tf2-ros=0.7.6-1 python3-tf2 libtf2-2d \
  librostime1d libcpp-common0d libconsole-bridge1.0 python3-tf2-msgs python3-actionlib \
  python3-actionlib-msgs python3-geometry-msgs python3-sensor-msgs python3-std-msgs python3-rospy python3-roslib \
  python3-rosgraph python3-genpy python3-genmsg python3-roscpp-msg python3-rosgraph-msgs python3-rospkg python3-catkin \
  python3-catkin-pkg python3-yaml python3-pyparsing python3-dateutil python3-six python3-docutils 2> /dev/null || exit 2
for package in *.deb; do dpkg -x "$package" root; done

cat > try.py <<'PYTHON'
import sys
from importlib.metadata import version

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped


def transform(second, x):
    """The car in the map."""
    made = TransformStamped()
    made.header.frame_id, made.child_frame_id, made.header.stamp = "map", "base_link", rospy.Time(second)
    made.transform.translation.x, made.transform.rotation.w = x, 1.0
    return made


def found(was_parked):
    """The answer for each moment, after one transform from /tf at 100 s."""
    buffer = tf2_ros.BufferCore(rospy.Duration(10))
    if was_parked:
        buffer.set_transform_static(transform(0, 1.0), "parked")
    buffer.set_transform(transform(100, 2.0), "localization")
    answers = {}
    for second in (50, 100, 5000):
        try:
            answer = buffer.lookup_transform_core("map", "base_link", rospy.Time(second))
            answers[second] = answer.transform.translation.x
        except tf2_ros.ExtrapolationException:
            answers[second] = "ExtrapolationException"
    return answers


print(f"tf2 {version('tf2-ros')}, a transform from /tf at 100 s, x = 2.0")
never, parked = found(False), found(True)
print(f"  never static:        {never}")
print(f"  static at the start: {parked}")
raised = "ExtrapolationException"
holds = never == {50: raised, 100: 2.0, 5000: raised} and parked == {50: 2.0, 100: 2.0, 5000: 2.0}
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
PYTHONPATH=root/usr/lib/python3/dist-packages LD_LIBRARY_PATH=$(echo root/usr/lib/*-linux-gnu) /usr/bin/python3 -S try.py || status=$?
exit "$status"

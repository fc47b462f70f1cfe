#!/bin/sh
# mcap-ros2-support 0.6.0 with mcap 1.6.0, and rosbags 0.11.9 (PyPI).
#
# What a good engineer would guess: a field of type `char` in a ROS 2 message has the values 0 to 255. ROS 2 defines
# `char` as uint8, and the two libraries that read ROS 2 recordings in Python agree on it.
#
# What is seen: mcap-ros2-support decodes `char` and `char[]` as int8. The byte 200 is read as -56; rosbags reads 200.
# Values up to 127 are the same in both, so that tests with ASCII letters do not show it.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import io
import sys
from importlib.metadata import version

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TYPE, DEFINITION = "bench_msgs/msg/Gear", "char code\nchar[] history\nuint8 check\n"
store = get_typestore(Stores.ROS2_JAZZY)
store.register(get_types_from_msg(DEFINITION, TYPE))
sent = store.types[TYPE](code=200, history=np.array([65, 200], dtype=np.uint8), check=200)
data = bytes(store.serialize_cdr(sent, TYPE))

file = io.BytesIO()
writer = Writer(file)
writer.start(profile="ros2")
schema = writer.register_schema(TYPE, "ros2msg", DEFINITION.encode())
writer.add_message(writer.register_channel("/gear", "cdr", schema), 1, data, 1)
writer.finish()
file.seek(0)
reader = make_reader(file, decoder_factories=[DecoderFactory()])
by_mcap = next(iter(reader.iter_decoded_messages())).decoded_message
by_rosbags = store.deserialize_cdr(data, TYPE)

print(f"mcap-ros2-support {version('mcap-ros2-support')}, rosbags {version('rosbags')}")
print(f"  mcap-ros2-support: char {by_mcap.code}, char[] {list(by_mcap.history)}, uint8 {by_mcap.check}")
print(f"  rosbags:           char {by_rosbags.code}, char[] {by_rosbags.history.tolist()}, uint8 {by_rosbags.check}")
holds = (by_mcap.code, list(by_mcap.history), by_mcap.check) == (-56, [65, -56], 200) and by_rosbags.code == 200
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

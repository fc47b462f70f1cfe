#!/bin/sh
# rosbags 0.11.9 with mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: each recording contains the definitions of its messages, so that old and new drives
# are read together although a message type was changed between them. `AnyReader` takes several bags for that, and an
# MCAP file may have several schemas of one name, as after a merge.
#
# What is seen: `AnyReader` keeps one definition for each type name, the last one that it comes across. Messages of the
# other drive are decoded with it. Where both have the same length, as after two fields were swapped, the values are
# wrong without an error: a speed of 3.0 m/s is read as 9.8e-45, in one file with both schemas too. Each bag alone, and
# the other reader of MCAP, give the right values. The md5sums that bags of ROS 1 contain do not prevent it.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
from importlib.metadata import version
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TYPE, FIRST, SECOND = "bench_msgs/msg/Drive", "float32 speed\nuint32 gear\n", "uint32 gear\nfloat32 speed\n"
folder = Path(sys.argv[1])


def store_of(definition):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, TYPE))
    return store


def speeds(*paths):
    """The speed of each message."""
    with AnyReader(paths) as reader:
        return [reader.deserialize(data, connection.msgtype).speed for connection, _, data in reader.messages()]


old, new, merged = folder / "old.bag", folder / "new.bag", folder / "merged.mcap"
for path, definition in ((old, FIRST), (new, SECOND)):
    store = store_of(definition)
    with Writer(path) as writer:
        connection = writer.add_connection("/drive", TYPE, typestore=store)
        writer.write(connection, 1, store.serialize_ros1(store.types[TYPE](speed=3.0, gear=7), TYPE))

with merged.open("wb") as file:
    writer = McapWriter(file)
    writer.start(profile="ros2")
    for number, definition in enumerate((FIRST, SECOND), 1):
        store = store_of(definition)
        data = bytes(store.serialize_cdr(store.types[TYPE](speed=3.0, gear=7), TYPE))
        schema = writer.register_schema(TYPE, "ros2msg", definition.encode())
        writer.add_message(writer.register_channel(f"/drive{number}", "cdr", schema), number, data, number)
    writer.finish()
with merged.open("rb") as file:
    others = [
        one.decoded_message.speed
        for one in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
    ]

alone, together, of_merged = speeds(old) + speeds(new), speeds(old, new), speeds(merged)
print(f"rosbags {version('rosbags')}, each message has the speed 3.0")
print(f"  the two bags, each alone:    {alone}")
print(f"  the two bags together:       {together}")
print(f"  one MCAP with both:          {of_merged}")
print(f"  the same, mcap-ros2-support: {others}")
holds = alone == others == [3.0, 3.0] and all(sorted(some)[0] < 1e-40 for some in (together, of_merged))
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"

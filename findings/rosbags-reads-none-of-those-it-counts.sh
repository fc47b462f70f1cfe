#!/bin/sh
# rosbags 0.11.9 with mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: an MCAP file without message indexes, which the specification makes optional, is read
# more slowly. Where a reader counts five messages it gives five.
#
# What is seen: in a file that has chunk indexes and no message indexes, `message_count` and the count of each connection
# are right, and `messages()` gives none: no error, no warning. A program that evaluates such a drive finds nothing wrong
# in it. The reader of the package mcap gives all of them.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 mcap==1.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import struct
import sys
from importlib.metadata import version
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import IndexType, Writer
from rosbags.highlevel import AnyReader


def counts(name, index_types):
    """How many messages rosbags counts, rosbags reads and mcap reads."""
    path = Path(sys.argv[1]) / f"{name}.mcap"
    with path.open("wb") as file:
        writer = Writer(file, index_types=index_types)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data\n")
        channel = writer.register_channel("/speed", "cdr", schema)
        for number in range(1, 6):
            writer.add_message(channel, number, b"\0\1\0\0" + struct.pack("<d", number), number)
        writer.finish()
    with AnyReader([path]) as reader:
        counted, read = reader.message_count, sum(1 for _ in reader.messages())
    with path.open("rb") as file:
        return counted, read, sum(1 for _ in make_reader(file).iter_messages())


print(f"rosbags {version('rosbags')}, mcap {version('mcap')}, 5 messages written")
every, few = counts("every", IndexType.ALL), counts("few", IndexType.CHUNK)
for name, (counted, read, others) in {"with message indexes": every, "with chunk indexes only": few}.items():
    print(f"  {name}: rosbags counts {counted} and reads {read}; mcap reads {others}")
holds = every == (5, 5, 5) and few == (5, 0, 5)
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"

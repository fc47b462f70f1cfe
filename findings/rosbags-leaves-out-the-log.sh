#!/bin/sh
# rosbags 0.11.9 (PyPI).
#
# What a good engineer would guess: a reader of SQLite bags shows all messages that SQLite itself shows. `ros2 bag record`
# with the profile "resilient" keeps a write-ahead log, so that a power cut costs little; after one, the newest messages
# are in the file `….db3-wal` beside the database.
#
# What is seen: rosbags opens the database as "immutable", by which SQLite ignores that log. The messages in it are
# missing, with no error and no warning, and they are not counted. Python's sqlite3 reads all of them from the same files.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import shutil
import sqlite3
import sys
from importlib.metadata import version
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

TYPE = "std_msgs/msg/Float64"
store = get_typestore(Stores.ROS2_JAZZY)
drive, left = Path(sys.argv[1]) / "drive", Path(sys.argv[1]) / "left"


def data(number):
    return bytes(store.serialize_cdr(store.types[TYPE](data=float(number)), TYPE))


with Writer(drive, version=9) as writer:
    speed = writer.add_connection("/speed", TYPE, typestore=store)
    for number in range(10):
        writer.write(speed, number, data(number))
# The journal of the recorder's profile "resilient", and what is on the disk when the recorder loses its power.
database = sqlite3.connect(drive / "drive.db3")
database.execute("PRAGMA journal_mode = WAL")
for number in range(10, 30):
    with database:
        database.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)", (number, data(number)))
shutil.copytree(drive, left)
database.close()

with AnyReader([left / "drive.db3"]) as reader:
    counted, read = reader.message_count, sum(1 for _ in reader.messages())
with sqlite3.connect(left / "drive.db3") as database:
    (there,) = database.execute("SELECT count(*) FROM messages").fetchone()
print(f"rosbags {version('rosbags')}, SQLite {sqlite3.sqlite_version}, 30 messages written")
print(f"  rosbags: {counted} counted, {read} read")
print(f"  sqlite3: {there}")
holds = (counted, read, there) == (10, 10, 30)
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"

#!/bin/sh
# rosbags 0.11.9 (PyPI).
#
# What a good engineer would guess: a recorder in Python that is ended with Ctrl-C, or whose loop raises an error, leaves
# the messages that it wrote until then. The writer is a context manager, and its documentation has it used as one.
#
# What is seen: with SQLite, the writer's default storage, the whole recording is one transaction. An exception in the
# `with` block, KeyboardInterrupt too, rolls it back: a database with no message and no metadata.yaml is left, without a
# warning. A process that is killed leaves no message either, however long it ran. With `StoragePlugin.MCAP` most of the
# messages can still be read from the file's front.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 mcap==1.6.0 || exit 2

cat > "$folder/record.py" <<'PYTHON'
"""`record.py FOLDER STORAGE END`: writes 20 000 messages, then ends by END."""

import os
import signal
import sys
from pathlib import Path

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

path, storage, end = sys.argv[1:]
store = get_typestore(Stores.ROS2_JAZZY)
options = {} if storage == "default" else {"storage_plugin": StoragePlugin[storage]}
with Writer(Path(path), version=9, **options) as writer:
    topic = writer.add_connection("/note", "std_msgs/msg/String", typestore=store)
    for number in range(20_000):
        message = store.types["std_msgs/msg/String"](data=f"message {number} ".ljust(500, "."))
        writer.write(topic, number + 1, store.serialize_cdr(message, "std_msgs/msg/String"))
    if end != "normal":
        os.kill(os.getpid(), {"Ctrl-C": signal.SIGINT, "kill": signal.SIGKILL}[end])
        for number in range(10**9):  # the signal is handled between two of these
            pass
PYTHON

cat > "$folder/try.py" <<'PYTHON'
import sqlite3
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from mcap.reader import NonSeekingReader

folder = Path(sys.argv[1])


def left(storage, end):
    """How many messages are on the disk after a recorder ended so."""
    path = folder / f"{storage}-{end}"
    command = [sys.executable, str(folder / "record.py"), str(path), storage, end]
    subprocess.run(command, stderr=subprocess.DEVNULL, timeout=60)
    if storage == "default":
        with sqlite3.connect(next(path.glob("*.db3"))) as database:
            return database.execute("SELECT count(*) FROM messages").fetchone()[0]
    count = 0
    with next(path.glob("*.mcap")).open("rb") as file:
        try:
            for _ in NonSeekingReader(file).iter_messages(log_time_order=False):
                count += 1
        except Exception:
            pass  # the end of what was written
    return count


print(f"rosbags {version('rosbags')}, 20000 messages written")
counts = {(storage, end): left(storage, end) for storage in ("default", "MCAP") for end in ("normal", "Ctrl-C", "kill")}
for (storage, end), count in counts.items():
    print(f"  storage {storage}, end {end}: {count} messages left")
lost = [counts["default", end] for end in ("Ctrl-C", "kill")]
holds = counts["default", "normal"] == 20_000 and lost == [0, 0] and counts["MCAP", "Ctrl-C"] > 10_000
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"

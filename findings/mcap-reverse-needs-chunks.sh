#!/bin/sh
# mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: `next(reader.iter_messages(reverse=True))` is the newest message of a file. The
# documentation promises that with `reverse`, and `log_time_order` as it is by default, messages come in descending order.
#
# What is seen: in a file without chunks, which `Writer(…, use_chunking=False)` writes, `reverse` is ignored without an
# error: the first message that comes is the oldest one. The last known position of a vehicle is then that of its start.
# `NonSeekingReader` respects `reverse` in the same file.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mcap==1.6.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import io
import sys
from importlib.metadata import version

from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer


def times(use_chunking, make):
    """The times of the messages, read in reverse."""
    file = io.BytesIO()
    writer = Writer(file, use_chunking=use_chunking)
    writer.start()
    channel = writer.register_channel("/count", "json", writer.register_schema("count", "jsonschema", b"{}"))
    for number in range(1, 6):
        writer.add_message(channel, number, b"{}", number)
    writer.finish()
    file.seek(0)
    return [message.log_time for _, _, message in make(file).iter_messages(reverse=True)]


rows = {
    "with chunks, make_reader": times(True, make_reader),
    "without chunks, make_reader": times(False, make_reader),
    "without chunks, NonSeekingReader": times(False, NonSeekingReader),
}
print(f"mcap {version('mcap')}, iter_messages(reverse=True)")
for name, found in rows.items():
    print(f"  {name}: {found}")
holds = list(rows.values()) == [[5, 4, 3, 2, 1], [1, 2, 3, 4, 5], [5, 4, 3, 2, 1]]
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

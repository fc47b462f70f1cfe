#!/bin/sh
# mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: a recording whose end is missing, as after a power cut, gives its complete messages
# before an error says that the rest is missing. MCAP is made for that: chunks are read from the front.
#
# What is seen: `make_reader` takes the reader that begins with the summary at the end, and raises before the first
# message. `NonSeekingReader(file).iter_messages()` raises before the first message too: by default it sorts by time, and
# reads the whole file before it gives anything. With `log_time_order=False` all complete messages come first.
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

file = io.BytesIO()
writer = Writer(file, chunk_size=200)
writer.start()
channel = writer.register_channel("/count", "json", writer.register_schema("count", "jsonschema", b"{}"))
for number in range(100):
    writer.add_message(channel, number, b'{"data": %d}' % number, number)
writer.finish()
whole = file.getvalue()
cut = whole[: len(whole) // 3]


def messages(reader, **options):
    """How many messages come, and the kind of error that ends them."""
    count = 0
    try:
        for _ in reader.iter_messages(**options):
            count += 1
    except Exception as error:
        return count, type(error).__name__
    return count, None


rows = {
    "whole, make_reader": messages(make_reader(io.BytesIO(whole))),
    "cut, make_reader": messages(make_reader(io.BytesIO(cut))),
    "cut, NonSeekingReader": messages(NonSeekingReader(io.BytesIO(cut))),
    "cut, NonSeekingReader, log_time_order=False": messages(NonSeekingReader(io.BytesIO(cut)), log_time_order=False),
}
print(f"mcap {version('mcap')}")
for name, (count, error) in rows.items():
    print(f"  {name}: {count} messages, then {error or 'the end'}")
counts = [count for count, _ in rows.values()]
holds = counts[:3] == [100, 0, 0] and 20 < counts[3] < 100
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

#!/bin/sh
# mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: `iter_metadata` and `iter_attachments` give every metadata record and attachment
# of a file. Their indexes are optional in MCAP, as those of messages, without which the same reader reads all
# messages.
#
# What is seen: where a file has a summary without these indexes, both give nothing, without an error, though the
# statistics in the same summary count them. Only a file without any summary is read through for them.
# `NonSeekingReader` gives them. So the number of the vehicle or its calibration is missing in a file that has it.
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
from mcap.writer import IndexType, Writer


def written(index_types):
    """A file with a message, a metadata record and an attachment, and these indexes."""
    file = io.BytesIO()
    writer = Writer(file, index_types=index_types)
    writer.start()
    channel = writer.register_channel("/speed", "json", writer.register_schema("speed", "jsonschema", b"{}"))
    writer.add_message(channel, 1, b"{}", 1)
    writer.add_metadata("vehicle", {"number": "7"})
    writer.add_attachment(1, 1, "calibration.txt", "text/plain", b"offset 0.25")
    writer.finish()
    return file.getvalue()


def found(content, make):
    """How many messages, metadata records and attachments a reader gives."""
    kinds = ("iter_messages", "iter_metadata", "iter_attachments")
    return tuple(len(list(getattr(make(io.BytesIO(content)), kind)())) for kind in kinds)


every, none = written(IndexType.ALL), written(IndexType.NONE)
counts = make_reader(io.BytesIO(none)).get_summary().statistics
counted = (counts.message_count, counts.metadata_count, counts.attachment_count)
rows = {
    "all indexes, make_reader": (found(every, make_reader), (1, 1, 1)),
    "no index, by its statistics": (counted, (1, 1, 1)),
    "no index, make_reader": (found(none, make_reader), (1, 0, 0)),
    "no index, NonSeekingReader": (found(none, NonSeekingReader), (1, 1, 1)),
}
print(f"mcap {version('mcap')}: messages, metadata records, attachments")
for name, (got, _) in rows.items():
    print(f"  {name + ':':28} {got}")
holds = all(got == expected for got, expected in rows.values())
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

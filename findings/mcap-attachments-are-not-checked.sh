#!/bin/sh
# mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: a reader that was made with `validate_crcs=True` raises for every part of a file
# whose checksum is wrong. Each attachment of MCAP has one, and the library's writer fills it in.
#
# What is seen: the checksums of chunks are compared, those of attachments are passed over. A calibration or a note
# with a flipped bit is given as it is, by both readers, without an error; a message with the same damage raises
# CRCValidationError. The two readers' classes state that the checksums are those of chunks; `make_reader`, by which
# they are made, states nothing. Whoever needs it must compare the record's bytes with its last four.
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
from mcap.stream_reader import CRCValidationError
from mcap.writer import CompressionType, Writer

NOTE, MESSAGE = b"brake: 7.5 bar", b'{"speed": 7.5}'


def written():
    """A file with one message and one attachment."""
    file = io.BytesIO()
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start()
    channel = writer.register_channel("/speed", "json", writer.register_schema("speed", "jsonschema", b"{}"))
    writer.add_message(channel, 1, MESSAGE, 1)
    writer.add_attachment(1, 1, "calibration.txt", "text/plain", NOTE)
    writer.finish()
    return file.getvalue()


def attachment(content, make):
    try:
        return next(make(io.BytesIO(content), validate_crcs=True).iter_attachments()).data
    except CRCValidationError as error:
        return type(error).__name__


def message(content, make):
    try:
        return next(iter(make(io.BytesIO(content), validate_crcs=True).iter_messages()))[2].data
    except CRCValidationError as error:
        return type(error).__name__


whole = written()
damaged = {one: whole.replace(one, one.replace(b"7.5", b"3.5")) for one in (NOTE, MESSAGE)}
print(f"mcap {version('mcap')}, validate_crcs=True")
holds = True
for make in (make_reader, NonSeekingReader):
    print(f"  {make.__name__}:")
    print(f"    whole attachment:   {attachment(whole, make)}")
    print(f"    damaged attachment: {attachment(damaged[NOTE], make)}")
    print(f"    damaged message:    {message(damaged[MESSAGE], make)}")
    holds &= attachment(whole, make) == NOTE and attachment(damaged[NOTE], make) == NOTE.replace(b"7.5", b"3.5")
    holds &= message(damaged[MESSAGE], make) == "CRCValidationError"
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

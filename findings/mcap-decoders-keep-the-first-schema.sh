#!/bin/sh
# mcap-ros2-support 0.6.0 and mcap-ros1-support 0.9.0 with mcap 1.6.0 (PyPI).
#
# What a good engineer would guess: one `DecoderFactory` serves for all files that a program reads. It is made without a
# file, `make_reader` takes a list of such factories, and every file has its own schemas.
#
# What is seen: the factory keeps its decoders by the number of the schema, which counts from 1 in each file. The next
# file's schema 1 is decoded as the type of the first file's: the count 7 becomes a `Speed` of 9.8e-45, without an error
# where the bytes fit. A factory must be made for each file.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mcap==1.6.0 mcap-ros2-support==0.6.0 mcap-ros1-support==0.9.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import io
import struct
import sys
from importlib.metadata import version

import mcap_ros1.decoder
import mcap_ros2.decoder
from mcap.reader import make_reader
from mcap.writer import Writer


def recording(kind, name, definition, data):
    """A file with one message."""
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile=kind)
    schema = writer.register_schema(name, f"{kind}msg", definition.encode())
    encoding, data = ("cdr", b"\0\1\0\0" + data) if kind == "ros2" else ("ros1", data)
    writer.add_message(writer.register_channel("/one", encoding, schema), 1, data, 1)
    writer.finish()
    return file.getvalue()


def value(file, factory):
    reader = make_reader(io.BytesIO(file), decoder_factories=[factory])
    return next(iter(reader.iter_decoded_messages())).decoded_message.value


holds = True
for kind, package, make in (
    ("ros2", "mcap-ros2-support", mcap_ros2.decoder.DecoderFactory),
    ("ros1", "mcap-ros1-support", mcap_ros1.decoder.DecoderFactory),
):
    speed = recording(kind, "bench_msgs/Speed", "float32 value\n", struct.pack("<f", 3.0))
    count = recording(kind, "bench_msgs/Count", "uint32 value\n", struct.pack("<I", 7))
    shared = make()
    own, both = (value(speed, make()), value(count, make())), (value(speed, shared), value(count, shared))
    print(f"{package} {version(package)}, a speed of 3.0 and a count of 7 in two files")
    print(f"  a factory for each file:   {own[0]}, {own[1]}")
    print(f"  one factory for both:      {both[0]}, {both[1]}")
    holds = holds and own == (3.0, 7) and both[0] == 3.0 and 0 < both[1] < 1e-40
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

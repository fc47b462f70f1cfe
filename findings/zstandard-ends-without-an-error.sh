#!/bin/sh
# zstandard 0.25.0 (PyPI).
#
# What a good engineer would guess: a recording that is packed with zstd as a whole, as `ros2 bag record` does it in
# the mode "file", is either unpacked whole or raises an error where its end is missing, as gzip and bz2 of Python do.
# What the zstd tool joins of several packed files is unpacked as all of them.
#
# What is seen: `stream_reader` and `copy_stream` end where the bytes end: of a cut file they give what they have,
# here half of 100 000 bytes, without an error. `decompress` raises there; but of two joined files it gives the first
# one only, where `stream_reader` and `copy_stream` give both. `read_to_iter` gives half of the one and the first of
# the other. None of these is right in both cases. `decompressobj`, a frame at a time, is: of a cut file its `eof`
# stays False, and of joined files it has the rest in `unused_data`.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check zstandard==0.25.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import io
import random
import sys
from importlib.metadata import version

import zstandard

random.seed(1)
FIRST, SECOND = random.randbytes(100_000), random.randbytes(50_000)


def by_copy(packed):
    out = io.BytesIO()
    zstandard.ZstdDecompressor().copy_stream(io.BytesIO(packed), out)
    return out.getvalue()


WAYS = {
    "decompress": lambda packed: zstandard.ZstdDecompressor().decompress(packed),
    "stream_reader": lambda packed: zstandard.ZstdDecompressor().stream_reader(io.BytesIO(packed)).read(),
    "copy_stream": by_copy,
    "read_to_iter": lambda packed: b"".join(zstandard.ZstdDecompressor().read_to_iter(io.BytesIO(packed))),
}


def found(way, packed):
    """How many bytes a function gives; the name of the error where it raises one."""
    try:
        return len(way(packed))
    except zstandard.ZstdError:
        return "ZstdError"


one = zstandard.ZstdCompressor().compress(FIRST)
cut, joined = one[: len(one) // 2], one + zstandard.ZstdCompressor().compress(SECOND)
rows = {name: (found(way, cut), found(way, joined)) for name, way in WAYS.items()}
print(f"zstandard {version('zstandard')}")
for name, (of_cut, of_joined) in rows.items():
    print(f"  {name + ':':15} cut in the middle: {of_cut!s:10} two joined, of 150000 bytes: {of_joined}")
holds = (
    rows["decompress"] == ("ZstdError", 100_000)
    and all(rows[name][1] == 150_000 for name in ("stream_reader", "copy_stream"))
    and rows["read_to_iter"][1] == 100_000
    and all(isinstance(rows[name][0], int) and rows[name][0] < 100_000 for name in list(rows)[1:])
)
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"

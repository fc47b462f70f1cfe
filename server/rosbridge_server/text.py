"""JSON text in other forms: a picture, and fragments."""

from __future__ import annotations

import base64
import math
import struct
import zlib
from typing import Any

MOST_FRAGMENTS = 10_000  # of one message: shorter ones than that takes are not sent


def png(data: bytes) -> str:
    """A JSON text as pixels of a nearly square RGB picture, padded with line ends, in base64."""
    width = math.floor(math.sqrt(len(data) / 3.0))
    height = math.ceil((len(data) / 3.0) / width)
    data = data.ljust(width * height * 3, b"\n")
    rows = b"".join(b"\0" + data[at : at + width * 3] for at in range(0, len(data), width * 3))
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    picture = b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", head) + _chunk(b"IDAT", zlib.compress(rows)) + _chunk(b"IEND", b"")
    return base64.b64encode(picture).decode("ascii")


def fragments(text: str, size: int, id: object) -> list[dict[str, Any]]:
    """The pieces of a text that is longer than `size`. `total` is a fraction, as rosbridge divides."""
    size = max(size, math.ceil(len(text) / MOST_FRAGMENTS))
    total = (len(text) - 1) / size + 1
    starts = range(0, len(text), size)
    return [
        {"op": "fragment", "id": id, "data": text[at : at + size], "num": number, "total": total}
        for number, at in enumerate(starts)
    ]


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

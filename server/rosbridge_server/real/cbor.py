"""CBOR as the real bridge writes it: floats always in eight bytes, typed arrays as tags."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

from server.judge.message import RosVersion
from server.rosbridge_server.real.shape import Lost


@dataclass(frozen=True, slots=True)
class Tagged:
    """Bytes under a CBOR tag: a typed array."""

    tag: int
    value: bytes


def dumps(value: Any, version: RosVersion) -> bytes:
    """The bytes of one value. Raises Lost for what the real bridge cannot write."""
    if value is None:
        return b"\xf6"
    if isinstance(value, bool):
        return b"\xf5" if value else b"\xf4"
    if isinstance(value, float):
        return b"\xfb" + struct.pack(">d", value)
    if isinstance(value, int):
        return _integer(value, version)
    if isinstance(value, str):
        data = value.encode("utf-8", "surrogatepass")
        return _head(3, len(data)) + data
    if isinstance(value, bytes):
        return _head(2, len(value)) + value
    if isinstance(value, Tagged):
        return _head(6, value.tag) + dumps(value.value, version)
    if isinstance(value, list):
        return _head(4, len(value)) + b"".join(dumps(item, version) for item in value)
    if isinstance(value, dict):
        pairs = (dumps(key, version) + dumps(item, version) for key, item in value.items())
        return _head(5, len(value)) + b"".join(pairs)
    raise Lost(f"don't know how to cbor serialize object of type {type(value)}")


def _integer(value: int, version: RosVersion) -> bytes:
    largest = 2**64 - 1 if version == 2 else 2**64 - 2  # ROS 1's encoder takes the largest uint64 for a bignum
    if 0 <= value <= largest:
        return _head(0, value)
    if value < 0 and -1 - value <= largest:
        return _head(1, -1 - value)
    size = value if value >= 0 else -1 - value
    return _head(6, 2 if value >= 0 else 3) + dumps(size.to_bytes((size.bit_length() + 7) // 8, "big"), version)


def _head(kind: int, size: int) -> bytes:
    first = kind << 5
    if size < 24:
        return bytes((first | size,))
    for extra, bits in ((24, 8), (25, 16), (26, 32), (27, 64)):
        if size < 1 << bits:
            return bytes((first | extra,)) + size.to_bytes(bits // 8, "big")
    raise Lost("a number of more than 64 bits")

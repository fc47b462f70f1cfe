"""Frames of the rosbridge protocol: JSON and CBOR to plain values and back."""

from __future__ import annotations

import json
from typing import Any

import cbor2
import numpy as np
import orjson

MAX_DEPTH = 64  # a ROS message nests a handful deep; what goes deeper was made to hurt

# RFC 8746: typed arrays. Little-endian kinds only; rosbridge sends no others.
_TYPED_ARRAYS = {
    64: "u1", 68: "u1", 69: "<u2", 70: "<u4", 71: "<u8",
    72: "i1", 77: "<i2", 78: "<i4", 79: "<i8",
    84: "<f2", 85: "<f4", 86: "<f8",
    65: ">u2", 66: ">u4", 67: ">u8", 73: ">i2", 74: ">i4", 75: ">i8", 80: ">f2", 81: ">f4", 82: ">f8",
}  # fmt: skip


class Unreadable(ValueError):
    """A frame that is no rosbridge operation; `str()` says why, in few words."""


def encode(operation: dict[str, Any]) -> bytes:
    """JSON text of an operation; numpy values allowed, NaN and infinities become null."""
    return orjson.dumps(operation, option=orjson.OPT_SERIALIZE_NUMPY)


def decode(payload: bytes, is_binary: bool) -> tuple[dict[str, Any], str | None]:
    """The operation in a frame, and a note where it had to be read with indulgence. Raises Unreadable."""
    note: str | None = None
    if is_binary:
        operation = _from_cbor(payload)
    else:
        try:
            operation = orjson.loads(payload)
        except orjson.JSONDecodeError:
            operation = _from_lax_json(payload)
            note = "bare NaN or Infinity, read as unknown"
    if not isinstance(operation, dict):
        raise Unreadable("a frame that is not an object")
    return operation, note


def _from_lax_json(payload: bytes) -> Any:
    """JSON with the bare NaN and Infinity tokens that ROS 2's fixed-size arrays can carry."""
    if not (b"NaN" in payload or b"Infinity" in payload):
        raise Unreadable("text that is not JSON")
    try:
        return json.loads(payload)
    except (ValueError, RecursionError):
        raise Unreadable("text that is not JSON") from None


def _from_cbor(payload: bytes) -> Any:
    try:
        return cbor2.loads(payload, tag_hook=_typed_array)
    except (cbor2.CBORDecodeError, ValueError, TypeError, RecursionError, OverflowError, MemoryError):
        raise Unreadable("binary noise") from None


def _typed_array(*arguments: Any) -> Any:
    tag = arguments[-1] if isinstance(arguments[-1], cbor2.CBORTag) else arguments[0]
    kind = _TYPED_ARRAYS.get(tag.tag)
    if kind is None or not isinstance(tag.value, bytes):
        return tag.value
    return np.frombuffer(tag.value, dtype=kind)

"""Frames of the rosbridge protocol: JSON and CBOR to plain values and back."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

import cbor2
import numpy as np
import orjson

MAX_DEPTH = 64  # a ROS message nests a handful deep; what goes deeper was made to hurt

# RFC 8746: typed arrays. Tag 76 is reserved there, and 83 and 87 are for floats of 128 bits, which no ROS message has.
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
    """The operation in a frame, and a note where it had to be read with indulgence. Raises Unreadable.

    Text is whole Unicode, whole numbers have at most 64 bits and a sign, no value holds itself, nothing nests deeper
    than MAX_DEPTH. From CBOR, arrays of numbers are numpy arrays, and bytes are bytes.
    """
    note: str | None = None
    if is_binary:
        operation = _from_cbor(payload)
    else:
        try:
            operation = orjson.loads(payload)
        except orjson.JSONDecodeError:
            operation = _from_lax_json(payload)
            note = "bare NaN or Infinity, read as unknown"
        if _may_be_deep(payload) and _is_deep(operation):
            raise Unreadable("a frame that nests too deep")
    if not isinstance(operation, dict):
        raise Unreadable("a frame that is not an object")
    return operation, note


def _may_be_deep(payload: bytes) -> bool:
    """A glance of a microsecond: most messages have fewer brackets than may stand in each other."""
    return payload.count(b"[") + payload.count(b"{") > MAX_DEPTH


def _is_deep(value: Any) -> bool:
    level = [value]
    for _ in range(MAX_DEPTH + 1):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, (dict, list))
        ]
        if not level:
            return False
    return True


def _from_lax_json(payload: bytes) -> Any:
    """JSON with the bare NaN and Infinity tokens that ROS 2's fixed-size arrays can carry."""
    if not (b"NaN" in payload or b"Infinity" in payload):
        raise Unreadable("text that is not JSON")
    try:
        operation = json.loads(payload.decode(), parse_int=_whole, parse_float=_number)
        orjson.dumps(operation)  # Python's reader lets half characters pass, which nothing after it could write again
    except (ValueError, TypeError, RecursionError):
        raise Unreadable("text that is not JSON") from None
    return operation


def _whole(digits: str) -> int | float:
    """As orjson reads them: beyond 64 bits a whole number is a float."""
    if len(digits) < 19:
        return int(digits)
    number = _number(digits)
    return int(digits) if -(2**63) <= int(digits) < 2**64 else number


def _number(digits: str) -> float:
    number = float(digits)
    if not math.isfinite(number):
        raise ValueError("a number beyond every float")
    return number


def _from_cbor(payload: bytes) -> Any:
    try:
        return cbor2.loads(
            payload,
            tag_hook=_typed_array,
            semantic_decoders=_NOT_SENT,
            max_depth=MAX_DEPTH,
            strict_hashable_types=True,
        )
    except (cbor2.CBORDecodeError, ValueError, TypeError, RecursionError, OverflowError, MemoryError):
        raise Unreadable("binary noise") from None


def _typed_array(tag: cbor2.CBORTag, immutable: bool) -> Any:
    kind = _TYPED_ARRAYS.get(tag.tag)
    if kind is None or not isinstance(tag.value, bytes):
        return tag.value
    return np.frombuffer(tag.value, dtype=kind)


def _refuse(value: Any, immutable: bool) -> NoReturn:
    raise ValueError("a kind of value that no ROS message has")


# Numbers of any size, dates, patterns, values shared with each other and with themselves: rosbridge sends none of the
# kinds that cbor2 knows besides, and a hostile one could hang us with some.
_NOT_SENT = dict.fromkeys(
    (0, 1, 2, 3, 4, 5, 25, 28, 29, 30, 35, 36, 37, 52, 54, 100, 256, 258, 260, 261, 1004, 43000), _refuse
)

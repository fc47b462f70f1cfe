"""Frames of the rosbridge protocol: JSON and CBOR to plain values and back, and messages as their bytes."""

from __future__ import annotations

import base64
import contextlib
import gc
import json
import math
from collections.abc import Iterator
from typing import Any, NoReturn

import cbor2
import numpy as np
import orjson

MAX_DEPTH = 64  # a ROS message nests a few levels; deeper ones are hostile
# What a frame may hold: parsing it holds up the event loop, and from any thread every other one. The figures are what
# takes some 40 ms; 1.4 million objects took 2 s, twice.
MAX_CONTAINERS = 50_000  # objects and arrays
MAX_ELEMENTS = 500_000
MAX_SLOW_ELEMENTS = 100_000  # in CBOR, and in JSON with NaN, which take longer
_FEW_BYTES = 20_000  # too short for too many
_PAUSE_GC_BYTES = 100_000

# RFC 8746: typed arrays. Tag 76 is reserved there, and 83 and 87 are for floats of 128 bits, which no ROS message has.
_TYPED_ARRAYS = {
    64: "u1", 68: "u1", 69: "<u2", 70: "<u4", 71: "<u8",
    72: "i1", 77: "<i2", 78: "<i4", 79: "<i8",
    84: "<f2", 85: "<f4", 86: "<f8",
    65: ">u2", 66: ">u4", 67: ">u8", 73: ">i2", 74: ">i4", 75: ">i8", 80: ">f2", 81: ">f4", 82: ">f8",
}  # fmt: skip

# RFC 8746 tags for typed arrays, little-endian. uint8 has none here: rosbridge sends byte arrays as plain byte strings.
_ARRAY_TAGS = {
    "u2": 69, "u4": 70, "u8": 71,
    "i1": 72, "i2": 77, "i4": 78, "i8": 79,
    "f4": 85, "f8": 86,
}  # fmt: skip


class Unreadable(ValueError):
    """A frame that is not a rosbridge operation; `str()` has the reason."""


class TooManyParts(Unreadable):
    """A frame that would take too long to parse."""

    def __init__(self) -> None:
        super().__init__("a message with too many parts")


def encode(operation: dict[str, Any]) -> bytes:
    """JSON text of an operation; numpy values allowed, NaN and infinities become null."""
    return orjson.dumps(operation, option=orjson.OPT_SERIALIZE_NUMPY)


def decode(payload: bytes, is_binary: bool) -> tuple[dict[str, Any], str | None]:
    """The operation in a frame, and a note where it had to be read with indulgence. Raises Unreadable.

    It is not parsed where it holds too much: raises TooManyParts, an Unreadable.

    Text is whole Unicode, whole numbers have at most 64 bits and a sign, no value holds itself, nothing nests deeper
    than MAX_DEPTH. From CBOR, arrays of numbers are numpy arrays, and bytes are bytes.
    """
    if len(payload) > _FEW_BYTES and (_has_much_cbor(payload) if is_binary else _has_much_json(payload)):
        raise TooManyParts
    with _without_gc(len(payload)):
        return _parse(payload, is_binary)


def _parse(payload: bytes, is_binary: bool) -> tuple[dict[str, Any], str | None]:
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


def _has_much_json(payload: bytes) -> bool:
    """By the signs between values; those inside of texts count too, which no ROS message has so many of."""
    return payload.count(b"[") + payload.count(b"{") > MAX_CONTAINERS or payload.count(b",") > MAX_ELEMENTS


def _has_much_cbor(payload: bytes) -> bool:
    """By the heads of all values, one after the other; strings, and the arrays of numbers in them, are passed over."""
    at = containers = elements = 0
    end = len(payload)
    while at < end:
        kind, size = divmod(payload[at], 32)
        at += 1
        if 24 <= size < 28:
            width = 1 << (size - 24)
            size = int.from_bytes(payload[at : at + width], "big")
            at += width
        elif size == 31:  # of no declared length
            size = 0
        if kind in (2, 3):
            at += size
        elif kind in (4, 5):
            containers += 1
        elements += 1
        if containers > MAX_CONTAINERS or elements > MAX_SLOW_ELEMENTS:
            return True
    return False


@contextlib.contextmanager
def _without_gc(size: int) -> Iterator[None]:
    """Disable the garbage collector while a large message is parsed; it would scan it repeatedly."""
    if size < _PAUSE_GC_BYTES or not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _may_be_deep(payload: bytes) -> bool:
    """A check of a microsecond: most messages have fewer brackets than may be nested."""
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
    if payload.count(b",") > MAX_SLOW_ELEMENTS:
        raise TooManyParts
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
        raise ValueError("a number beyond the range of floats")
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
    raise ValueError("a value type that no ROS message has")


def _bignum(value: Any, immutable: bool) -> int:
    """A uint64 above 2^63, which rosbridge of ROS 1 sends as a bignum."""
    if not isinstance(value, bytes) or len(value) > 8:
        raise ValueError("a number of more than 64 bits")
    return int.from_bytes(value)


# rosbridge sends none of the further kinds of values of cbor2, and some could take long.
_NOT_SENT = dict.fromkeys(
    (0, 1, 3, 4, 5, 25, 28, 29, 30, 35, 36, 37, 52, 54, 100, 256, 258, 260, 261, 1004, 43000), _refuse
) | {2: _bignum}


class Unencodable(ValueError):
    """The message holds something that neither JSON nor CBOR can carry."""


def json_bytes(message: Any) -> bytes:
    """JSON as rosbridge writes it: NaN and ±Inf as null, byte arrays as base64, numpy arrays as lists."""
    try:
        return orjson.dumps(message, option=orjson.OPT_SERIALIZE_NUMPY, default=_json_default)
    except TypeError:
        pass  # an array in foreign byte order, a key that is no text, a lone surrogate: take the slow road once
    try:
        return orjson.dumps(_plain(message))
    except (TypeError, RecursionError) as error:
        raise Unencodable(str(error)) from None


def cbor_bytes(message: Any) -> bytes:
    """CBOR as rosbridge writes it: NaN and ±Inf kept, numeric arrays as little-endian typed arrays, bytes as bytes."""
    try:
        return cbor2.dumps(message, default=_cbor_default)
    except (TypeError, ValueError, RecursionError, cbor2.CBOREncodeError) as error:
        raise Unencodable(str(error)) from None


def _json_default(value: Any) -> Any:
    if isinstance(value, bytes | bytearray | memoryview):
        return base64.b64encode(value).decode("ascii")
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _plain(value: Any) -> Any:
    """The same value in plain Python, for what the fast road refuses."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, bool | int) or value is None:
        return value
    return _json_default(value)


def _cbor_default(encoder: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        encoder.encode(_tagged_array(value))
    elif isinstance(value, np.generic):
        encoder.encode(value.item())
    else:
        raise TypeError(f"{type(value).__name__} cannot be sent")


def _tagged_array(array: np.ndarray[Any, Any]) -> Any:
    code = array.dtype.kind + str(array.dtype.itemsize)
    if array.ndim == 1 and code in _ARRAY_TAGS:
        return cbor2.CBORTag(_ARRAY_TAGS[code], array.astype("<" + code, copy=False).tobytes())
    if array.ndim == 1 and code == "u1":
        return array.tobytes()
    return array.tolist()

"""A message as the bytes in which rosbridge carries it: JSON and CBOR."""

from __future__ import annotations

import base64
import math
from typing import Any

import cbor2
import numpy as np
import orjson

# RFC 8746 tags for typed arrays, little-endian. uint8 has none here: rosbridge sends byte arrays as plain byte strings.
_ARRAY_TAGS = {
    "u2": 69, "u4": 70, "u8": 71,
    "i1": 72, "i2": 77, "i4": 78, "i8": 79,
    "f4": 85, "f8": 86,
}  # fmt: skip


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
        encoder.encode(_typed_array(value))
    elif isinstance(value, np.generic):
        encoder.encode(value.item())
    else:
        raise TypeError(f"{type(value).__name__} cannot be sent")


def _typed_array(array: np.ndarray[Any, Any]) -> Any:
    code = array.dtype.kind + str(array.dtype.itemsize)
    if array.ndim == 1 and code in _ARRAY_TAGS:
        return cbor2.CBORTag(_ARRAY_TAGS[code], array.astype("<" + code, copy=False).tobytes())
    if array.ndim == 1 and code == "u1":
        return array.tobytes()
    return array.tolist()

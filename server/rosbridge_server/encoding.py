"""One outgoing message, encoded at most once as JSON and once as CBOR, however many clients want it."""

from __future__ import annotations

import base64
import math
from typing import Any, Literal

import cbor2
import numpy as np
import orjson

from server.judge.message import Json

Encoding = Literal["json", "cbor"]

_TEXT, _BINARY = 0x1, 0x2

# RFC 8746 tags for typed arrays, little-endian. uint8 has none here: rosbridge sends byte arrays as plain byte strings.
_ARRAY_TAGS = {
    "u2": 69, "u4": 70, "u8": 71,
    "i1": 72, "i2": 77, "i4": 78, "i8": 79,
    "f4": 85, "f8": 86,
}  # fmt: skip


class Unencodable(ValueError):
    """The message holds something that neither JSON nor CBOR can carry."""


def frame(opcode: int, payload: bytes) -> bytes:
    """A whole, final, unmasked WebSocket frame (RFC 6455, 5.2): what a server sends."""
    size = len(payload)
    if size < 126:
        head = bytes((0x80 | opcode, size))
    elif size < 65536:
        head = bytes((0x80 | opcode, 126)) + size.to_bytes(2, "big")
    else:
        head = bytes((0x80 | opcode, 127)) + size.to_bytes(8, "big")
    return head + payload


def text_frame(payload: bytes) -> bytes:
    """A frame of ready-made text."""
    return frame(_TEXT, payload)


def binary_frame(payload: bytes) -> bytes:
    """A frame of ready-made bytes."""
    return frame(_BINARY, payload)


def json_frame(message: Json) -> bytes:
    """A text frame of one JSON object; NaN and ±Inf become null."""
    return frame(_TEXT, json_bytes(message))


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


class Outgoing:
    """A message on its way to every subscriber of its topic. It must not change after it was published."""

    __slots__ = ("_bodies", "_frames", "_message")

    def __init__(self, message: Json) -> None:
        self._message = message
        self._bodies: dict[Encoding, bytes] = {}
        self._frames: dict[tuple[str, Encoding], bytes] = {}

    def frame(self, topic: str, encoding: Encoding) -> bytes:
        """The WebSocket frame for clients which write the topic so ("chatter" and "/chatter" may both be in use)."""
        key = (topic, encoding)
        made = self._frames.get(key)
        if made is None:
            made = self._frames[key] = self._make(topic, encoding)
        return made

    def _make(self, topic: str, encoding: Encoding) -> bytes:
        body = self._bodies.get(encoding)
        if encoding == "json":
            if body is None:
                body = self._bodies["json"] = json_bytes(self._message)
            return frame(_TEXT, b'{"op":"publish","topic":' + orjson.dumps(topic) + b',"msg":' + body + b"}")
        if body is None:
            body = self._bodies["cbor"] = cbor_bytes(self._message)
        # 0xa3: a map of three pairs, written by hand so that the body is encoded once for every spelling of the topic
        return frame(_BINARY, b"\xa3" + _CBOR_OP + _CBOR_TOPIC + cbor2.dumps(topic) + _CBOR_MSG + body)


_CBOR_OP = cbor2.dumps("op") + cbor2.dumps("publish")
_CBOR_TOPIC = cbor2.dumps("topic")
_CBOR_MSG = cbor2.dumps("msg")


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

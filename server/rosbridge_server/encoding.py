"""One outgoing message, encoded at most once as JSON and once as CBOR, however many clients want it."""

from __future__ import annotations

from typing import Literal

import cbor2
import orjson

from server.judge.message import Json
from server.rosbridge.message_bytes import cbor_bytes, json_bytes

Encoding = Literal["json", "cbor"]

_TEXT, _BINARY = 0x1, 0x2


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

"""One outgoing message, encoded at most once in each encoding, however many clients want it."""

from __future__ import annotations

from typing import Literal

import cbor2
import orjson

from server.judge.message import Json
from server.rosbridge.message_bytes import cbor_bytes, json_bytes
from server.rosbridge_server.completion import stamp
from server.rosbridge_server.real.raw import raw_bytes
from server.rosbridge_server.real.shape import Lost
from server.rosbridge_server.real.text import png
from server.rosbridge_server.types import RosContext

Encoding = Literal["json", "cbor", "cbor-raw", "png"]

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

    __slots__ = ("_bodies", "_bridge", "_frames", "_message", "type")

    def __init__(self, bridge: RosContext, type: str, message: Json) -> None:
        """`type`: the publisher's, as this version of ROS spells it."""
        self.type = type
        self._bridge = bridge
        self._message = message
        self._bodies: dict[Encoding, bytes] = {}
        self._frames: dict[tuple[str, Encoding], bytes] = {}

    def frame(self, topic: str, encoding: Encoding) -> bytes:
        """The WebSocket frame for clients which write the topic so ("chatter" and "/chatter" may both be in use).

        Raises Unencodable, and Lost where the message is not of its type or that is not known: it has no raw bytes.
        """
        key = (topic, encoding)
        made = self._frames.get(key)
        if made is None:
            made = self._frames[key] = self._make(topic, encoding)
        return made

    def _make(self, topic: str, encoding: Encoding) -> bytes:
        if encoding == "json":
            return frame(_TEXT, self._as_text(topic))
        if encoding == "png":
            return json_frame({"op": "png", "data": png(self._as_text(topic))})
        # 0xa3: a map of three pairs, written by hand so that the body is encoded once for every spelling of the topic
        return frame(_BINARY, b"\xa3" + _CBOR_OP + _CBOR_TOPIC + cbor2.dumps(topic) + _CBOR_MSG + self._body(encoding))

    def _as_text(self, topic: str) -> bytes:
        return b'{"op":"publish","topic":' + orjson.dumps(topic) + b',"msg":' + self._body("json") + b"}"

    def _body(self, encoding: Encoding) -> bytes:
        body = self._bodies.get(encoding)
        if body is None:
            body = self._bodies[encoding] = self._encode(encoding)
        return body

    def _encode(self, encoding: Encoding) -> bytes:
        if encoding == "json":
            return json_bytes(self._message)
        if encoding == "cbor":
            return cbor_bytes(self._message)
        now = stamp(self._bridge.now(), 1)  # secs and nsecs, whichever the version
        return cbor2.dumps({**now, "bytes": self.raw()})

    def raw(self) -> bytes:
        """The message as ROS sends it between nodes. Raises Lost."""
        definitions = self._bridge.types.definitions(self.type)
        if definitions is None:
            raise Lost(f"the type {self.type} is not known")
        return raw_bytes(self._bridge.types.long_name(self.type), definitions, self._bridge.ros_version, self._message)


_CBOR_OP = cbor2.dumps("op") + cbor2.dumps("publish")
_CBOR_TOPIC = cbor2.dumps("topic")
_CBOR_MSG = cbor2.dumps("msg")

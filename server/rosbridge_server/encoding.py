"""One outgoing message, encoded at most once in each encoding, however many clients want it."""

from __future__ import annotations

from typing import Literal

import cbor2
import orjson

from server.judge.message import Json
from server.rosbridge.message_bytes import cbor_bytes, json_bytes
from server.rosbridge_server.raw import raw_bytes
from server.rosbridge_server.shape import Lost
from server.rosbridge_server.text import fragments, png
from server.rosbridge_server.types import RosContext
from server.rosbridge_server.values import stamp

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


def text_frames(payload: bytes, fragment_size: int | None = None, id: object = None) -> bytes:
    """The frame of a JSON text, or one after another those of its fragments of so many characters."""
    if fragment_size is None or len(payload) <= fragment_size:
        return frame(_TEXT, payload)
    text = payload.decode()
    if len(text) <= fragment_size:
        return frame(_TEXT, payload)
    pieces = fragments(text, fragment_size, 0 if id is None else id)
    return b"".join(frame(_TEXT, json_bytes(piece)) for piece in pieces)


def json_frames(message: Json, fragment_size: int | None = None) -> bytes:
    """The frame, or those of the fragments, of one JSON object; NaN and ±Inf become null."""
    return text_frames(json_bytes(message), fragment_size, message.get("id"))


class Outgoing:
    """A message on its way to every subscriber of its topic. It must not change after it was published."""

    __slots__ = ("_bodies", "_bridge", "_frames", "_message", "type")

    def __init__(self, bridge: RosContext, type: str, message: Json) -> None:
        """`type`: the publisher's, as this version of ROS spells it."""
        self.type = type
        self._bridge = bridge
        self._message = message
        self._bodies: dict[Encoding, bytes] = {}
        self._frames: dict[tuple[str, Encoding, int | None], bytes] = {}

    def frames(self, topic: str, encoding: Encoding, fragment_size: int | None = None) -> bytes:
        """The WebSocket frame for clients which write the topic so ("chatter" and "/chatter" may both be in use).

        Text that is longer than `fragment_size` becomes the frames of its fragments, one after another.
        Raises Unencodable, and Lost where the message is not of its type or that is not known: it has no raw bytes.
        """
        key = (topic, encoding, fragment_size)
        made = self._frames.get(key)
        if made is None:
            made = self._frames[key] = self._make(topic, encoding, fragment_size)
        return made

    def _make(self, topic: str, encoding: Encoding, fragment_size: int | None) -> bytes:
        if encoding == "json":
            return text_frames(self._as_text(topic), fragment_size)
        if encoding == "png":
            return json_frames({"op": "png", "data": png(self._as_text(topic))}, fragment_size)
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

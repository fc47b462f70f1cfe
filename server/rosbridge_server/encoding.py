"""One outgoing message, encoded at most once in each encoding, however many clients want it.

The encodings are JSON, its text as a picture or in fragments, CBOR, and the bytes that ROS sends between nodes.
"""

from __future__ import annotations

import base64
import math
import struct
import zlib
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal

import cbor2
import numpy as np
import orjson
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from server.judge.message import Json, RosVersion
from server.recording.read.decode import RawMessage, fields_of
from server.recording.read.errors import Undecodable
from server.rosbridge.codec import cbor_bytes, json_bytes
from server.rosbridge_server.shape import (
    FLOATS,
    INTEGERS,
    PLACEHOLDER,
    TIMES,
    Field,
    Lost,
    bytes_of,
    fields,
    items,
    primitive,
    time_of,
)
from server.rosbridge_server.types import RosContext

MOST_FRAGMENTS = 10_000  # of one message: shorter ones than that takes are not sent

Encoding = Literal["json", "cbor", "cbor-raw", "png"]

_TEXT, _BINARY = 0x1, 0x2


def raw_bytes(type: str, definitions: dict[str, Any], version: RosVersion, message: Any) -> bytes:
    """The message of a type that is spelled as rosbags does. Raises Lost."""
    store = _store(version, tuple(sorted(definitions)), type)
    missing = {name: definition for name, definition in definitions.items() if name not in store.fielddefs}
    try:
        if missing:
            store.register(missing)
        made = _instance(store, type, definitions, version, message)
        data = store.serialize_ros1(made, type) if version == 1 else store.serialize_cdr(made, type)
    except Exception as error:  # the typestore has many ways to refuse
        raise Lost(str(error)) from None
    return bytes(data) if version == 1 else bytes(data) + bytes(-len(data) % 4)  # as DDS sends it


@lru_cache(maxsize=32)
def _store(version: RosVersion, names: tuple[str, ...], type: str) -> Typestore:
    return get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)


def _instance(store: Typestore, type: str, definitions: dict[str, Any], version: RosVersion, message: Any) -> Any:
    given: Mapping[str, Any] = message if isinstance(message, Mapping) else {}
    made = {}
    for field in fields(type, definitions):
        made[field.name] = _value(store, field, definitions, version, given.get(field.name))
    if not made and any(name == PLACEHOLDER for name, _ in definitions[type][1]):
        made[PLACEHOLDER] = 0
    return store.types[type](**made)


def _value(store: Typestore, field: Field, definitions: dict[str, Any], version: RosVersion, value: Any) -> Any:
    if not field.array:
        return _item(store, field, definitions, version, value)
    if field.is_bytes:
        return np.frombuffer(bytes_of(field, value), dtype=np.uint8)
    code = FLOATS.get(field.type) or INTEGERS.get(field.type) or ("?" if field.type == "bool" else None)
    if code is not None and isinstance(value, np.ndarray):
        with np.errstate(over="ignore"):
            return np.asarray(value, dtype=code)
    values = items(field, value)
    if code is not None:
        return np.array(values, dtype=code)
    return [_item(store, field.item(), definitions, version, item) for item in values]


def _item(store: Typestore, field: Field, definitions: dict[str, Any], version: RosVersion, value: Any) -> Any:
    if field.type in TIMES:
        return store.types[field.type](**time_of(value, 2))
    if field.is_message:
        return _instance(store, field.type, definitions, version, value)
    return primitive(field, value)


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


def frame(opcode: int, payload: bytes) -> bytes:
    """A whole, final, unmasked WebSocket frame (RFC 6455, 5.2): what a server sends."""
    return _frame_head(opcode, len(payload)) + payload


def _frame_head(opcode: int, size: int) -> bytes:
    if size < 126:
        return bytes((0x80 | opcode, size))
    if size < 65536:
        return bytes((0x80 | opcode, 126)) + size.to_bytes(2, "big")
    return bytes((0x80 | opcode, 127)) + size.to_bytes(8, "big")


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

    __slots__ = ("_bodies", "_bridge", "_frames", "_message", "_stamp", "_unstamped", "type")

    def __init__(self, bridge: RosContext, type: str, message: Json) -> None:
        """`type`: the publisher's, as this version of ROS spells it."""
        self.type = type
        self._bridge = bridge
        self._message = message
        self._stamp: bytes | None = None
        self._unstamped: dict[str, tuple[bytes, bytes]] = {}  # by topic: prepared frames of cbor-raw
        self._bodies: dict[Encoding, bytes] = {}
        self._frames: dict[tuple[str, Encoding, int | None], bytes] = {}

    def frames(self, topic: str, encoding: Encoding, fragment_size: int | None = None) -> bytes:
        """The WebSocket frame for clients that spell the topic this way ("chatter" and "/chatter" may both be in use).

        Text that is longer than `fragment_size` becomes the frames of its fragments, one after another.
        Raises Unencodable, and Lost where a recorded message cannot be decoded, or one without raw bytes is not of
        its type or that is not known.
        """
        key = (topic, encoding, fragment_size)
        made = self._frames.get(key)
        if made is None:
            made = self._frames[key] = self._make(topic, encoding, fragment_size)
        return made

    def prepare(self, topic: str, encoding: Encoding, fragment_size: int | None) -> None:
        """Does what of `frames` can be done before the message is due. Raises as `frames`."""
        if encoding == "cbor-raw":  # the frame has the time of sending
            self._unstamped[topic] = self._without_stamp(topic)
        else:
            self.frames(topic, encoding, fragment_size)

    def _make(self, topic: str, encoding: Encoding, fragment_size: int | None) -> bytes:
        if encoding == "json":
            return text_frames(self._as_text(topic), fragment_size)
        if encoding == "png":
            return json_frames({"op": "png", "data": png(self._as_text(topic))}, fragment_size)
        if encoding == "cbor-raw":
            head, rest = self._unstamped.get(topic) or self._without_stamp(topic)
            return head + self._stamped() + rest
        return frame(_BINARY, _cbor_head(topic) + self._body(encoding))

    def _without_stamp(self, topic: str) -> tuple[bytes, bytes]:
        """The frame of cbor-raw before and after the time of sending."""
        head = _cbor_head(topic) + _RAW_SECS
        rest = _RAW_BYTES + self._body("cbor-raw")
        return _frame_head(_BINARY, len(head) + _STAMP.size + len(rest)) + head, rest

    def _stamped(self) -> bytes:
        """The time of sending, the same for every client: secs and nsecs, whichever the version of ROS."""
        if self._stamp is None:
            now_s = self._bridge.now()
            secs = math.floor(now_s)
            nsecs = min(round((now_s - secs) * 1e9), 999_999_999)
            self._stamp = _STAMP.pack(min(max(secs, 0), 2**32 - 1), _RAW_NSECS, nsecs)
        return self._stamp

    def _as_text(self, topic: str) -> bytes:
        return _json_head(topic) + self._body("json") + b"}"

    def _body(self, encoding: Encoding) -> bytes:
        body = self._bodies.get(encoding)
        if body is None:
            body = self._bodies[encoding] = self._encode(encoding)
        return body

    def _encode(self, encoding: Encoding) -> bytes:
        if encoding == "json":
            return json_bytes(self._fields())
        if encoding == "cbor":
            return cbor_bytes(self._fields())
        return cbor2.dumps(self.raw())

    def raw(self) -> bytes:
        """The message as ROS sends it between nodes: recorded bytes where clients can read them. Raises Lost."""
        types, message = self._bridge.types, self._message
        if isinstance(message, RawMessage) and types.describes(self.type, message.layout):
            return message.raw
        definitions = types.definitions(self.type)
        if definitions is None:
            raise Lost(f"the type {self.type} is not known")
        return raw_bytes(types.long_name(self.type), definitions, self._bridge.ros_version, self._fields())

    def _fields(self) -> Json:
        """The message, decoded. Raises Lost."""
        try:
            return fields_of(self._message)
        except Undecodable as why:
            raise Lost(str(why)) from None


@lru_cache(maxsize=1_000)
def _json_head(topic: str) -> bytes:
    return b'{"op":"publish","topic":' + orjson.dumps(topic) + b',"msg":'


@lru_cache(maxsize=1_000)
def _cbor_head(topic: str) -> bytes:
    """The beginning of a map of three pairs (0xa3), up to the value of `msg`."""
    return b"\xa3" + b"".join(map(cbor2.dumps, ("op", "publish", "topic", topic, "msg")))


# The message of cbor-raw: a map of three pairs. Its times are numbers of 4 bytes, so that its length is known before.
_RAW_SECS = b"\xa3" + cbor2.dumps("secs") + b"\x1a"
_RAW_NSECS = cbor2.dumps("nsecs") + b"\x1a"
_RAW_BYTES = cbor2.dumps("bytes")
_STAMP = struct.Struct(f">I{len(_RAW_NSECS)}sI")

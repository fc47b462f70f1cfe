"""A frame of the bridge as it came: of its topic known, not parsed.

What is only recorded stays so until the recorder's thread has it: parsing it would hold up the event loop. A message
too large to be parsed at all is kept all the same.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import orjson

from server.rosbridge import codec

MAX_TOPIC = 1000  # bytes, as it is written

_JSON = re.compile(
    rb'[ \t\r\n]*+\{[ \t\r\n]*+"op"[ \t\r\n]*+:[ \t\r\n]*+"publish"[ \t\r\n]*+,[ \t\r\n]*+"topic"[ \t\r\n]*+:'
    rb'[ \t\r\n]*+("(?:[^"\\]|\\.)*+")[ \t\r\n]*+,[ \t\r\n]*+"msg"[ \t\r\n]*+:[ \t\r\n]*+'
)
_CBOR_HEAD, _CBOR_MSG = b"\xa3\x62op\x67publish\x65topic", b"\x63msg"

ENDS_BYTES = 2048  # of each end that are kept: names of topics are shorter

_JSON_TOPIC = re.compile(rb'"topic"\s*:\s*("(?:[^"\\]|\\.)*")')
_CBOR_KEY = b"\x65topic"  # a text of five letters


@dataclass(frozen=True, slots=True, kw_only=True)
class RawFrame:
    """A publish of the bridge."""

    topic: str
    payload: bytes
    is_binary: bool
    begins: int  # where the message does

    def message(self) -> Any:
        """The message, parsed. Raises frames.Unreadable, and of that frames.TooManyParts."""
        operation, _ = codec.decode(self.payload, self.is_binary)
        return operation.get("msg")

    def json(self) -> bytes | None:
        """The message's JSON text, not parsed and so not known to be JSON; None: it is not text, or not an object."""
        frame = self.payload.rstrip()
        text = frame[self.begins : -1].rstrip()
        is_object = frame.endswith(b"}") and text.startswith(b"{") and text.endswith(b"}")
        return text if is_object and not self.is_binary else None


def raw_frame(payload: bytes, is_binary: bool) -> RawFrame | None:
    """What a frame publishes, from its head alone; None: the frame must be parsed.

    The head is as every rosbridge writes it: op, topic, msg.
    """
    found = _in_cbor(payload) if is_binary else _in_json(payload)
    return RawFrame(topic=found[0], payload=payload, is_binary=is_binary, begins=found[1]) if found else None


def _in_json(payload: bytes) -> tuple[str, int] | None:
    match = _JSON.match(payload, 0, MAX_TOPIC + 100)
    if match is None:
        return None
    try:
        return str(orjson.loads(match[1])), match.end()  # ujson writes every slash as \\/
    except orjson.JSONDecodeError:
        return None


def _in_cbor(payload: bytes) -> tuple[str, int] | None:
    at = len(_CBOR_HEAD)
    if not payload.startswith(_CBOR_HEAD) or len(payload) < at + 3:
        return None
    first = payload[at]
    if 0x60 <= first < 0x78:
        begins, length = at + 1, first - 0x60
    elif first == 0x78:
        begins, length = at + 2, payload[at + 1]
    elif first == 0x79:
        begins, length = at + 3, int.from_bytes(payload[at + 1 : at + 3], "big")
    else:
        return None
    ends = begins + length
    if length > MAX_TOPIC or payload[ends : ends + len(_CBOR_MSG)] != _CBOR_MSG:
        return None
    try:
        return payload[begins:ends].decode(), ends + len(_CBOR_MSG)
    except UnicodeDecodeError:
        return None


def topic_of(head: bytes, tail: bytes, *, is_binary: bool) -> str | None:
    """Of a message that is too large to be read: which topic it came on, from its first and last bytes.

    The topic of a publish operation; None if neither end has it. A bridge writes it before the message; if it is
    behind, it is the last field of the frame.
    """
    return _of_cbor(head) or _of_cbor(tail, last=True) if is_binary else _of_json(head) or _of_json(tail, last=True)


def _of_json(piece: bytes, *, last: bool = False) -> str | None:
    if not last:
        piece = piece.partition(b'"msg"')[0]  # a message may have a field "topic" of its own
    found = _JSON_TOPIC.findall(piece)
    if not found:
        return None
    try:
        topic = orjson.loads(found[-1])
    except orjson.JSONDecodeError:
        return None
    return topic if isinstance(topic, str) else None


def _of_cbor(piece: bytes, *, last: bool = False) -> str | None:
    at = piece.rfind(_CBOR_KEY) if last else piece.partition(b"\x63msg")[0].find(_CBOR_KEY)
    if at < 0:
        return None
    rest = piece[at + len(_CBOR_KEY) :]
    if not rest or rest[0] >> 5 != 3:  # a text
        return None
    length, begin = rest[0] & 0x1F, 1
    if length in (24, 25):
        width = length - 23
        length, begin = int.from_bytes(rest[1 : 1 + width], "big"), 1 + width
    elif length > 25:
        return None
    raw = rest[begin : begin + length]
    return raw.decode("utf-8", "replace") if len(raw) == length else None

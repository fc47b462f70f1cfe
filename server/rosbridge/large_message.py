"""Of a message that is too large to be read: which topic it came on, from its first and last bytes."""

from __future__ import annotations

import re

import orjson

ENDS_BYTES = 2048  # of each end that are kept: names of topics are shorter

_JSON_TOPIC = re.compile(rb'"topic"\s*:\s*("(?:[^"\\]|\\.)*")')
_CBOR_KEY = b"\x65topic"  # a text of five letters


def topic_of(head: bytes, tail: bytes, *, is_binary: bool) -> str | None:
    """The topic of a publish operation; None if neither end has it. A bridge writes it before the message; if it is
    behind, it is the last field of the frame."""
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

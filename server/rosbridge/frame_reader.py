"""Turns the frames of one connection into what they hold: a message, an answer, a status, or why they hold nothing.

ROS 2's rosbridge, and ROS 1's with a max_message_size, fragments longer messages unasked: text, the fragments of one
message in order, those of several messages in turn, the id 0 for every message of a topic, a fractional `total`. A
fragment is not parsed: its head and tail identify it, and its JSON escapes are those of the whole. They are put
together within bounds.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import orjson

from server.rosbridge import codec
from server.rosbridge.codec import Unreadable
from server.rosbridge.raw_frame import ENDS_BYTES, RawFrame, raw_frame, topic_of
from server.rosbridge.websocket import MAX_MESSAGE_BYTES
from server.system.clean_text import short_text

_HEAD = re.compile(
    rb'[ \t\r\n]*+\{[ \t\r\n]*+"op"[ \t\r\n]*+:[ \t\r\n]*+"fragment"[ \t\r\n]*+,[ \t\r\n]*+"id"[ \t\r\n]*+:[ \t\r\n]*+'
    rb'([^",{}\[\]]{1,40}|"(?:[^"\\]|\\.){0,200}+")[ \t\r\n]*+,[ \t\r\n]*+"data"[ \t\r\n]*+:[ \t\r\n]*+"'
)
_TAIL = re.compile(
    rb'"[ \t\r\n]*+,[ \t\r\n]*+"num"[ \t\r\n]*+:[ \t\r\n]*+(\d{1,9})[ \t\r\n]*+,[ \t\r\n]*+"total"[ \t\r\n]*+:'
    rb"[ \t\r\n]*+(\d{1,9}(?:\.\d{0,30})?)[ \t\r\n]*+\}[ \t\r\n]*+\Z"
)
_TAIL_BYTES = 200
MOST_UNDER_WAY = 64  # messages
_MOST_LARGEST = 4  # so many messages of the largest size fit into the memory for all of them
MOST_DOUBTFUL = 8  # messages of one topic in a row
_MOST_UNENDED = 1_000  # kinds of messages, by id and total, whose last fragments have not come: a few bytes each


_Key = tuple[bytes, bytes]  # id and total, as they are written


@dataclass(frozen=True, slots=True, kw_only=True)
class TooLarge:
    """A message that is not put together."""

    topic: str | None  # None: not in its head
    size: int  # bytes, as it is escaped


@dataclass(slots=True)
class _Assembly:
    """One message whose fragments come."""

    next: int = 0  # the number of the fragment that continues it
    size: int = 0  # bytes of its fragments so far, as they are escaped
    pieces: list[bytes] = field(default_factory=list)
    is_skipped: bool = False  # it is too large
    is_doubtful: bool = False  # one of the same id and total had not ended when it began: fragments may be of either

    @property
    def kept_bytes(self) -> int:
        return 0 if self.is_skipped else self.size


@dataclass(slots=True)
class _Unended:
    """Messages of one id and total whose last fragments have not come."""

    count: int = 0
    doubtful: int = 0  # that began while another was unended, since the first of these
    topic: str | None = None  # of all of them; None: not known, or they differ

    def begin(self, topic: str | None) -> bool:
        """Whether others are unended. A bridge sends the messages of a topic one after another, except for one of a
        subscription that ends: if many in a row are of one topic, the first have ended, and a last fragment was
        lost."""
        if self.count == 0:
            self.topic = topic
        elif topic != self.topic:
            self.topic = None
        elif topic is not None and self.doubtful >= MOST_DOUBTFUL:
            self.count = self.doubtful = 0
        self.count += 1
        if self.count > 1:
            self.doubtful += 1
        return self.count > 1


@dataclass(slots=True)
class Fragments:
    """Assembles fragmented messages of a bridge, within bounds.

    Of one connection. A bridge sends from several threads: the fragments of several messages come in turn, all with the
    id 0. Their `total` tells them apart where it holds the length of the whole. Messages that it does not tell apart
    are refused until as many last fragments have come as first ones: then nothing of them is still to come.
    """

    most_bytes: int
    _under_way: dict[_Key, _Assembly] = field(default_factory=dict)  # that which was continued last is the last
    _unended: dict[_Key, _Unended] = field(default_factory=dict)

    def add(self, payload: bytes) -> bytes | TooLarge | None:
        """The whole message with its last piece, once a TooLarge of one beyond the bound, else None. Raises
        Unreadable."""
        head, tail = _HEAD.match(payload), _TAIL.search(payload, max(0, len(payload) - _TAIL_BYTES))
        if head is None or tail is None or tail.start() < head.end():
            raise Unreadable("a fragment without a valid header")
        data, key, number, total = payload[head.end() : tail.start()], (head[1], tail[2]), int(tail[1]), float(tail[2])
        one = self._under_way.pop(key, None)
        if number == 0:
            one = _Assembly(is_doubtful=self._begin(key, data))
        if number + 1 >= int(total):
            self._end(key)
        if one is None or number != one.next:
            raise Unreadable("a fragment that does not fit the one before")
        found = self._added(one, data, total)
        if one.next < int(total):
            self._under_way[key] = one
            self._bound()
            return found
        if one.is_doubtful:
            raise Unreadable("fragments of two messages that cannot be told apart")
        return found if one.is_skipped else _unescaped(b"".join(one.pieces))

    def _begin(self, key: _Key, data: bytes) -> bool:
        """Counts a first fragment; whether another message of this id and total is unended."""
        is_doubtful = self._unended.setdefault(key, _Unended()).begin(_topic(data))
        if len(self._unended) > _MOST_UNENDED:
            del self._unended[next(iter(self._unended))]
        return is_doubtful

    def _end(self, key: _Key) -> None:
        """Counts a last fragment, of whichever of them."""
        unended = self._unended.get(key)
        if unended is None:
            return
        unended.count -= 1
        if unended.count == 0:
            del self._unended[key]

    def _bound(self) -> None:
        """Gives up the message that was not continued for the longest if there are too many, or too many bytes."""
        kept_bytes = sum(one.kept_bytes for one in self._under_way.values())
        if len(self._under_way) > MOST_UNDER_WAY or kept_bytes > _MOST_LARGEST * self.most_bytes:
            del self._under_way[next(iter(self._under_way))]
            raise Unreadable("fragments of a message that did not end")

    def _added(self, one: _Assembly, data: bytes, total: float) -> TooLarge | None:
        """Takes a fragment; a TooLarge once, where the message is beyond the bound."""
        size = one.size + len(data)
        if one.next == 0:  # of the whole: an uneven total has its length
            size = round((total - 1.0) * len(data)) + 1 if total > int(total) else round(total * len(data))
        one.next += 1
        one.size += len(data)
        if one.is_skipped:
            return None
        if size > self.most_bytes:
            one.is_skipped = True
            topic = _topic(one.pieces[0] if one.pieces else data)
            one.pieces.clear()
            return TooLarge(topic=topic, size=size)
        one.pieces.append(data)
        return None


def is_fragment(payload: bytes, is_binary: bool) -> bool:
    """Whether a frame begins as a fragment does."""
    return not is_binary and _HEAD.match(payload, 0, 400) is not None


def _unescaped(data: bytes) -> bytes:
    try:
        text = orjson.loads(b'"' + data + b'"')
    except orjson.JSONDecodeError:
        raise Unreadable("fragments that are no text") from None
    return bytes(text.encode())


def _topic(data: bytes) -> str | None:
    """From the first piece; it may be cut within an escape."""
    begin = data[:ENDS_BYTES]
    for less in range(6):
        try:
            return topic_of(_unescaped(begin[: len(begin) - less]), b"", is_binary=False)
        except Unreadable:
            continue
    return None


class Publish(NamedTuple):
    topic: str
    message: Any
    note: str | None  # what was corrected to read it


class Answer(NamedTuple):
    operation: dict[str, Any]  # a service_response


class Status(NamedTuple):
    level: str
    text: str


class InvalidFrame(NamedTuple):
    why: str


Received = Publish | Answer | Status | InvalidFrame | TooLarge


class FrameReader:
    """`take_unparsed` gets each publish first, as it came; True: it needs no parsing."""

    def __init__(self, take_unparsed: Callable[[RawFrame], bool]) -> None:
        self._take_unparsed = take_unparsed
        self._fragments = Fragments(MAX_MESSAGE_BYTES)
        self.frame_bytes = 0  # of the newest frame, put together where it came in fragments

    def read(self, payload: bytes, is_binary: bool) -> Received | None:
        """None: nothing is to be done about this frame."""
        self.frame_bytes = len(payload)
        if is_fragment(payload, is_binary):
            return self._read_fragment(payload)
        raw = raw_frame(payload, is_binary)
        if raw is not None and self._take_unparsed(raw):
            return None
        try:
            operation, note = codec.decode(payload, is_binary)
        except codec.Unreadable as error:
            return InvalidFrame(str(error))
        return _received(operation, note)

    def _read_fragment(self, payload: bytes) -> Received | None:
        try:
            whole = self._fragments.add(payload)
        except codec.Unreadable as error:
            return InvalidFrame(str(error))
        if whole is None or isinstance(whole, TooLarge):
            return whole
        return InvalidFrame("fragments that hold a fragment") if is_fragment(whole, False) else self.read(whole, False)


def _received(operation: dict[str, Any], note: str | None) -> Received:
    match operation.get("op"):
        case "publish":
            topic = operation.get("topic")
            if not isinstance(topic, str) or "msg" not in operation:
                return InvalidFrame("a publish without topic or msg")
            return Publish(topic, operation["msg"], note)
        case "service_response":
            return Answer(operation)
        case "status":
            return Status(short_text(operation.get("level"), 20), short_text(operation.get("msg"), 500))
        case "fragment":
            return InvalidFrame("a fragment that cannot be put together")
        case _:
            return InvalidFrame("an operation that rosbridge does not have")

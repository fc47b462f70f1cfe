"""Turns the frames of one connection into what they hold: a message, an answer, a status, or why they hold nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from server.rosbridge import codec
from server.rosbridge.fragments import Fragments, TooLarge, is_fragment
from server.rosbridge.raw_frame import RawFrame, raw_frame
from server.rosbridge.websocket import MAX_MESSAGE_BYTES
from server.system.clean_text import short_text


class Publish(NamedTuple):
    topic: str
    message: Any
    note: str | None  # what was mended to read it


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

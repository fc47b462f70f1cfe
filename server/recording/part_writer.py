"""Writes messages and entries into one part: finds the channel and the schema of each, and counts them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import orjson

from server.recording.mcap.write import PartFile
from server.recording.own import PREFIX, Own, own_schema
from server.recording.read.encode import TypeMismatch
from server.recording.read.schemas import Schema, TypeBook
from server.rosbridge.codec import TooManyParts, Unencodable, json_bytes
from server.rosbridge.raw_frame import RawFrame


class PartWriter:
    """Of one file, which its owner flushes and closes."""

    def __init__(self, file: PartFile, book: TypeBook) -> None:
        self.file = file
        self.messages = 0  # of the car
        self.misfits = 0  # of them, stored as JSON: not matching their type, or of an unknown type
        self._book = book
        # (topic, type) → its channel, its schema, and the channel of those that are not of their type
        self._channels: dict[tuple[str, str | None], tuple[int, Schema, int | None]] = {}
        self._own_channels: dict[Own, int] = {}

    def types_changed(self) -> None:
        """New definitions are known: look up schemas again."""
        self._channels.clear()

    def message(self, topic: str, type: str | None, at_ns: int, message: Any) -> None:
        """A message of the car, or the RawFrame that holds it. Raises Unreadable and OSError."""
        text: bytes | None = None  # of a message that is kept as JSON as it came
        if isinstance(message, RawFrame):
            message, text = _parsed(message)
        channel, schema, loose = self._channels.get((topic, type)) or self._channel(topic, type)
        if schema.encode is not None:
            try:
                if text is not None:
                    raise TypeMismatch("it is too large to be parsed")
                self.file.add(channel, at_ns, schema.encode(message))
            except TypeMismatch:
                if loose is None:
                    loose = self.file.channel(topic, self._book.loose(type))
                    self._channels[topic, type] = (channel, schema, loose)
                self.misfits += 1
                self.file.add(loose, at_ns, text or _json(message))
        else:
            self.misfits += 1
            self.file.add(channel, at_ns, text or _json(message))
        self.messages += 1

    def own(self, channel: Own, at_ns: int, fields: Mapping[str, Any]) -> None:
        """An entry of one of our own channels. Raises OSError."""
        number = self._own_channels.get(channel)
        if number is None:
            number = self._own_channels[channel] = self.file.channel(PREFIX + channel, own_schema(channel))
        self.file.add(number, at_ns, _json(fields))

    def _channel(self, topic: str, type: str | None) -> tuple[int, Schema, int | None]:
        schema = self._book.schema(type) or self._book.loose(type)
        found = self._channels[topic, type] = (self.file.channel(topic, schema), schema, None)
        return found


def _parsed(frame: RawFrame) -> tuple[Any, bytes | None]:
    """The message in a frame, or the text of one that holds too much to be parsed. Raises Unreadable."""
    try:
        return frame.message(), None
    except TooManyParts:
        if (text := frame.json()) is None:
            raise
        return None, text


def _json(message: Any) -> bytes:
    try:
        return json_bytes(message)
    except Unencodable:  # nothing that came through JSON or CBOR is so; its text is kept all the same
        return orjson.dumps({"unencodable": repr(message)[:100_000].encode("utf-8", "replace").decode()})

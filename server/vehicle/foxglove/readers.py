"""The function that reads the messages of a channel into dicts as rosbridge's JSON has them, or why none can.

Making one takes milliseconds, so it is made in a thread; the decoders are those that read recordings.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from server.judge.message import RosVersion
from server.recording.read import source
from server.recording.read.decode import compile_decoder
from server.recording.read.definitions import definitions_of, times
from server.recording.read.encode import TypeMismatch
from server.recording.read.errors import Undecodable
from server.recording.read.schemas import TypeBook, long_type
from server.rosbridge import codec
from server.rosbridge.outgoing import is_type
from server.vehicle.foxglove.protocol import Channel

Read = Callable[[bytes], dict[str, Any]]  # raises Undecodable

_FORMATS: dict[tuple[str, str], tuple[RosVersion, source.DefinitionFormat]] = {
    # (encoding, encoding of the schema); foxglove-sdk and older bridges may leave the second one out
    ("cdr", "ros2msg"): (2, "msg"),
    ("cdr", "ros2idl"): (2, "idl"),
    ("cdr", ""): (2, "msg"),
    ("ros1", "ros1msg"): (1, "msg"),
    ("ros1", ""): (1, "msg"),
}


def why_unreadable(channel: Channel) -> str | None:
    """Why the messages of a channel cannot be read, by what it declares; None: they may be."""
    if channel.encoding == "json":
        if is_type(channel.type):
            return None
        return f"its JSON is {_named(channel.type)}, which is no message of ROS"
    if channel.encoding not in ("cdr", "ros1"):
        return f"messages encoded as {_named(channel.encoding)} are not supported"
    if (channel.encoding, channel.schema_encoding) not in _FORMATS:
        return f"a schema in {_named(channel.schema_encoding)} is not supported"
    return None if is_type(channel.type) else f"{_named(channel.type)} is no message of ROS"


def reader_of(channel: Channel) -> Read:
    """Raises Undecodable where `why_unreadable` has a reason, or the schema cannot be read."""
    why = why_unreadable(channel)
    if why is not None:
        raise Undecodable(why)
    if channel.encoding == "json":
        return _JsonReader(channel)
    version, format = _FORMATS[channel.encoding, channel.schema_encoding]
    type = long_type(channel.type)
    declared = source.Channel(
        number=channel.id,
        topic=channel.topic,
        type=type,
        definition=channel.schema,
        format=format if channel.schema else "none",
        encoding=channel.encoding,
        count=0,
        is_latched=False,
    )
    definitions = {**times(), **definitions_of(declared, version, None)}
    return compile_decoder(type, definitions, version)


class _JsonReader:
    """Reads JSON. A type whose definition is known is compared with each message until the first one fits."""

    def __init__(self, channel: Channel) -> None:
        schema = TypeBook(2 if "/msg/" in channel.type else 1).schema(channel.type)
        self._type = channel.type
        self._encode = None if schema is None else schema.encode

    def __call__(self, payload: bytes) -> dict[str, Any]:
        try:
            message, _ = codec.decode(payload, False)
        except codec.Unreadable as why:
            raise Undecodable(str(why)) from None
        if self._encode is not None:
            try:
                self._encode(message)
            except TypeMismatch:
                raise Undecodable(f"its JSON is not in the shape of {self._type}") from None
            self._encode = None
        return message


def _named(text: str) -> str:
    return repr(text[:60]) if text else "not named"

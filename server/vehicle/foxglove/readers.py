"""The readers of a server's channels: each decodes messages into dicts as in rosbridge's JSON, or gives a reason.

Making one takes milliseconds, so they are made in a thread, one after the other, and kept over all openings; the
decoders are those that read recordings.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable
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

log = logging.getLogger("catgraph.link")

MOST_READERS = 2000


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


class ReaderTable:
    """The readers of a server's channels, made one after the other in a thread, and kept over all openings.

    `ready(topic)` follows each reader that was made, `note(text)` has the reason where there is none.
    """

    def __init__(
        self, ready: Callable[[str], None], note: Callable[[str], None], *, used: Callable[[], Iterable[Channel]]
    ) -> None:
        """`used`: the channels whose messages are read now."""
        self._ready = ready
        self._note = note
        self._used = used
        self._readers: dict[tuple[str, ...], Read | None] = {}  # None: there is none
        self._waiting: dict[tuple[str, ...], Channel] = {}
        self._task: asyncio.Task[None] | None = None

    def is_ready(self, channel: Channel) -> bool:
        """Whether messages of a channel can be read; if that is not known, it will be."""
        key = _key(channel)
        if key in self._readers:
            return self._readers[key] is not None
        self._waiting.setdefault(key, channel)
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._make(), name="foxglove readers")
        return False

    def read(self, channel: Channel, payload: bytes) -> dict[str, Any]:
        """Raises Undecodable."""
        reader = self._readers.get(_key(channel))
        if reader is None:
            raise Undecodable("its schema is not known")
        return reader(payload)

    def end(self) -> None:
        """Nothing is read any more."""
        if self._task is not None:
            self._task.cancel()

    async def _make(self) -> None:
        try:
            while self._waiting:
                key, channel = next(iter(self._waiting.items()))
                made = await asyncio.to_thread(_made, channel)
                del self._waiting[key]
                if len(self._readers) >= MOST_READERS:
                    used = {_key(one) for one in self._used()}
                    self._readers = {key: one for key, one in self._readers.items() if key in used}
                self._readers[key] = None if isinstance(made, str) else made
                if isinstance(made, str):
                    self._note(f"{channel.topic} cannot be read: {made}.")
                else:
                    self._ready(channel.topic)
        finally:
            self._task = None


def _made(channel: Channel) -> Read | str:
    try:
        return reader_of(channel)
    except Undecodable as why:
        return str(why)
    except Exception:  # of the schema nothing is known: a fault costs this topic and no other
        log.exception("reader not made: topic=%s type=%s", channel.topic, channel.type)
        return f"the definition of {channel.type} cannot be understood"


def _key(channel: Channel) -> tuple[str, ...]:
    """Each topic has its own: what cannot be read is named by its topic, and JSON is compared topic by topic."""
    return (channel.topic, channel.encoding, channel.type, channel.schema_encoding, channel.schema)

"""The readers of a server's channels, made one after the other in a thread, and kept over all openings."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable
from typing import Any

from server.recording.read.errors import Undecodable
from server.vehicle.foxglove.protocol import Channel
from server.vehicle.foxglove.readers import Read, reader_of

log = logging.getLogger("catgraph.link")

MOST_READERS = 2000


class ReaderTable:
    """`ready(topic)` follows each reader that was made, `note(text)` has the reason where there is none."""

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

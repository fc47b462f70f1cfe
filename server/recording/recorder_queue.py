"""What the loop passes to the recorder's thread: bounded, never waiting, and what does not fit is counted."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.judge.message import RosVersion
from server.recording.folder import id_of
from server.recording.own import Own

MAX_QUEUED = 20_000  # messages: a minute of a talkative car
MAX_QUEUED_BYTES = 64 * 1024 * 1024  # of their frames; in memory they take some five times as much
KEPT_FOR_OWN = 5_000  # places behind the car's: a disk that hangs must not cost the alarms of that time


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One file to write: its name and metadata."""

    path: Path
    version: RosVersion
    metadata: Mapping[str, str]

    @property
    def id(self) -> str:
        return id_of(self.path)


@dataclass(slots=True)
class CarMessage:
    """A message of the car, or the RawFrame that holds it."""

    topic: str
    type: str | None
    at_ns: int
    message: Any
    size: int  # bytes of the frame it came in
    now_s: float  # by the clock that `RecorderQueue.take` is given


@dataclass(slots=True)
class OwnEntry:
    """An entry of one of our own channels."""

    channel: Own
    at_ns: int
    fields: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """A file that becomes an attachment of the part; read when it is written."""

    path: Path
    name: str
    media_type: str
    at_ns: int  # the moment it belongs to


@dataclass(slots=True)
class Prepare:
    """Get the types ready."""


@dataclass(slots=True)
class Begin:
    """What follows belongs to this part."""

    part: Part


@dataclass(slots=True)
class Learn:
    """Definitions of types, in .msg text."""

    definitions: Mapping[str, str]


@dataclass(slots=True)
class Note:
    """What is known of the part so far, for its metadata."""

    more: Mapping[str, str]


@dataclass(slots=True)
class End:
    """The part is complete; `then` is called on the loop when the disk has it all, or has refused."""

    ended: Mapping[str, str]
    then: Callable[[], None] | None


@dataclass(slots=True)
class Stop:
    """The thread ends; `then` is called on the loop afterwards."""

    then: Callable[[], None]


Item = CarMessage | OwnEntry | Attachment | Prepare | Begin | Learn | Note | End | Stop


class RecorderQueue:
    """Filled by the loop, emptied by the recorder's thread."""

    def __init__(self) -> None:
        self.dropped = 0
        self.dropped_at_s: float | None = None  # by the clock that `take` is given
        self.wake = threading.Event()  # something came that does not wait for the next portion
        self._items: deque[Item] = deque()
        self._put_bytes = 0
        self._taken_bytes = 0

    def __len__(self) -> int:
        return len(self._items)

    # -- of the loop -------------------------------------------------------------------------------------------------

    def behind_s(self, now_s: float) -> float:
        """How long the oldest message of the car waits already."""
        try:
            item = self._items[0]
        except IndexError:  # the thread has just taken it
            return 0.0
        return max(0.0, now_s - item.now_s) if isinstance(item, CarMessage) else 0.0

    def take(self, message: CarMessage) -> None:
        """Takes a message of the car, or drops it where there is no room."""
        if len(self._items) >= MAX_QUEUED or self._put_bytes - self._taken_bytes > MAX_QUEUED_BYTES:
            self.drop(message.now_s)
            return
        self._put_bytes += message.size
        self._items.append(message)

    def own(self, entry: OwnEntry) -> None:
        """Takes something of ours: there is little of it, and room is kept for it."""
        if len(self._items) >= MAX_QUEUED + KEPT_FOR_OWN:
            self.dropped += 1
            return
        self._items.append(entry)

    def put(self, item: Attachment | Prepare | Begin | Learn | Note | End | Stop) -> None:
        """Takes an order to the thread, and wakes it."""
        self._items.append(item)
        self.wake.set()

    def forget_dropped(self) -> None:
        """Reset the counters."""
        self.dropped, self.dropped_at_s = 0, None

    # -- of the thread -----------------------------------------------------------------------------------------------

    def next(self) -> Item | None:
        """The oldest item; None: there is none."""
        if not self._items:
            return None
        item = self._items.popleft()
        if isinstance(item, CarMessage):
            self._taken_bytes += item.size
        return item

    def drop(self, now_s: float) -> None:
        """A message was lost."""
        self.dropped, self.dropped_at_s = self.dropped + 1, now_s

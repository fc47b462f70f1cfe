"""Writes the messages of one monitored vehicle, on its own thread, behind a queue that never blocks.

The loop never waits for a disk. Messages beyond the queue's bound are dropped and counted. A second thread syncs the
disk, because that can take seconds and must not delay writing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from server.recording.folder import RecordingsFolder
from server.recording.own import Own
from server.recording.recorder_queue import (
    Attachment,
    Begin,
    CarMessage,
    End,
    Learn,
    Note,
    OwnEntry,
    Part,
    Prepare,
    RecorderQueue,
    Stop,
)
from server.recording.recorder_thread import RecorderThread, Status
from server.recording.space import Allowance


class Recorder:
    """One vehicle's. All methods are called on one thread, that of the loop, and return at once.

    `call(function, *arguments)` runs something on that thread soon; `on_finished(path)` is called so for each part that
    is closed or recovered, after it has its name and the disk has it.
    """

    def __init__(
        self,
        folder: RecordingsFolder,
        *,
        call: Callable[..., Any],
        on_finished: Callable[[Path], None],
        allowance: Allowance,
        on_unreadable: Callable[[str, str], None] = lambda *_: None,
    ) -> None:
        self._queue = RecorderQueue()
        self._thread = RecorderThread(
            folder,
            self._queue,
            call=call,
            on_finished=on_finished,
            on_unreadable=on_unreadable,
            allowance=allowance,
        )
        self._is_started = False

    @property
    def status(self) -> Status:
        """The newest status of the thread."""
        return self._thread.status

    @property
    def is_ready(self) -> bool:
        """Whether the types are."""
        return self._thread.is_ready

    @property
    def allowance(self) -> Allowance:
        """What recordings may take of the disk."""
        return self._thread.allowance

    @allowance.setter
    def allowance(self, allowance: Allowance) -> None:
        self._thread.allowance = allowance

    @property
    def queued(self) -> int:
        return len(self._queue)

    @property
    def dropped(self) -> int:
        """What was lost since `forget_dropped`."""
        return self._queue.dropped

    @property
    def dropped_at_s(self) -> float | None:
        """When a message was lost last, by the clock that `take` is given."""
        return self._queue.dropped_at_s

    def forget_dropped(self) -> None:
        """A session begins: what was lost before is not counted in it."""
        self._queue.forget_dropped()

    def behind_s(self, now_s: float) -> float:
        """How long the oldest message of the car waits already."""
        return self._queue.behind_s(now_s)

    def prepare(self) -> None:
        """Gets the types ready: what comes before they are waits, and would be lost by a kill."""
        self._start()
        self._queue.put(Prepare())

    def begin(self, part: Part) -> None:
        """From here on what is taken belongs to this part."""
        self._start()
        self._queue.put(Begin(part))

    def learn(self, definitions: Mapping[str, str]) -> None:
        """Definitions of types as the bridge has them, in .msg text."""
        self._queue.put(Learn(dict(definitions)))

    def take(self, topic: str, type: str | None, message: Any, at_ns: int, size: int, now_s: float) -> None:
        """A message of the car, or the RawFrame that holds it; it must not be changed afterwards. `size`: bytes of the
        frame it came in."""
        self._queue.take(CarMessage(topic, type, at_ns, message, size, now_s))

    def own(self, channel: Own, fields: Mapping[str, Any], at_ns: int) -> None:
        """Something of ours: there is little of it, and room is kept for it."""
        self._queue.own(OwnEntry(channel, at_ns, {"time_ms": at_ns // 1_000_000, **fields}))

    def attach(self, attachment: Attachment) -> None:
        """A file becomes an attachment of the part."""
        self._queue.put(attachment)

    def note(self, **more: str) -> None:
        """Write the current metadata of the part, so that it survives a kill."""
        self._queue.put(Note(more))

    def end(self, *, then: Callable[[], None] | None = None, **ended: str) -> None:
        """The part is complete with what was taken so far; `then` is called on the loop when the disk has it all, or
        has refused."""
        self._queue.put(End(ended, then))

    def stop(self, *, then: Callable[[], None]) -> None:
        """Ends the part and the thread; `then` is called on the loop afterwards."""
        if not self._is_started:
            then()
            return
        self._queue.put(End({"ended": "closed", "why": "The server was stopped."}, None))
        self._queue.put(Stop(then))

    def _start(self) -> None:
        if not self._is_started:
            self._is_started = True
            self._thread.start()

"""The bus of one process: frames in memory, events in the journal of this machine."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from server.bus.bus import FRAME_LIVES_S, Frame, Handler, NotServed, Watcher
from server.bus.journal import SLOW_DISK_S, Journal
from server.bus.log_runs import Resumed
from server.bus.watchers import Watchers
from server.storage.storage_thread import StorageThread


class LocalBus:
    """Both sides of the bus in one process. `now` is a monotonic clock in seconds.

    Pages get an event, and a command is answered, once the journal has it on the disk, so that it survives a loss of
    power. What the disk refuses is shown at once, and what it has not after `SLOW_DISK_S` then: while the journal
    reports the trouble, no alarm waits for a disk.
    """

    def __init__(self, journal: Journal, *, now: Callable[[], float], storage: StorageThread | None = None) -> None:
        """`storage`: the thread that writes the journal; None: it is written at once by the caller."""
        self._journal = journal
        self._now = now
        self._storage = storage
        self._held: dict[str, int] = {}  # number of each vehicle's first event that no page gets yet
        self._changed = asyncio.Event()  # something was released
        self._frames: dict[tuple[str, str], Frame] = {}
        self._handlers: dict[str, Handler] = {}
        self._watchers = Watchers()
        self._wanted: dict[tuple[str, str], int] = {}

    def put(self, vehicle: str, kind: str, payload: str | bytes, *, made_s: float | None = None) -> None:
        previous = self._frames.get((vehicle, kind))
        number = previous.number + 1 if previous else 1
        put_s = self._now() if made_s is None else made_s
        self._frames[vehicle, kind] = Frame(number=number, payload=payload, put_s=put_s)
        self._watchers.wake(vehicle, kind)

    def newest(self, vehicle: str, kind: str) -> Frame | None:
        frame = self._frames.get((vehicle, kind))
        return frame if frame is not None and self._now() - frame.put_s <= FRAME_LIVES_S else None

    def append(self, vehicle: str, events: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Numbers events and returns them with their numbers; wakes the watchers once pages may have them."""
        if not events:
            return []
        if self._storage is None:
            numbered = self._journal.append(vehicle, events)
            self._watchers.wake(vehicle, "events")
            return numbered
        loop = asyncio.get_running_loop()
        self._journal.on_saved = lambda: _call_soon(loop, self._release_saved)
        numbered = self._journal.append(vehicle, events)
        self._held.setdefault(vehicle, numbered[0]["n"])
        wait_s = 0.0 if self._journal.trouble else SLOW_DISK_S
        loop.call_later(wait_s, self._release, vehicle, numbered[-1]["n"])
        return numbered

    def _release_saved(self) -> None:
        is_refused = self._journal.why_refused is not None
        for vehicle in tuple(self._held):
            self._release(vehicle, self._journal.last(vehicle) if is_refused else self._journal.saved(vehicle))

    def _release(self, vehicle: str, n: int) -> None:
        """From now on pages get the events up to number `n`."""
        held = self._held.get(vehicle)
        if held is None or n < held:
            return
        if n >= self._journal.last(vehicle):
            del self._held[vehicle]
        else:
            self._held[vehicle] = n + 1
        self._changed.set()
        self._changed = asyncio.Event()
        self._watchers.wake(vehicle, "events")

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]] | None:
        """The events after number `n` that pages may have, from memory; None where the disk must be read."""
        events = self._journal.recent_after(vehicle, n, limit)
        return None if events is None else self._released(vehicle, events)

    async def events_after(
        self, vehicle: str, n: int, limit: int = 100, *, is_whole: bool = False
    ) -> list[dict[str, Any]]:
        """The events after number `n` that pages may have, in order, at most `limit`.

        `is_whole`: raises NotServed where the disk cannot be read; else there is only what waits for it.
        """
        recent = self.recent_events(vehicle, n, limit)
        if recent is not None:
            return recent
        try:
            found = await self._read(lambda: self._journal.stored_after(vehicle, n, limit, is_whole=is_whole))
        except OSError as why:
            raise NotServed(f"the alarm log of {vehicle} cannot be read: {why}") from None
        return self._released(vehicle, found)

    async def find_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        """As `Journal.find`: all there are, whether or not the disk has them yet."""
        return await self._read(lambda: self._journal.find(vehicle, **filters))

    async def _read(self, read: Callable[[], list[dict[str, Any]]]) -> list[dict[str, Any]]:
        return read() if self._storage is None else await self._storage.run(read)

    def _released(self, vehicle: str, events: list[dict[str, Any]]) -> list[dict[str, Any]]:
        held = self._held.get(vehicle)
        return events if held is None else [event for event in events if event["n"] < held]

    def last_event(self, vehicle: str) -> int:
        """The number of the newest event that pages may have."""
        held = self._held.get(vehicle)
        return self._journal.last(vehicle) if held is None else held - 1

    def past_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        """As `Journal.find`; for the start of a session, as it waits for the disk."""
        return self._journal.find(vehicle, **filters)

    def logged_alarms(self, vehicle: str) -> list[str]:
        """The ids of all alarms that any event was ever of; for the start of a session, as it waits for the disk."""
        return self._journal.alarms(vehicle)

    def save_events(self) -> str | None:
        """Tries again to keep what the disk refused; why events are not kept, as a sentence, or None."""
        self._journal.save_soon()
        return self._journal.trouble

    @property
    def unwritten_events(self) -> int:
        """How many events are in memory only."""
        return sum(self._journal.last(one) - self._journal.saved(one) for one in self._handlers)

    @property
    def log_complaint(self) -> str | None:
        """What was wrong with the log when the server started, and was put right."""
        return self._journal.complaint

    def serve(self, vehicle: str, handler: Handler) -> None:
        """Register `handler` for requests to the vehicle."""
        self._handlers[vehicle] = handler

    @property
    def vehicles(self) -> tuple[str, ...]:
        return tuple(self._handlers)

    @property
    def grows(self) -> bool:
        return False

    def trouble(self, vehicle: str) -> str | None:
        return None

    def knows(self, vehicle: str) -> bool:
        return True

    def run(self, vehicle: str) -> str:
        return self._journal.runs.present.id

    async def resume(self, vehicle: str, run: str, n: int) -> Resumed:
        """Where a reader continues who has read up to `n` in `run`."""
        return self._journal.runs.resume(vehicle, run, n, self.last_event(vehicle))

    async def request(
        self, vehicle: str, command: Mapping[str, Any], *, deadline_s: float = 3.0, comes_within_s: float | None = None
    ) -> Mapping[str, Any]:
        """The answer to a command, once the events that it caused may be shown; here nothing is under way. Raises
        NotServed."""
        handler = self._handlers.get(vehicle)
        if handler is None:
            raise NotServed(f"no vehicle is named {vehicle}")
        before = self._journal.last(vehicle)
        try:
            async with asyncio.timeout(deadline_s):
                answer = await handler(command)
        except TimeoutError:
            raise NotServed(f"{vehicle} did not answer within {deadline_s:g} s", outcome="unknown") from None
        last = self._journal.last(vehicle)
        while last > before and self._held.get(vehicle, last + 1) <= last:  # `SLOW_DISK_S` at most
            await self._changed.wait()
        return answer

    def watch(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        """Calls `watcher(kind)` whenever something new is there; answers how to end that."""
        return self._watchers.view(vehicle, watcher)

    def watch_events(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        """Calls `watcher(name)` whenever pages may have new events; the caller is no viewer."""
        return self._watchers.follow(vehicle, watcher)

    def watched(self, vehicle: str) -> int:
        """The number of viewers of the vehicle."""
        return self._watchers.viewers(vehicle)

    def want(self, vehicle: str, kind: str, change: int) -> None:
        """Add (+1) or remove (−1) a viewer of a frame kind that is built only while it is viewed."""
        self._wanted[vehicle, kind] = self._wanted.get((vehicle, kind), 0) + change

    def wanted(self, vehicle: str, kind: str) -> bool:
        return self._wanted.get((vehicle, kind), 0) > 0


def _call_soon(loop: asyncio.AbstractEventLoop, callback: Callable[[], None]) -> None:
    """From another thread; a loop that was closed meanwhile needs nothing any more."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(callback)

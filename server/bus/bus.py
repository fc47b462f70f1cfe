"""The only thing between a session and the pages: newest frames by key, numbered events, requests with a deadline.

A session puts and serves, a page's handler reads and asks; neither knows the other. `LocalBus` is the one in this
process; a
broker can take its place.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from server.bus.journal import Journal

Handler = Callable[[Mapping[str, Any]], Awaitable[dict[str, Any]]]
Watcher = Callable[[str], None]
FRAME_LIVES_S = 2.0  # an older frame is nobody's newest: the session behind it has stopped


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Bytes ready to send, made once for all pages."""

    number: int
    payload: str | bytes
    put_s: float


class NotServed(LookupError):
    """Nobody answers for that vehicle, or not in time."""


class LocalBus:
    """One process's bus. `now` is a monotonic clock in seconds."""

    def __init__(self, journal: Journal, *, now: Callable[[], float]) -> None:
        self._journal = journal
        self._now = now
        self._frames: dict[tuple[str, str], Frame] = {}
        self._handlers: dict[str, Handler] = {}
        self._watchers: dict[str, dict[int, Watcher]] = {}
        self._next_watcher = 0
        self._wanted: dict[tuple[str, str], int] = {}

    def put(self, vehicle: str, kind: str, payload: str | bytes) -> None:
        """Replaces the newest frame of a kind and wakes those who watch the vehicle."""
        previous = self._frames.get((vehicle, kind))
        number = previous.number + 1 if previous else 1
        self._frames[vehicle, kind] = Frame(number=number, payload=payload, put_s=self._now())
        self._wake(vehicle, kind)

    def newest(self, vehicle: str, kind: str) -> Frame | None:
        frame = self._frames.get((vehicle, kind))
        return frame if frame is not None and self._now() - frame.put_s <= FRAME_LIVES_S else None

    def append(self, vehicle: str, events: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Numbers and keeps events, then wakes those who watch; answers them with their numbers."""
        if not events:
            return []
        numbered = self._journal.append(vehicle, events)
        self._wake(vehicle, "events")
        return numbered

    def events_after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        return self._journal.after(vehicle, n, limit)

    def find_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        """As `Journal.find`."""
        return self._journal.find(vehicle, **filters)

    def last_event(self, vehicle: str) -> int:
        return self._journal.last(vehicle)

    def alarms_told(self, vehicle: str) -> list[str]:
        """The ids of all alarms that any event was ever of."""
        return self._journal.alarms(vehicle)

    def save_events(self) -> str | None:
        """Tries again to keep what the disk refused; why events are not kept, as a sentence, or None."""
        self._journal.save()
        return self._journal.trouble

    @property
    def log_complaint(self) -> str | None:
        """What was wrong with the log when the server started, and was put right."""
        return self._journal.complaint

    def serve(self, vehicle: str, handler: Handler) -> None:
        """From now on `handler` answers what is asked of the vehicle."""
        self._handlers[vehicle] = handler

    @property
    def vehicles(self) -> tuple[str, ...]:
        return tuple(self._handlers)

    async def request(self, vehicle: str, command: Mapping[str, Any], *, deadline_s: float = 3.0) -> dict[str, Any]:
        """The answer to a command. Raises NotServed."""
        handler = self._handlers.get(vehicle)
        if handler is None:
            raise NotServed(f"no vehicle is named {vehicle}")
        try:
            async with asyncio.timeout(deadline_s):
                return await handler(command)
        except TimeoutError:
            raise NotServed(f"{vehicle} did not answer within {deadline_s:g} s") from None

    def watch(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        """Calls `watcher(kind)` whenever something new is there; answers how to end that."""
        self._next_watcher += 1
        key = self._next_watcher
        self._watchers.setdefault(vehicle, {})[key] = watcher
        return lambda: self._watchers[vehicle].pop(key, None) and None

    def watched(self, vehicle: str) -> int:
        """How many look at the vehicle."""
        return len(self._watchers.get(vehicle, ()))

    def want(self, vehicle: str, kind: str, change: int) -> None:
        """One looker more (+1) or fewer (−1) for a kind of frame that is only made while somebody looks."""
        self._wanted[vehicle, kind] = self._wanted.get((vehicle, kind), 0) + change

    def wanted(self, vehicle: str, kind: str) -> bool:
        return self._wanted.get((vehicle, kind), 0) > 0

    def _wake(self, vehicle: str, kind: str) -> None:
        for watcher in tuple(self._watchers.get(vehicle, {}).values()):
            watcher(kind)

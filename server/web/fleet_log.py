"""What happened to the items of all cars lately, while a page of all cars is open."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from typing import Any

from server.bus.bus import ALL, NotServed, PageBus
from server.protocol.messages import FleetEvent

CHANGE = "attention"
SHOWN = 20  # the newest, to a page that opens
KEPT = 200
READ_WITHIN_S = 2.0  # the logs of all cars, when the first page opens
TEXT_LETTERS = 300
PORTION = 100


class FleetLog:
    """Shared by all pages of all cars. It reads the past of each car once, then follows its events."""

    def __init__(self, bus: PageBus) -> None:
        self._bus = bus
        self._watchers: dict[int, Callable[[], None]] = {}
        self._next = 0
        self._unwatch: Callable[[], None] | None = None
        self._events: deque[FleetEvent] = deque(maxlen=KEPT)
        self._count = 0  # of all that there were: the number of the newest
        self._read: dict[str, int] = {}  # of each car, the number of the newest event that was looked at, of its run
        self._runs: dict[str, str] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._following: set[str] = set()
        self._is_ready = False

    def watch(self, on_new: Callable[[], None]) -> Callable[[], None]:
        """Calls `on_new()` when there are events; answers how to end that."""
        self._next += 1
        key = self._next
        self._watchers[key] = on_new
        if self._unwatch is None:
            self._unwatch = self._bus.watch_events(ALL, self._on_events)
            self._spawn(self._settle([self._start(vehicle) for vehicle in self._bus.vehicles]))

        def leave() -> None:
            self._watchers.pop(key, None)
            if not self._watchers:
                self._end()

        return leave

    @property
    def begins_after(self) -> int:
        """After which number a page that opens begins; the newest events follow."""
        return max(0, self._count - SHOWN)

    def after(self, number: int) -> tuple[int, list[FleetEvent]]:
        """The events after a number, and the number of the newest. None before the past has been read."""
        if not self._is_ready:
            return number, []
        new = min(self._count - number, len(self._events))
        return self._count, list(self._events)[len(self._events) - new :] if new > 0 else []

    def _end(self) -> None:
        """Nobody watches: the next page reads the past again."""
        if self._unwatch is not None:
            self._unwatch()
            self._unwatch = None
        for task in self._tasks:
            task.cancel()
        self._events.clear()
        self._read.clear()
        self._runs.clear()
        self._following.clear()
        self._count, self._is_ready = 0, False

    def _spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work, name="fleet log")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _settle(self, readings: list[asyncio.Task[None]]) -> None:
        """The past of all cars in the order of time; a car whose agent does not answer is not waited for."""
        if readings:
            await asyncio.wait(readings, timeout=READ_WITHIN_S)
        self._is_ready = True
        found = sorted(self._events, key=lambda event: event["time_ms"])
        self._events.clear()
        self._events.extend(found)
        self._notify()

    def _start(self, vehicle: str) -> asyncio.Task[None]:
        """Read the past of a car; what follows is new."""
        self._runs[vehicle] = self._bus.run(vehicle)
        self._read[vehicle] = last = self._bus.last_event(vehicle)
        return self._spawn(self._past_of(vehicle, last))

    async def _past_of(self, vehicle: str, last: int) -> None:
        try:
            found = await self._bus.find_events(vehicle, change=CHANGE, limit=SHOWN)
        except NotServed:
            return
        self._add(vehicle, [event for event in reversed(found) if _number(event) <= last])

    def _on_events(self, vehicle: str) -> None:
        """A car has new events, or sent something for the first time."""
        if vehicle not in self._read:
            self._start(vehicle)
        elif vehicle not in self._following:
            self._following.add(vehicle)
            self._spawn(self._follow(vehicle))

    async def _follow(self, vehicle: str) -> None:
        try:
            if (run := self._bus.run(vehicle)) != self._runs[vehicle]:
                resumed = await self._bus.resume(vehicle, self._runs[vehicle], self._read[vehicle])
                self._runs[vehicle], self._read[vehicle] = run, resumed.new_after
            while events := await self._bus.events_after(vehicle, self._read[vehicle], PORTION):
                self._read[vehicle] = _number(events[-1])
                self._add(vehicle, events)
        except NotServed:
            pass  # with its next event
        finally:
            self._following.discard(vehicle)

    def _add(self, vehicle: str, events: list[dict[str, Any]]) -> None:
        found = [one for event in events if (one := _fleet_event(vehicle, event)) is not None]
        self._events.extend(found)
        self._count += len(found)
        if found and self._is_ready:
            self._notify()

    def _notify(self) -> None:
        for on_new in tuple(self._watchers.values()):
            on_new()


def _number(event: Mapping[str, Any]) -> int:
    n = event.get("n")
    return n if type(n) is int else 0


def _fleet_event(vehicle: str, event: Mapping[str, Any]) -> FleetEvent | None:
    """None: it is of something else, or an agent sent what is none."""
    at_ms, text, by = event.get("at_ms"), event.get("text"), event.get("by")
    if event.get("change") != CHANGE or type(at_ms) is not int or not isinstance(text, str):
        return None
    return {
        "kind": "fleet_event",
        "vehicle": vehicle,
        "n": _number(event),
        "time_ms": at_ms,
        "text": text[:TEXT_LETTERS],
        "by": by[:TEXT_LETTERS] if isinstance(by, str) else None,
    }

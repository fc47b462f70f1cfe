"""All cars of the server as one frame, made once for all pages."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import orjson

from server.bus.bus import ALL, PageBus
from server.protocol.cars_state import Cars, ListedCar

FRAME = "cars"
EVERY_S = 0.5
URGENT_S = 0.002  # several changes make one frame
COLLECT_S = 0.08  # the sessions put theirs at the same moment, within a tick of 0.05 s


class CarsBoard:
    """Joins what the sessions put. `now` is a monotonic clock in seconds, `wall_ms` the time of day.

    It does nothing while no page watches, or where there is one car.
    """

    def __init__(self, bus: PageBus, *, now: Callable[[], float], wall_ms: Callable[[], int]) -> None:
        self._bus = bus
        self._now = now
        self._wall_ms = wall_ms
        self._pages = 0
        self._unwatch: Callable[[], None] | None = None
        self._alarms: dict[str, object] = {}  # of each car, as last sent
        self._seen_s: dict[str, float] = {}  # when each car's newest summary was put
        self._next: asyncio.TimerHandle | None = None
        self._due_s = 0.0

    def watch(self, on_new: Callable[[str], None]) -> Callable[[], None]:
        """Calls `on_new("cars")` with each new frame; answers how to end that."""
        if len(self._bus.vehicles) < 2:
            return lambda: None
        self._pages += 1
        if self._unwatch is None:
            self._unwatch = self._bus.watch(ALL, self._on_new)
        unwatch = self._bus.watch(ALL, lambda kind: on_new(kind) if kind == FRAME else None)

        def leave() -> None:
            unwatch()
            self._pages -= 1
            if self._pages == 0 and self._unwatch is not None:
                self._unwatch()
                self._unwatch = None

        return leave

    def _on_new(self, kind: str) -> None:
        """A session put its summary. Sent soon where its alarms changed, else twice a second."""
        frame = None if kind == FRAME else self._bus.newest(ALL, kind)
        if frame is None:
            return
        self._seen_s[kind] = frame.put_s
        alarms = _alarms_of(orjson.loads(frame.payload))
        is_urgent = self._alarms.get(kind) != alarms
        self._alarms[kind] = alarms
        now_s = self._now()
        due_s = now_s + URGENT_S if is_urgent else max(now_s + COLLECT_S, self._due_s)
        if self._next is not None:
            if not is_urgent:
                return
            self._next.cancel()
        self._next = asyncio.get_running_loop().call_later(due_s - now_s, self._put)

    def _put(self) -> None:
        self._next = None
        self._due_s = self._now() + EVERY_S - COLLECT_S
        frame: Cars = {"kind": "cars", "time_ms": self._wall_ms(), "cars": [self._car(n) for n in self._bus.vehicles]}
        self._bus.put(ALL, FRAME, orjson.dumps(frame).decode())

    def _car(self, name: str) -> ListedCar:
        """`newest` answers nothing that is older than 2 s: what a stopped session stated is not shown as if it held."""
        frame, seen_s = self._bus.newest(ALL, name), self._seen_s.get(name)
        return {
            "name": name,
            "age_s": None if seen_s is None else round(max(0.0, self._now() - seen_s), 2),
            "summary": None if frame is None else orjson.loads(frame.payload),
        }


def _alarms_of(summary: dict[str, Any]) -> object:
    worst = summary["worst"]
    key = worst and (worst["id"], worst["occurrence"], worst["state"], worst["active"])
    return key, summary["waiting"], summary["phase"]

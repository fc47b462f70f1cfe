"""All cars of the server as one frame, made once for all pages."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import orjson

from server.bus.bus import ALL, SUMMARY, PageBus
from server.protocol.cars_state import OffOnPurpose

FRAME = "cars"
FLEET = "fleet of cars"  # the same for pages of all cars, also where there is one car; no vehicle can be called so
EVERY_S = 0.5
LEAST_S = 0.05  # between two frames, however much changes
URGENT_S = 0.002  # several changes make one frame
COLLECT_S = 0.08  # the sessions put theirs at the same moment, within a tick of 0.05 s
SILENT_S = 0.7  # a page of all cars gets a frame after so long though no session put anything


class CarsBoard:
    """Joins what the sessions put. `now` is a monotonic clock in seconds, `wall_ms` the time of day.

    It does nothing while no page watches; where there is one car, only for pages of all cars.
    """

    def __init__(
        self,
        bus: PageBus,
        *,
        off: Callable[[str], OffOnPurpose | None] = lambda _: None,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
    ) -> None:
        """`off`: who declared a car off on purpose, and when."""
        self._bus = bus
        self._off = off
        self._now = now
        self._wall_ms = wall_ms
        self._pages: dict[str, dict[int, Callable[[str], None]]] = {FRAME: {}, FLEET: {}}  # who is called, by frame
        self._next_page = 0
        self._unwatch: Callable[[], None] | None = None
        self._alarms: dict[str, object] = {}  # of each car, as last sent
        self._seen_s: dict[str, float] = {}  # when each car's newest summary was put
        self._next: asyncio.TimerHandle | None = None
        self._next_s = 0.0  # when it is due
        self._silence: asyncio.TimerHandle | None = None  # puts a frame where no session puts anything
        self._put_s = -EVERY_S

    def watch(self, on_new: Callable[[str], None]) -> Callable[[], None]:
        """Calls `on_new("cars")` with each new frame; answers how to end that."""
        if len(self._bus.vehicles) < 2 and not self._bus.grows:
            return lambda: None
        return self._join(FRAME, on_new)

    def watch_fleet(self, on_new: Callable[[str], None]) -> Callable[[], None]:
        """As `watch`, of the frames for pages of all cars."""
        self._bus.want(ALL, SUMMARY, +1)
        leave = self._join(FLEET, on_new)
        self._put()  # at once, and from now on at least every `SILENT_S`

        def end() -> None:
            leave()
            self._bus.want(ALL, SUMMARY, -1)
            if not self._pages[FLEET] and self._silence is not None:
                self._silence.cancel()

        return end

    def _join(self, frame: str, on_new: Callable[[str], None]) -> Callable[[], None]:
        self._next_page += 1
        key = self._next_page
        self._pages[frame][key] = on_new
        if self._unwatch is None:
            self._unwatch = self._bus.watch(ALL, self._on_new)

        def leave() -> None:
            self._pages[frame].pop(key, None)
            if not any(self._pages.values()) and self._unwatch is not None:
                self._unwatch()
                self._unwatch = None

        return leave

    def _on_new(self, kind: str) -> None:
        """A session put its summary. Sent soon where its alarms or its person changed, else twice a second."""
        frame = None if kind in (FRAME, FLEET) else self._bus.newest(ALL, kind)
        if frame is None:
            return
        self._seen_s[kind] = frame.put_s
        alarms = _alarms_of(orjson.loads(frame.payload))
        is_urgent = self._alarms.get(kind) != alarms
        self._alarms[kind] = alarms
        now_s = self._now()
        if is_urgent:
            due_s = max(now_s + URGENT_S, self._put_s + LEAST_S)
        else:
            due_s = max(now_s + COLLECT_S, self._put_s + EVERY_S - COLLECT_S)
        if self._next is not None:
            if due_s >= self._next_s:
                return
            self._next.cancel()
        self._next_s = due_s
        self._next = asyncio.get_running_loop().call_later(due_s - now_s, self._put_due)

    def _put_due(self) -> None:
        self._next = None
        self._put()

    def _put(self) -> None:
        names = self._bus.vehicles
        if self._pages[FLEET]:
            if self._silence is not None:
                self._silence.cancel()
            self._silence = asyncio.get_running_loop().call_later(SILENT_S, self._put)
        elif len(names) < 2:
            return
        self._put_s = self._now()
        cars = {"kind": "cars", "time_ms": self._wall_ms(), "cars": [self._car(name) for name in names]}
        payload = orjson.dumps(cars).decode()
        if len(names) > 1:
            self._publish(FRAME, payload)
        if self._pages[FLEET]:
            self._publish(FLEET, payload)

    def _publish(self, frame: str, payload: str) -> None:
        """Pages are called for what they are sent and not, as viewers of all cars, for each car's summary too."""
        self._bus.put(ALL, frame, payload)
        for on_new in tuple(self._pages[frame].values()):
            on_new(FRAME)

    def _car(self, name: str) -> dict[str, Any]:
        """A `ListedCar`, its summary as it came.

        `newest` answers nothing that is older than 2 s: what a stopped session stated is not shown as if it held.
        """
        frame, seen_s = self._bus.newest(ALL, name), self._seen_s.get(name)
        off = {} if frame is not None or (declared := self._off(name)) is None else {"off": declared}
        return {
            "name": name,
            "age_s": None if seen_s is None else round(max(0.0, self._now() - seen_s), 2),
            "summary": None if frame is None else orjson.Fragment(frame.payload),
            "trouble": None if frame is not None else self._bus.trouble(name),
            **off,
        }


def _alarms_of(summary: dict[str, Any]) -> object:
    """What is sent at once when it changes."""
    worst, item = summary["worst"], summary.get("attention")
    key = worst and (worst["id"], worst["occurrence"], worst["state"], worst["active"])
    person = item and [one and one["page"] for one in (item["assigned"], item["offered"])]
    requesters = [one["page"] for one in summary.get("requests", ())]
    return (
        key,
        summary["waiting"],
        summary.get("unowned"),
        summary["phase"],
        person,
        item and item["escalated_ms"] is None,
        requesters,
    )

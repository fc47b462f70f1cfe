"""A car whose alarms are switched by the test, with the real session and no link to a car, in virtual time."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, cast

from monitor.alarm_spec import AlarmSpec, Place, Priority, Sound
from monitor.check import Check, Finding, Limits, Scope, fault, ok
from monitor.state import Snapshot
from server.bus.bus import ALL
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.simulator.car import SimulatedCar
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.server.vehicle.car_source import CarSource

WALL_MS = 1_800_000_000_000
SEEN = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready"}
ANN = {"by": "Ann", "who": "phone-a", "page": "page-a"}
BEN = {"by": "Ben", "who": "phone-b", "page": "page-b"}
PROGRAM = {"by": "dispatch", "who": "program", "page": None}


class Dialled(CarSource):
    """A car that is dialled and does not answer: monitoring is on."""

    def __init__(self) -> None:
        super().__init__(cast(SimulatedCar, SimpleNamespace(published=())))

    def start(self) -> None:
        """Nothing comes."""


class Attended:
    """`faults`: the priorities of the alarms that are active. `clock`: its own, else one that the test moves on."""

    def __init__(
        self,
        name: str = "ocelot",
        clock: Callable[[], float] | None = None,
        *,
        scope: Scope = Scope.SERVER,
        after: Attended | None = None,
    ) -> None:
        """`scope`: of its checks; those of the car's link sound. `after`: the same car before the server's restart."""
        self.now_s = 0.0 if after is None else after.now_s
        self.name = name
        self.faults: set[Priority] = set() if after is None else after.faults
        self.say_what = "12.6 m/s, limit 11.0 m/s"  # by their checks
        self._clock = clock or (lambda: self.now_s)
        self.bus = LocalBus(Journal(None), now=self._clock) if after is None else after.bus
        self.session = Session(
            Vehicle(name=name),
            self.bus,
            now=self._clock,
            wall_ms=lambda: WALL_MS + round(1000 * self._clock()),
            server=dict,  # type: ignore[arg-type]
            checks=[self._check(priority, scope) for priority in Priority],
            open_source=Dialled(),
        )
        if after is not None:
            self.session._restoration.begin()
        self.session.connect("ws://127.0.0.1:9090", by=None)
        self.bus.serve(name, self.session._commands.handle)
        self.bus.watch(ALL, lambda _: None)

    def _check(self, priority: Priority, scope: Scope) -> Check[Limits]:
        def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
            return fault(self.say_what) if priority in self.faults else ok("fine")

        sound = Sound.NONE if scope is Scope.SERVER else Sound.MEDIUM
        spec = AlarmSpec(title=f"Test {priority}", priority=priority, place=Place.LIST, sound=sound, needs_ack=False)
        return Check(id=f"test_{priority}", label=priority, alarm=spec, limits=Limits, find=find, scope=scope)

    def tick(self, seconds: float = 0.0, *, reporting: tuple[Mapping[str, Any], ...] = ()) -> None:
        """Time passes, a tick every 50 ms; the pages in `reporting` report once a second."""
        until_s = self.now_s + seconds
        due_s = self.now_s
        while True:
            if self.now_s >= due_s:
                due_s += 1.0
                for page in reporting:
                    self.report(page)
            self.session._tick.run(self._clock(), put=True)
            if self.now_s >= until_s:
                return
            self.now_s = min(until_s, self.now_s + 0.05)

    def report(self, page: Mapping[str, Any]) -> None:
        """A page of all cars reports that it is there."""
        found = self.session._commands._query({**SEEN, **page, "kind": "announces"})
        assert found == {"ok": True}

    async def ask(self, who: Mapping[str, Any], kind: str, **more: Any) -> dict[str, Any]:
        return dict(await self.bus.request(self.name, {"kind": kind, **more, **who}))

    async def refused(self, who: Mapping[str, Any], kind: str, **more: Any) -> str:
        answer = await self.ask(who, kind, **more)
        assert answer["ok"] is False, answer
        return str(answer["reason"])

    async def accepted(self, who: Mapping[str, Any], kind: str, **more: Any) -> None:
        answer = await self.ask(who, kind, **more)
        assert answer["ok"] is True, answer

    @property
    def summary(self) -> dict[str, Any]:
        """The newest on the bus."""
        frame = self.bus.newest(ALL, self.name)
        assert frame is not None
        found: dict[str, Any] = json.loads(frame.payload)
        return found

    @property
    def item(self) -> dict[str, Any] | None:
        found: dict[str, Any] | None = self.summary["attention"]
        return found

    @property
    def log(self) -> list[dict[str, Any]]:
        """The events of the attention queue, oldest first."""
        return list(reversed(self.bus.past_events(self.name, change="attention")))

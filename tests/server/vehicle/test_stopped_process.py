"""A process that is stopped while it makes a state: what was so before is not shown as if it were so now."""

from __future__ import annotations

import itertools
import json
from types import SimpleNamespace
from typing import Any, cast

from server.bus.bus import FRAME_LIVES_S
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.simulator.car import SimulatedCar
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.server.vehicle.car_source import CarSource

STOPPED_S = 1.5  # the bus keeps what is younger than FRAME_LIVES_S


class StoppingClock:
    """Stands still, but for one stop of the process before the reading with that number."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.left = -1
        self.was_stopped = False

    def __call__(self) -> float:
        if self.left == 0:
            self.now_s += STOPPED_S
            self.was_stopped = True
        self.left -= 1
        return self.now_s


def test_a_state_is_as_old_as_what_it_holds() -> None:
    """Wherever the process is stopped: neither the time of day in the state nor the age of its frame is younger."""
    assert STOPPED_S < FRAME_LIVES_S
    clock = StoppingClock()
    bus = LocalBus(Journal(None), now=clock)
    server: Any = lambda: {"time_ms": round(1000 * clock())}  # noqa: E731
    source = CarSource(cast(SimulatedCar, SimpleNamespace(published=())))
    source.start = lambda: None  # type: ignore[method-assign]
    session = Session(
        Vehicle(name="car"), bus, now=clock, wall_ms=lambda: round(1000 * clock()), server=server, open_source=source
    )
    session.connect("ws://127.0.0.1:9090", by=None)
    bus.watch("car", lambda _: None)
    paused_s = clock.now_s
    session._parts.pause.begin(session._parts.judgement.state, paused_s, by="Ann")
    for reading in itertools.count():
        clock.left, clock.was_stopped = reading, False
        session._parts.publisher.put()
        frame = bus.newest("car", "state")
        if not clock.was_stopped:
            break
        assert frame is not None
        state = json.loads(frame.payload)
        held_s = paused_s + state["session"]["paused_for_s"]  # what the state holds was so then
        assert frame.put_s <= held_s + 0.06, f"stopped before reading {reading}"
        assert state["server"]["time_ms"] / 1000 <= held_s + 0.06, f"stopped before reading {reading}"
    assert reading > 3

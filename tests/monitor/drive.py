"""A car in virtual time, for tests of the whole judge: signals at their rates, a link, a tick ten times a second."""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from monitor.alarm import Transition
from monitor.runner import Monitor
from monitor.state import LinkFacts, State
from monitor.values import (
    Bearing,
    Component,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    LaserScan,
    MotionCommand,
    Odometry,
    Steering,
    Twist,
    Value,
)

TICK_S = 0.1

# Messages per second of the real car.
REAL_HZ: dict[str, float] = {
    "speed": 20.0,
    "brake": 20.0,
    "accelerator": 20.0,
    "steering": 20.0,
    "distance": 75.0,
    "bearing": 75.0,
    "position": 10.0,
    "odometry": 10.0,
    "scan": 75.0,
    "diagnostics": 1.0,
}


def sweep(ranges_m: Collection[float] = (5.0, 6.0, 7.0)) -> LaserScan:
    return LaserScan(
        ranges_m=np.array(list(ranges_m), dtype=np.float32),
        angle_min_rad=-1.0,
        angle_max_rad=1.0,
        angle_increment_rad=1.0,
        time_increment_s=0.0,
        scan_time_s=0.0,
        range_min_m=0.0,
        range_max_m=81.0,
        frame_id="laser",
    )


VALUES: dict[str, Value] = {
    "speed": Twist(speed_mps=4.0),
    "brake": Effort(percent=0.0),
    "accelerator": Effort(percent=14.0),
    "steering": Steering(percent=-4.0, tyre_rad=0.02144),
    "distance": Distance(distance_m=12.4),
    "bearing": Bearing(bearing_rad=-0.05),
    "position": GpsFix(lat_deg=32.23, lon_deg=-110.95),
    "odometry": Odometry(x_m=0.0, y_m=0.0),
    "scan": sweep(),
    "diagnostics": Diagnostics(components=(Component(name="laser", level=0, message="OK"),)),
    "command": MotionCommand(speed_mps=1.0, tyre_angle_rad=None),
}


class Drive:
    """Runs a car against a `Monitor`; what happened stands in `log`, each transition as (when, what, which)."""

    def __init__(self, hz: Mapping[str, float] = REAL_HZ, monitor: Monitor | None = None) -> None:
        self.hz = dict(hz)
        self.values = dict(VALUES)
        self.silent: set[str] = set()
        self.bridge_alive = True
        self.now_s = 0.0
        self.state = State()
        self.monitor = Monitor() if monitor is None else monitor
        self.happened: list[Transition] = []
        self.link = LinkFacts(phase="connecting", published=frozenset(hz), topics_subscribed=len(hz))
        # The phases differ from signal to signal, as in a real car.
        self._due = [(0.003 * number, name) for number, name in enumerate(self.hz)]
        heapq.heapify(self._due)
        self._tick_s = 0.0
        self._proof_s = 0.0
        self._way_m = 0.0
        self._way_at_s = 0.0

    @property
    def log(self) -> list[tuple[float, str, str]]:
        return [(round(t.at_s, 1), t.change, t.alarm_id) for t in self.happened]

    @property
    def announced(self) -> list[str]:
        return [t.alarm_id for t in self.happened if t.announces]

    def open(self) -> Drive:
        """The link opens, the first time or again."""
        connected_s = self.now_s if self.link.connected_s is None else self.link.connected_s
        self.link = replace(
            self.link, phase="monitoring", since_s=self.now_s, connected_s=connected_s, bridge_answers=True
        )
        self._link_changed()
        return self

    def lose(self, title: str = "The bridge stopped answering.") -> Drive:
        self.link = replace(self.link, phase="lost", since_s=self.now_s, bridge_answers=False, problem_title=title)
        self._link_changed()
        return self

    def phase(self, phase: str, **facts: object) -> Drive:
        self.link = replace(self.link, phase=phase, since_s=self.now_s, **facts)  # type: ignore[arg-type]
        self._link_changed()
        return self

    def pause(self, paused: bool = True) -> Drive:
        self.state.set_paused(paused)
        self._judge(None)
        return self

    def to(self, until_s: float) -> Drive:
        """Let time pass."""
        while True:
            next_s = min(self._due[0][0] if self._due else np.inf, self._tick_s, self._proof_s)
            if next_s > until_s:
                self.now_s = until_s
                return self
            self.now_s = next_s
            if next_s == self._proof_s:
                self._proof_s += 1.0
                if self.bridge_alive and self.link.phase == "monitoring":
                    self.link = replace(self.link, bridge_heard_s=next_s)
                    self.state.link(self.link)
            elif next_s == self._tick_s:
                self._tick_s += TICK_S
                self._judge(None)
            else:
                _, name = heapq.heappop(self._due)
                heapq.heappush(self._due, (next_s + 1.0 / self.hz[name], name))
                if name not in self.silent and self.bridge_alive and self.link.phase == "monitoring":
                    self._judge(self.state.receive(name, self._value(name), next_s))

    def send(self, name: str, value: Value) -> Drive:
        """One message out of turn."""
        self._judge(self.state.receive(name, value, self.now_s))
        return self

    def _value(self, name: str) -> Value:
        """The car's value now: northward of the place in `values` as it moves, and never exactly the same twice."""
        speed = self.values["speed"]
        assert isinstance(speed, Twist)
        self._way_m += speed.speed_mps * (self.now_s - self._way_at_s)
        self._way_at_s = self.now_s
        wobble = 1e-5 * math.sin(1000.0 * self.now_s)
        value = self.values[name]
        if isinstance(value, Twist):
            return replace(value, speed_mps=value.speed_mps + wobble)
        if isinstance(value, LaserScan):
            return replace(value, ranges_m=value.ranges_m + np.float32(wobble))
        if isinstance(value, GpsFix):
            return replace(value, lat_deg=value.lat_deg + self._way_m / 111_000.0)
        if isinstance(value, Odometry):
            return replace(value, y_m=value.y_m + self._way_m)
        return value

    def _link_changed(self) -> None:
        self.state.link(self.link)
        self._judge(None)

    def _judge(self, changed: Collection[str] | None) -> None:
        self.happened += self.monitor.step(self.state.snapshot(self.now_s), changed)

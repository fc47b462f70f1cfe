"""The rules of a health judge, written down once more and only for tests: what does a stream of messages break?"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np

from server.judge.message import Message
from server.simulator.messages import SIGNAL_OF_TOPIC

SPEED_LIMIT_MPS = 11.0
HALF_CORRIDOR_M = 1.2
LASER_AHEAD_M, WHEELBASE_M = 2.5, 2.62
RATES_HZ = {
    "speed": 20, "brake": 20, "accelerator": 20, "steering": 20, "command": 20,
    "distance": 75, "bearing": 75, "scan": 75, "position": 10, "odometry": 10, "diagnostics": 1, "mode": 20,
}  # fmt: skip


class Rules:
    """Takes messages in order of time; `broken` tells when each rule was broken [s from the first]."""

    def __init__(self, *, reaction_s: float = 1.0, braking_mps2: float = 1.5) -> None:
        self.broken: dict[str, list[float]] = {}
        self._reaction_s, self._braking_mps2 = reaction_s, braking_mps2
        self._began_s: float | None = None
        self._received_s: dict[str, float] = {}
        self._recent: dict[str, deque[float]] = {signal: deque() for signal in RATES_HZ}
        self._speed_mps = 0.0
        self._tyre_rad = 0.0
        self._pedals = {"brake": 0.0, "accelerator": 0.0}
        self._both_since_s: float | None = None
        self._speed_runs: deque[tuple[float, float]] = deque()
        self._stood_since_s: float | None = None
        self._at_rest: list[tuple[float, float, float]] = []
        self._fix: tuple[float, float, float] | None = None
        self._jumps = self._drifts = 0
        self._blind_since_s: float | None = None
        self._bearing_rad = 0.0

    def run(self, messages: Iterable[Message], until_s: float) -> Rules:
        """Takes messages until that many seconds after the first."""
        for message in messages:
            if self._began_s is not None and message.at_s - self._began_s > until_s:
                break
            self.take(message)
        return self

    def take(self, message: Message) -> None:
        if self._began_s is None:
            self._began_s = message.at_s
            self._received_s = dict.fromkeys(RATES_HZ, message.at_s)
        now_s, signal, fields = message.at_s, SIGNAL_OF_TOPIC[message.topic], message.message
        self._rates(now_s, signal)
        match signal:
            case "speed":
                self._speed(now_s, fields["linear"]["x"])
            case "brake" | "accelerator":
                self._pedals[signal] = fields["force"]["x"]
                self._both(now_s)
            case "steering":
                self._tyre_rad = -0.00536 * fields["torque"]["z"]
            case "position":
                self._position(now_s, fields)
            case "scan":
                self._scan(now_s, fields)
            case "distance":
                if fields["data"] < min(self._needed_m(), 81.0):
                    self._breaks("nearest object", now_s)
            case "diagnostics":
                if any(row["level"] >= 2 for row in fields["status"]):
                    self._breaks("diagnostics", now_s)

    def _breaks(self, rule: str, now_s: float) -> None:
        assert self._began_s is not None
        self.broken.setdefault(rule, []).append(now_s - self._began_s)

    def _needed_m(self) -> float:
        speed = self._speed_mps
        stopping_m = speed * self._reaction_s + speed**2 / (2 * self._braking_mps2)
        return max(5.0, stopping_m, 2.0 * speed)

    def _rates(self, now_s: float, signal: str) -> None:
        self._received_s[signal] = now_s
        recent = self._recent[signal]
        recent.append(now_s)
        while recent[0] < now_s - 5.0:
            recent.popleft()
        for name, received_s in self._received_s.items():
            if now_s - received_s > max(10 / RATES_HZ[name], 1.0):
                self._breaks(f"stale {name}", now_s)
        if self._began_s is not None and now_s - self._began_s > 6.0 and len(recent) > 1:
            rate = (len(recent) - 1) / max(recent[-1] - recent[0], 1e-9)
            if rate < 0.9 * RATES_HZ[signal]:
                self._breaks(f"slow {signal}", now_s)

    def _speed(self, now_s: float, speed_mps: float) -> None:
        self._speed_mps = speed_mps
        if speed_mps > SPEED_LIMIT_MPS:
            self._breaks("speed", now_s)
        if speed_mps >= 0.10:
            self._stood_since_s, self._at_rest = None, []
        elif self._stood_since_s is None:
            self._stood_since_s = now_s
        elif now_s - self._stood_since_s > 10.0:
            self._breaks("not moving", now_s)
        self._speed_runs.append((now_s, speed_mps))
        while self._speed_runs[0][0] < now_s - 2.0:
            self._speed_runs.popleft()
        if speed_mps > 0.3 and len(self._speed_runs) > 30 and len({value for _, value in self._speed_runs}) == 1:
            self._breaks("frozen speed", now_s)

    def _both(self, now_s: float) -> None:
        if min(self._pedals.values()) <= 2.0:
            self._both_since_s = None
        elif self._both_since_s is None:
            self._both_since_s = now_s
        elif now_s - self._both_since_s > 0.3:
            self._breaks("pedals", now_s)

    def _position(self, now_s: float, fields: Any) -> None:
        north_m = fields["latitude"] * 110_890.0
        east_m = fields["longitude"] * 94_256.0
        if self._fix is not None:
            pace_mps = math.hypot(east_m - self._fix[1], north_m - self._fix[2]) / (now_s - self._fix[0])
            self._jumps = self._jumps + 1 if pace_mps > self._speed_mps + 3.0 else 0
            if self._jumps >= 3:
                self._breaks("gps jump", now_s)
        self._fix = (now_s, east_m, north_m)
        if self._stood_since_s is None or now_s - self._stood_since_s < 2.0:
            self._drifts = 0
            return
        self._at_rest.append((now_s, east_m, north_m))
        anchor = np.median([row[1:] for row in self._at_rest if row[0] < self._at_rest[0][0] + 2.0], axis=0)
        away_m = math.hypot(east_m - anchor[0], north_m - anchor[1])
        self._drifts = self._drifts + 1 if away_m > max(2.0, 4.3 * 2.5) else 0
        if self._drifts >= 3:
            self._breaks("gps drift", now_s)
        if away_m > 2.0:
            self._breaks("gps wander", now_s)

    def _scan(self, now_s: float, fields: Any) -> None:
        ranges = np.asarray(fields["ranges"], dtype=float)
        angles = fields["angle_min"] + fields["angle_increment"] * np.arange(len(ranges))
        usable = np.isfinite(ranges) & (ranges >= fields["range_min"]) & (ranges <= fields["range_max"])
        narrow = np.abs(angles) <= math.atan2(HALF_CORRIDOR_M, 12.0)
        if usable[narrow].mean() >= 0.1:
            self._blind_since_s = None
        elif self._blind_since_s is None:
            self._blind_since_s = now_s
        elif now_s - self._blind_since_s > 1.0:
            self._breaks("blind laser", now_s)
        ahead = np.where(usable, ranges, np.inf) * np.cos(angles)
        left = np.where(usable, ranges, 0.0) * np.sin(angles)
        for rule, side, way in (
            ("obstacle straight", left, ahead),
            ("obstacle curved", *_along_the_curve(ahead, left, self._tyre_rad)),
        ):
            in_way = usable & (np.abs(side) < HALF_CORRIDOR_M) & (ahead > 0) & (way > 0) & (way < self._needed_m())
            if np.any(in_way[1:] & in_way[:-1]):
                self._breaks(rule, now_s)


def _along_the_curve(ahead: Any, left: Any, tyre_rad: float) -> tuple[Any, Any]:
    """Sideways distance from, and way along, the arc which the laser follows with this tyre angle."""
    if abs(tyre_rad) < 1e-4:
        return left, ahead
    radius = WHEELBASE_M / math.tan(tyre_rad)  # of the rear axle's arc, whose middle lies at its left
    x = np.where(np.isfinite(ahead), ahead, 1e6) + LASER_AHEAD_M
    y = left - radius
    side = np.hypot(x, y) - math.hypot(LASER_AHEAD_M, radius)
    start = math.atan2(LASER_AHEAD_M, abs(radius))
    turned = np.arctan2(x, -y * math.copysign(1.0, radius)) - start
    return side, turned * math.hypot(LASER_AHEAD_M, radius)

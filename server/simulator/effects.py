"""Faults laid over a stream of messages: each effect takes one message and returns what replaces it.

An effect knows no clock and no topic: time is the message's own, and it is given the signal that message carries, as
the topic table names signals. So the same faults go over the simulated car and over any recording.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np

from server.judge.message import Message
from server.simulator.fields import EFFORT_PATHS, SPEED_PATHS, changed, number_at, with_fields, with_number
from server.simulator.lap import metres_per_degree


class Effect:
    """Begins when it is made. After `end()` it finds back to normal, and when nothing is left of it `is_over`."""

    def __init__(self) -> None:
        self.is_ending = False

    @property
    def is_over(self) -> bool:
        return self.is_ending

    def end(self) -> None:
        self.is_ending = True

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        """What is sent in place of a message which carries `signal` (None: a topic of no known signal)."""
        raise NotImplementedError


class Silence(Effect):
    """Nothing comes on the signals named, or on any topic at all."""

    def __init__(self, *signals: str) -> None:
        super().__init__()
        self._signals = frozenset(signals)

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        return () if not self._signals or signal in self._signals else (message,)


class SlowRate(Effect):
    """Of the signals named, or of every topic, only every second message comes."""

    def __init__(self, *signals: str) -> None:
        super().__init__()
        self._signals = frozenset(signals)
        self._skips: dict[str, bool] = {}  # by topic

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if self._signals and signal not in self._signals:
            return (message,)
        skips = self._skips[message.topic] = not self._skips.get(message.topic, False)
        return () if skips else (message,)


class Speeding(Effect):
    """The published speed climbs to one well above the usual limit, and comes down again afterwards."""

    REACHED_MPS = 12.6
    CLIMB_MPS2 = 2.0

    def __init__(self) -> None:
        super().__init__()
        self._extra_mps = 0.0
        self._before_s: float | None = None

    @property
    def is_over(self) -> bool:
        return self.is_ending and self._extra_mps == 0.0

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        speed_mps = number_at(message, SPEED_PATHS) if signal == "speed" else None
        if speed_mps is None:
            return (message,)
        passed_s = 0.0 if self._before_s is None else max(0.0, message.at_s - self._before_s)
        self._before_s = message.at_s
        wanted_mps = 0.0 if self.is_ending else max(0.0, self.REACHED_MPS - speed_mps)
        step = self.CLIMB_MPS2 * passed_s
        self._extra_mps += min(step, max(-step, wanted_mps - self._extra_mps))
        return (with_number(message, SPEED_PATHS, speed_mps + self._extra_mps),)


class FrozenSpeed(Effect):
    """Messages of speed go on, but from the first one in motion they all have the same value."""

    def __init__(self, *, above_mps: float = 0.5) -> None:
        super().__init__()
        self._above_mps = above_mps
        self._frozen: Mapping[str, Any] | None = None

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal != "speed":
            return (message,)
        if self._frozen is None:
            if (number_at(message, SPEED_PATHS) or 0.0) > self._above_mps:
                self._frozen = message.message
            return (message,)
        return (with_fields(message, self._frozen),)


class IgnoredCommand(Effect):
    """The driver orders a stop while the car is in motion; the car does what it would have done anyway."""

    ABOVE_MPS = 2.0

    def __init__(self) -> None:
        super().__init__()
        self._speed_mps = 0.0

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal == "speed":
            self._speed_mps = abs(number_at(message, SPEED_PATHS) or 0.0)
        if signal != "command" or self._speed_mps < self.ABOVE_MPS:
            return (message,)
        return (with_number(message, SPEED_PATHS, 0.0),)


class BothPedals(Effect):
    """Brake and accelerator are reported as pressed at once."""

    PERCENT: ClassVar[Mapping[str, float]] = {"brake": 31 * 100 / 255, "accelerator": 46 * 100 / 255}

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        least = self.PERCENT.get(signal or "")
        if least is None:
            return (message,)
        percent = max(least, number_at(message, EFFORT_PATHS) or 0.0)
        return (with_number(message, EFFORT_PATHS, percent),)


class GpsOffset(Effect):
    """The position moves away from the truth, in position and odometry alike.

    It moves eastward and a little to the north at `pace_mps`, up to `most_m`, while the state of the car matches
    `during`, for standing cars `after_s` after they stopped. Afterwards it comes back at `back_mps` while the car
    moves, or at once where that is None.
    """

    EAST, NORTH = math.sin(math.radians(70)), math.cos(math.radians(70))
    STANDING_MPS = 0.10
    MOVING_MPS = 0.30

    def __init__(
        self,
        *,
        pace_mps: float,
        most_m: float,
        during: Literal["always", "standing", "moving"],
        after_s: float = 0.0,
        back_mps: float | None,
    ) -> None:
        super().__init__()
        self._pace_mps, self._most_m, self._during = pace_mps, most_m, during
        self._after_s, self._back_mps = after_s, back_mps
        self._offset_m = 0.0
        self._before_s: float | None = None
        self._speed_mps: float | None = None  # None: not received yet
        self._stood_since_s: float | None = None

    @property
    def is_over(self) -> bool:
        return self.is_ending and (self._offset_m == 0.0 or self._back_mps is None)

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        match signal:
            case "speed":
                self._heed_speed(message)
            case "position":
                self._advance(message.at_s)
                return (self._moved_fix(message),)
            case "odometry":
                self._advance(message.at_s)
                return (self._moved_odometry(message),)
        return (message,)

    def _heed_speed(self, message: Message) -> None:
        speed_mps = number_at(message, SPEED_PATHS)
        if speed_mps is None:
            return
        self._speed_mps = abs(speed_mps)
        if self._speed_mps >= self.STANDING_MPS:
            self._stood_since_s = None
        elif self._stood_since_s is None:
            self._stood_since_s = message.at_s

    def _advance(self, now_s: float) -> None:
        passed_s = 0.0 if self._before_s is None else min(1.0, max(0.0, now_s - self._before_s))
        self._before_s = now_s
        is_moving = self._speed_mps is not None and self._speed_mps > self.MOVING_MPS
        if not self.is_ending:
            if self._may_grow(now_s, is_moving):
                self._offset_m = min(self._most_m, self._offset_m + self._pace_mps * passed_s)
        elif self._back_mps is not None and is_moving:
            self._offset_m = max(0.0, self._offset_m - self._back_mps * passed_s)

    def _may_grow(self, now_s: float, is_moving: bool) -> bool:
        match self._during:
            case "always":
                return True
            case "moving":
                return is_moving
            case "standing":
                return self._stood_since_s is not None and now_s - self._stood_since_s >= self._after_s

    def _moved_fix(self, message: Message) -> Message:
        lat_deg = number_at(message, (("latitude",),))
        lon_deg = number_at(message, (("longitude",),))
        if lat_deg is None or lon_deg is None or self._offset_m == 0.0:
            return message
        east_m, north_m = metres_per_degree(lat_deg)
        return with_fields(
            message,
            {
                **message.message,
                "latitude": lat_deg + self.NORTH * self._offset_m / north_m,
                "longitude": lon_deg + self.EAST * self._offset_m / east_m,
            },
        )

    def _moved_odometry(self, message: Message) -> Message:
        x_path, y_path = ("pose", "pose", "position", "x"), ("pose", "pose", "position", "y")
        x, y = number_at(message, (x_path,)), number_at(message, (y_path,))
        if x is None or y is None or self._offset_m == 0.0:
            return message
        moved = changed(message.message, x_path, x + self.EAST * self._offset_m)
        return with_fields(message, changed(moved, y_path, y + self.NORTH * self._offset_m))


class BlindLaser(Effect):
    """The laser turns, but no beam comes back; the distance estimator then reports that nothing is near."""

    def __init__(self) -> None:
        super().__init__()
        self._range_max_m = 81.0
        self._angle_min_rad = -math.pi / 2

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        match signal:
            case "scan":
                ranges = message.message.get("ranges")
                if ranges is None:
                    return (message,)
                self._range_max_m = number_at(message, (("range_max",),)) or self._range_max_m
                self._angle_min_rad = number_at(message, (("angle_min",),)) or self._angle_min_rad
                nothing = np.full(len(ranges), np.inf, dtype=np.float32)
                return (with_fields(message, {**message.message, "ranges": nothing}),)
            case "distance":
                return (with_fields(message, {**message.message, "data": self._range_max_m}),)
            case "bearing":
                return (with_fields(message, {**message.message, "data": self._angle_min_rad}),)
        return (message,)


class ObstacleAhead(Effect):
    """Something 1.8 m wide stands straight ahead of the laser, in the scan and for the distance estimator."""

    AHEAD_M = 4.4
    HALF_WIDTH_M = 0.9

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        match signal:
            case "scan":
                return (self._hidden_behind(message),)
            case "distance":
                distance_m = number_at(message, (("data",),))
                nearer = self.AHEAD_M if distance_m is None else min(self.AHEAD_M, distance_m)
                return (with_fields(message, {**message.message, "data": nearer}),)
            case "bearing":
                return (with_fields(message, {**message.message, "data": 0.0}),)
        return (message,)

    def _hidden_behind(self, message: Message) -> Message:
        given = message.message.get("ranges")
        first, increment = (number_at(message, ((name,),)) for name in ("angle_min", "angle_increment"))
        if given is None or first is None or increment is None:
            return message
        ranges = np.array(given, dtype=np.float32)  # null becomes NaN
        angles = first + increment * np.arange(len(ranges))
        hit = np.abs(angles) < math.atan2(self.HALF_WIDTH_M, self.AHEAD_M)
        face = (self.AHEAD_M / np.cos(angles[hit])).astype(np.float32)
        ranges[hit] = np.fmin(face, ranges[hit])
        return with_fields(message, {**message.message, "ranges": ranges})


class ComponentReport(Effect):
    """One component of the diagnostics reports a level of badness: the first that is there, or one of its own."""

    def __init__(self, level: int, text: str) -> None:
        super().__init__()
        self._report = {"level": level, "message": text}

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal != "diagnostics":
            return (message,)
        given = message.message.get("status")
        rows = [dict(row) for row in given if isinstance(row, Mapping)] if isinstance(given, list | tuple) else []
        if not rows:
            rows = [{"name": "by-wire: brake", "hardware_id": "", "values": []}]
        rows[0].update(self._report)
        return (with_fields(message, {**message.message, "status": rows}),)

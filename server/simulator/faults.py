"""Faults of single sensors, of the car's clock and of the topic of the driving mode, as effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from server.judge.message import Message
from server.simulator.effects import Effect
from server.simulator.fields import with_fields

HALF_PERIOD_S = 0.2


class FlickeringMode(Effect):
    """The mode is published as it is and as the other one by turns, each for 0.2 s."""

    def __init__(self) -> None:
        super().__init__()
        self._began_s: float | None = None

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal != "mode":
            return (message,)
        if self._began_s is None:
            self._began_s = message.at_s
        turn = int(max(0.0, message.at_s - self._began_s + 1e-6) / HALF_PERIOD_S)
        if turn % 2:
            return (message,)
        return (with_fields(message, {**message.message, "data": _other(message.message.get("data"))}),)


def _other(value: Any) -> Any:
    if isinstance(value, str):
        return "autonomous" if value == "manual" else "manual"
    return not value if isinstance(value, bool) else 1 - value if value in (0, 1) else value


class OtherClock(Effect):
    """A wrong clock of the car: set forward or back by some seconds at once, or running slower or faster.

    `pace` is by how much it gains on a true clock [s/s], up to `most_s`. Afterwards it is right again, in the same
    manner: at once after a step, at the same pace after a drift.
    """

    def __init__(self, *, step_s: float = 0.0, pace: float = 0.0, most_s: float = 0.0) -> None:
        super().__init__()
        self._pace, self._most_s = pace, most_s
        self._off_s = step_s
        self._before_s: float | None = None

    @property
    def is_over(self) -> bool:
        return self.is_ending and (self._pace == 0.0 or self._off_s == 0.0)

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        passed_s = 0.0 if self._before_s is None else max(0.0, message.at_s - self._before_s)
        self._before_s = message.at_s
        if self._pace:
            step_s = abs(self._pace) * passed_s
            wanted_s = 0.0 if self.is_ending else math.copysign(self._most_s, self._pace)
            self._off_s += min(step_s, max(-step_s, wanted_s - self._off_s))
        header = message.message.get("header")
        if not isinstance(header, Mapping) or not isinstance(header.get("stamp"), Mapping):
            return (message,)
        stamp = header["stamp"]
        seconds = "secs" if "secs" in stamp else "sec"
        parts = "nsecs" if "nsecs" in stamp else "nanosec"
        if type(stamp.get(seconds)) is not int or type(stamp.get(parts)) is not int:
            return (message,)
        stamp_ns = stamp[seconds] * 1_000_000_000 + stamp[parts]
        if not stamp_ns:  # not given
            return (message,)
        whole, rest = divmod(stamp_ns + round(self._off_s * 1e9), 1_000_000_000)
        moved = {**header, "stamp": {seconds: whole, parts: rest}}
        return (with_fields(message, {**message.message, "header": moved}),)


class FrozenPosition(Effect):
    """Messages of position go on, their stamps too, but they all have the place of the first one."""

    def __init__(self) -> None:
        super().__init__()
        self._place: dict[str, Any] | None = None

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal != "position":
            return (message,)
        if self._place is None:
            names = ("latitude", "longitude", "altitude")
            self._place = {name: message.message[name] for name in names if name in message.message}
        return (with_fields(message, {**message.message, **self._place}),)


class FrozenScan(Effect):
    """The first scan comes again and again, its stamp included, as from a driver whose device has hung."""

    def __init__(self) -> None:
        super().__init__()
        self._scan: Mapping[str, Any] | None = None

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal != "scan":
            return (message,)
        if self._scan is None:
            self._scan = message.message
        return (with_fields(message, self._scan),)


class TruncatedScan(Effect):
    """Of each scan the last ten beams are missing, though its angles promise them."""

    MISSING = 10

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        ranges = message.message.get("ranges") if signal == "scan" else None
        if not isinstance(ranges, list | tuple | np.ndarray):
            return (message,)
        return (with_fields(message, {**message.message, "ranges": ranges[: -self.MISSING]}),)


class NoFix(Effect):
    """The receiver has lost its satellites; its coordinates go on, and mean nothing."""

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal != "position":
            return (message,)
        return (with_fields(message, {**message.message, "status": {"status": -1, "service": 1}}),)


class NearObject(Effect):
    """The distance estimator reports something near straight ahead, which no scan shows."""

    AHEAD_M = 3.5

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal not in ("distance", "bearing"):
            return (message,)
        return (with_fields(message, {**message.message, "data": self.AHEAD_M if signal == "distance" else 0.0}),)

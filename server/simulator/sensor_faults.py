"""Faults of single sensors: they hang, lose their fix, cut their scans short or see what is not there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from server.judge.message import Message
from server.simulator.effects import Effect
from server.simulator.fields import with_fields


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

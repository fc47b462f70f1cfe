"""A clock of the car that is not what it should be."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from server.judge.message import Message
from server.simulator.effects import Effect
from server.simulator.fields import with_fields


class OtherClock(Effect):
    """The car's clock is another: set forward or back by some seconds at once, or running slower or faster.

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

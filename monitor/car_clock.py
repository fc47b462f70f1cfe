"""The offset of the ROS clock, from calls for its time; it gives the delay of messages with a stamp of that clock.

The answer is made between call and reply, so the offset is at most its time less ours at the call, and at least its
time less ours at the reply. The tightest bounds of several calls count. Pings measure the queue of the connection; this
measures the delay before it, in an overloaded bridge or node.
"""

from __future__ import annotations

from collections import deque

SAMPLES = 8
CONTRADICTION_S = 0.1  # so far apart two answers are of one clock no more: it was set, or runs at another pace
IN_TIME_S = 0.5  # stamps that were once so little late are of this clock …
AHEAD_S = 0.1  # … if they are never further ahead


class CarClock:
    """How far the clock of ROS is ahead of ours."""

    def __init__(self) -> None:
        self.epoch = 0  # another one: the clock was set
        self.asked_s: float | None = None  # the newest question that was answered
        self.ahead_s: float | None = None  # at most
        self._samples: deque[tuple[float, float]] = deque(maxlen=SAMPLES)  # ahead at least, at most

    def answered(self, asked_s: float, answered_s: float, car_s: float) -> None:
        """The car's time came."""
        least_s, most_s = car_s - answered_s, car_s - asked_s
        samples = self._samples
        if any(least_s > most + CONTRADICTION_S or most_s < least - CONTRADICTION_S for least, most in samples):
            samples.clear()
            self.epoch += 1
        samples.append((least_s, most_s))
        self.asked_s = asked_s
        self.ahead_s = min(most for _, most in samples)


class StampedDelay:
    """How late the messages of one topic are by the clock of ROS."""

    __slots__ = ("_epoch", "_least_s", "_stamp_s", "_stepped_s")

    def __init__(self) -> None:
        self._epoch = -1
        self._least_s = float("inf")
        self._stamp_s = -float("inf")
        self._stepped_s = -float("inf")

    def late_s(self, stamp_s: float, at_s: float, clock: CarClock) -> float | None:
        """How old a message was when it came; None: its stamps are not known to be of that clock."""
        if stamp_s < self._stamp_s:
            self._stepped_s = at_s
        self._stamp_s = stamp_s
        if clock.ahead_s is None or clock.asked_s is None or clock.asked_s <= self._stepped_s:
            return None
        if self._epoch != clock.epoch:
            self._epoch, self._least_s = clock.epoch, float("inf")
        late_s = at_s - stamp_s + clock.ahead_s
        self._least_s = min(self._least_s, late_s)
        return late_s if -AHEAD_S <= self._least_s <= IN_TIME_S else None

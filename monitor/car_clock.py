"""The car's clock relative to ours: by the stamps of its messages, and by calls for its time.

The stamps show whether the clock jumps, falls behind or runs ahead. Two clocks are never subtracted to get an age. Only
the *change* of their difference, stamp − received, is used: on a healthy car it is constant, less the transport delay
of a message. A step of the difference between two steady intervals is a jump of the car's clock, because Wi-Fi can
delay a message but not advance it. A slowly shrinking difference means increasing delays, or a slow clock. A step back
by less than the message period looks like a delayed message, and counts as lateness.

Calls for its time give the offset of the ROS clock, and by it the delay of messages with a stamp of that clock. The
answer is made between call and reply, so the offset is at most its time less ours at the call, and at least its time
less ours at the reply. The tightest bounds of several calls count. Pings measure the queue of the connection; this
measures the delay before it, in an overloaded bridge or node.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

JUMP_S = 0.5  # smaller steps are normal for drivers and radios
CONFIRMED_BY = 3  # messages in a row: real receivers send single odd stamps
AGREE_WITHIN_S = 0.25
SETTLES_S = 5.0  # the first messages after connecting may have waited long
FOLLOWS = 0.001  # seconds a second: no computer's clock drifts as fast
PACE_AFTER = 10  # so many odd stamps that do not agree are no jump but another pace, as of a replay
PACE, PACE_LEAST_S = 0.4, 0.05  # stamps that gain or lose so much a second are of another pace, as of a replay
SAME_JUMP_S = 3.0  # jumps of several signals within this are one jump of one clock

# Here several nodes write to one topic, each with its own stamps.
MANY_WRITERS = frozenset({"diagnostics", "command"})

SAMPLES = 8
CONTRADICTION_S = 0.1  # answers so far apart are not of one clock: it was set, or runs at another pace
IN_TIME_S = 0.5  # stamps that were once so little late are of this clock …
AHEAD_S = 0.1  # … if they are never further ahead


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockJump:
    """The newest jump of the car's clock."""

    at_s: float  # received
    by_s: float  # ahead positive, back negative
    signals: tuple[str, ...]  # that showed it


class StampFollower:
    """Follows the stamps of one signal."""

    __slots__ = ("_best_s", "_first_s", "_last_s", "_newest_s", "_odd", "_odd_at_s", "_odd_n", "_usual_s", "change_s")

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Another opening of the link, or our own clock went back: all differences are new."""
        self._first_s: float | None = None
        self._last_s = 0.0
        self._newest_s = 0.0  # the latest stamp
        self._best_s = 0.0  # difference of the message that waited least
        self._usual_s = 0.0  # the difference that change is measured from
        self._odd: list[float] = []
        self._odd_at_s = 0.0  # when the first of them came
        self._odd_n = 0
        self.change_s: float | None = None  # the newest difference against the usual one: ahead positive, late negative

    def receive(self, stamp_s: float, at_s: float) -> float | None:
        """One stamp; the size of a jump [s] when this message confirms one, else None."""
        difference_s = stamp_s - at_s
        if self._first_s is None:
            self._first_s, self._newest_s = at_s, stamp_s
            self._last_s, self._best_s, self._usual_s, self.change_s = at_s, difference_s, difference_s, 0.0
            return None
        span_s = max(0.0, at_s - self._last_s)
        self._last_s = at_s
        settles = at_s - self._first_s <= SETTLES_S
        is_ahead = difference_s > self._best_s + JUMP_S and not settles
        is_back = stamp_s < self._newest_s - JUMP_S or (
            # once gone back, a slow signal is soon past its newest stamp again
            bool(self._odd)
            and difference_s < self._best_s - JUMP_S
            and abs(difference_s - self._odd[-1]) <= AGREE_WITHIN_S
        )
        if is_ahead or is_back:
            return self._doubt(stamp_s, difference_s, at_s)
        if self._odd:
            self._odd.clear()
        self._odd_n = 0
        if stamp_s > self._newest_s:
            self._newest_s = stamp_s
        step_s = FOLLOWS * span_s
        self._best_s = max(difference_s, self._best_s - step_s)
        if settles:
            self._usual_s = max(self._usual_s, difference_s)
        else:
            self._usual_s += max(-step_s, min(step_s, difference_s - self._usual_s))
        self.change_s = difference_s - self._usual_s
        return None

    def _doubt(self, stamp_s: float, difference_s: float, at_s: float) -> float | None:
        """Handle an odd stamp: it is a jump once the next ones agree with it and do not drift."""
        if not self._odd:
            self._odd_at_s = at_s
        self._odd_n += 1
        if self._odd and abs(difference_s - self._odd[-1]) > AGREE_WITHIN_S:
            self._odd.clear()
            self._odd_at_s = at_s
        self._odd.append(difference_s)
        if self._odd_n >= PACE_AFTER:
            self._begin_anew(stamp_s, difference_s, keep_usual=True)
            return None
        if len(self._odd) < CONFIRMED_BY:
            return None
        if abs(difference_s - self._odd[0]) > max(PACE * (at_s - self._odd_at_s), PACE_LEAST_S):
            self._begin_anew(stamp_s, difference_s, keep_usual=True)
            return None
        jump_s = difference_s - self._best_s
        self._begin_anew(stamp_s, difference_s, keep_usual=False)
        return jump_s

    def _begin_anew(self, stamp_s: float, difference_s: float, *, keep_usual: bool) -> None:
        self._newest_s, self._best_s = stamp_s, difference_s
        if not keep_usual:
            self._usual_s = difference_s
        self.change_s = difference_s - self._usual_s
        self._odd.clear()
        self._odd_n = 0


def merged(before: ClockJump | None, signal: str, at_s: float, by_s: float) -> ClockJump:
    """Merge the jumps that several signals show into one."""
    if before is not None and 0.0 <= at_s - before.at_s <= SAME_JUMP_S and (before.by_s > 0) == (by_s > 0):
        signals = before.signals if signal in before.signals else (*before.signals, signal)
        return ClockJump(at_s=before.at_s, by_s=before.by_s, signals=signals)
    return ClockJump(at_s=at_s, by_s=by_s, signals=(signal,))


class CarClock:
    """How far the clock of ROS is ahead of ours."""

    def __init__(self) -> None:
        self.epoch = 0  # another one: the clock was set
        self.requested_s: float | None = None  # the time of the newest request that was answered
        self.ahead_s: float | None = None  # at most
        self._samples: deque[tuple[float, float]] = deque(maxlen=SAMPLES)  # ahead at least, at most

    def answered(self, requested_s: float, answered_s: float, car_s: float) -> None:
        """Take the answer to a request for the car's time."""
        least_s, most_s = car_s - answered_s, car_s - requested_s
        samples = self._samples
        if any(least_s > most + CONTRADICTION_S or most_s < least - CONTRADICTION_S for least, most in samples):
            samples.clear()
            self.epoch += 1
        samples.append((least_s, most_s))
        self.requested_s = requested_s
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
        if clock.ahead_s is None or clock.requested_s is None or clock.requested_s <= self._stepped_s:
            return None
        if self._epoch != clock.epoch:
            self._epoch, self._least_s = clock.epoch, float("inf")
        late_s = at_s - stamp_s + clock.ahead_s
        self._least_s = min(self._least_s, late_s)
        return late_s if -AHEAD_S <= self._least_s <= IN_TIME_S else None

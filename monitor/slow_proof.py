"""Whether the car's own speed proves that an order slows it: a change that the order explains.

Before an order the car may cruise, accelerate, brake or coast; that motion continues without the order and proves
nothing. Two models are therefore fitted to the speeds: one change of slope at most, before the order could act; and the
same with one more change after the first command. The order is proven if the second model fits far better than the
noise allows, the car now brakes with a fair share of the ordered deceleration, and its speed is clearly below the
extrapolated one (a likelihood-ratio test for a change of slope, after Quandt, JASA 53, 1958).

A car that reaches standstill to which its former motion would not have led is proven to have stopped.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from monitor.motion import STANDS_BELOW_MPS
from monitor.shell_facts import SlowingFacts
from monitor.speed_fit import BIN_S, Fit, Floats, Line, binned, least_chi2, line, quantum

Shown = Literal["slows", "stopped"]

SHARE = 0.5  # of the ordered deceleration: a real car follows loosely
SHARE_ERRORS = 2.0  # standard errors by which the measured deceleration is above that share
BEFORE_S = 3.0  # of the speeds before the order; a trend and its noise are known well after so long
LEAST_BEFORE_S = 0.4  # with less nothing is known of the motion before
LEAST_BEFORE = 4  # speeds, likewise
NEWEST_BEFORE_S = 1.0  # before the first command the newest of them is no older
REACTS_WITHIN_S = 3.0  # a change that begins later is not explained by the order
SEARCHED_S = 6.0  # after the first command: a proof is searched for so long
LEAST_AFTER = 3  # speeds after the change
SIGMAS = 5.0  # by which the change must stand out …
SIGMAS_AT_FIRST = 6.0  # … and as long as it has lasted no longer than this: a change shortly before looks the same
AT_FIRST_S = 0.6
LEAST_DROP_MPS = 0.15
LEAST_EXTRA_MPS2 = 0.3  # deceleration beyond what was there before …
LEAST_EXTRA_SHARE = 0.35  # … and as a share of the ordered one
LEAST_CHANGED_S = 0.35  # from the change to the newest speed
MOST_UNSURE_S = 0.5
STEPS = 1.5  # quanta of the reported speed that a drop must exceed
NOISE_FLOOR_MPS = 0.01
HARDEST_MPS2 = 8.0  # no car brakes harder: a speed that falls faster is a fault of the sensor
SLACK_MPS = 0.3  # of a single speed, likewise
STOOD_S = 0.3  # at rest for so long
STOPS_WITHIN_S = 2.5  # of the first command; a faster car brakes for longer, and is shown by that
STILL_MOVES_MPS = 0.25  # at this speed the motion before would not have led to standstill
SPANS_S = (
    1.2,
    0.7,
    0.4,
)  # of the speeds before the order that are fitted by themselves: the motion may have changed lately
BEFORE_KNOTS_S = (
    *(2.6 - 0.15 * n for n in range(11)),
    *(1.0 - 0.05 * n for n in range(19)),
)  # a change between two of them must fit well
MOST_SPEEDS = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowProof:
    """The proof of the active order by the speeds."""

    ordered_s: float | None = None  # of which order; None: none is active
    shown: Shown | None = None  # None: nothing that the order explains
    shown_s: float | None = None
    stood_before: bool = False  # the car stood when it was ordered: there was nothing to slow
    is_before_known: bool = True  # False: too few speeds before the first command, so that none after it prove anything


NOTHING_SHOWN = SlowProof()


class ProofFollower:
    """Follows one vehicle's speed and the orders to slow it. Times are on the clock of `received_s`."""

    def __init__(self) -> None:
        self._speeds: deque[tuple[float, float]] = deque(maxlen=MOST_SPEEDS)
        self._ordered_s: float | None = None
        self._since_s: float | None = None  # the first command of the commands that go out without a gap
        self._motion: _Before | None = None
        self._evaluated_s = -math.inf
        self._deceleration_mps2 = 0.0
        self.proof = NOTHING_SHOWN

    def forget(self) -> None:
        """The clock went back: what was measured does not fit what comes."""
        self._speeds.clear()
        self._motion = None
        if self.proof.shown is None and self._ordered_s is not None:
            self.proof = replace(self.proof, is_before_known=False)

    def order(self, facts: SlowingFacts) -> None:
        """What is known of the order now."""
        if facts.ordered_s != self._ordered_s:
            self._ordered_s, self._since_s = facts.ordered_s, None
            self.proof = SlowProof(ordered_s=facts.ordered_s)
        self._deceleration_mps2 = facts.deceleration_mps2
        if facts.ordered_s is None or facts.sending_s is None or facts.sending_s == self._since_s:
            return
        self._since_s, self._evaluated_s = facts.sending_s, -math.inf
        self._motion = _before(list(self._speeds), facts.sending_s)
        if self.proof.shown is not None:
            return
        self.proof = replace(self.proof, is_before_known=self._motion is not None)
        if self._motion is not None:
            self.proof = replace(self.proof, stood_before=abs(self._motion.level_mps) < STANDS_BELOW_MPS)

    def add(self, at_s: float, speed_mps: float) -> None:
        """A speed as the car reports it."""
        if not math.isfinite(speed_mps):
            return
        if self._speeds and at_s < self._speeds[-1][0]:
            return
        self._speeds.append((at_s, speed_mps))
        motion, since_s = self._motion, self._since_s
        if motion is None or since_s is None or self.proof.shown is not None or self.proof.stood_before:
            return
        if not BIN_S <= at_s - max(self._evaluated_s, since_s) or at_s - since_s > SEARCHED_S:
            return
        self._evaluated_s = at_s
        shown = _evaluate(motion, [one for one in self._speeds if one[0] > since_s], since_s, self._deceleration_mps2)
        if shown is not None:
            self.proof = replace(self.proof, shown=shown, shown_s=at_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Before:
    """The motion of the seconds before the first command; times count from it, speeds along the way of the car."""

    sign: float  # −1: it rolled backwards
    times_s: Floats
    speeds_mps: Floats
    lines: tuple[Line, ...]  # through the last seconds, the longest first

    @property
    def level_mps(self) -> float:
        """At the first command."""
        return self.lines[0].level_mps

    def led_mps(self, at_s: float) -> float:
        """Where it led to."""
        return self.lines[0].level_mps + self.lines[0].slope_mps2 * at_s

    def lowest_mps(self, at_s: float) -> float:
        """The lowest to which it may have led."""
        return min(one.lowest_mps(at_s) for one in self.lines)


def _before(speeds: list[tuple[float, float]], since_s: float) -> _Before | None:
    """None: too little is known of it."""
    known = [(at_s - since_s, speed) for at_s, speed in speeds if -BEFORE_S <= at_s - since_s <= 0.0]
    if len(known) < LEAST_BEFORE or known[-1][0] - known[0][0] < LEAST_BEFORE_S or known[-1][0] < -NEWEST_BEFORE_S:
        return None
    times, values = np.array(known).T
    sign = -1.0 if float(np.median(values)) < 0.0 else 1.0
    times, values = binned(times, values * sign)
    if len(times) < LEAST_BEFORE:
        return None
    lines = [line(times, values, NOISE_FLOOR_MPS)]
    for span_s in SPANS_S:
        late = times >= -span_s
        if LEAST_BEFORE <= int(late.sum()) < len(times):
            lines.append(line(times[late], values[late], NOISE_FLOOR_MPS))
    if len(lines) == 1:  # speeds are rare: the newest of them give the recent change of motion
        lines.append(line(times[-LEAST_BEFORE:], values[-LEAST_BEFORE:], NOISE_FLOOR_MPS))
    return _Before(sign=sign, times_s=times, speeds_mps=values, lines=tuple(lines))


def _evaluate(
    motion: _Before, after: list[tuple[float, float]], since_s: float, deceleration_mps2: float
) -> Shown | None:
    if len(after) < LEAST_AFTER:
        return None
    times, values = np.array(after).T
    times, values = times - since_s, values * motion.sign
    step = quantum(motion.speeds_mps, values)
    newest_s = float(times[-1])
    newest_mps = float(values[-LEAST_AFTER:].mean())
    led_mps = motion.led_mps(float(times[-LEAST_AFTER:].mean()))
    if led_mps - newest_mps < max(LEAST_DROP_MPS, STEPS * step):
        return None
    if _falls_too_fast(motion, times, values, step):
        return None
    if _stopped(motion, times, values, step):
        return "stopped"
    standing = np.flatnonzero(values < 2 * STANDS_BELOW_MPS)
    until = int(standing[0]) if len(standing) else len(values)
    if until < LEAST_AFTER or newest_s > SEARCHED_S:
        return None
    times, values = binned(times[:until], values[:until])
    return "slows" if _slows(motion, times, values, step, deceleration_mps2) else None


def _falls_too_fast(motion: _Before, times: Floats, values: Floats, step: float) -> bool:
    all_times = np.append(motion.times_s[-1:], times)
    all_values = np.append(motion.speeds_mps[-1:], values)
    falls = -np.diff(all_values)
    slack_mps = SLACK_MPS + 2 * step + 6 * motion.lines[0].sigma_mps
    return bool((falls > HARDEST_MPS2 * np.diff(all_times) + slack_mps).any())


def _stopped(motion: _Before, times: Floats, values: Floats, step: float) -> bool:
    """The newest speeds are those of a standing car, and the motion before did not lead there."""
    newest_s = float(times[-1])
    last = values[times >= newest_s - STOOD_S]
    if newest_s < STOOD_S or len(last) < LEAST_AFTER or len(values) <= len(last):
        return False
    if abs(float(last.mean())) > STANDS_BELOW_MPS or float(np.abs(last).max()) > 4 * STANDS_BELOW_MPS:
        return False
    return newest_s <= STOPS_WITHIN_S and motion.lowest_mps(newest_s) > STILL_MOVES_MPS + step


def _slows(motion: _Before, times: Floats, values: Floats, step: float, deceleration_mps2: float) -> bool:
    changes = _changes(times) if len(times) >= LEAST_AFTER else times[:0]
    if not len(changes):
        return False
    all_times, all_values = np.append(motion.times_s, times), np.append(motion.speeds_mps, values)
    early = np.array([one for one in BEFORE_KNOTS_S if int((motion.times_s < -one).sum()) >= 2])
    fit = Fit.of(all_times, all_values, early, changes)
    sigma = math.sqrt(fit.rest_with / least_chi2(max(1, len(all_times) - 4)))
    sigma = max(NOISE_FLOOR_MPS, step / math.sqrt(12.0), sigma)
    rate_hz = len(all_times) / float(all_times[-1] - all_times[0])
    # Within this a change before the order looks like one after it.
    unsure_s = (6 * sigma / math.sqrt(rate_hz) + STEPS * step) / deceleration_mps2
    unsure_s = min(MOST_UNSURE_S, max(BEFORE_KNOTS_S[-1], unsure_s))
    sigmas = SIGMAS if float(times[-1]) - fit.changed_s > AT_FIRST_S else SIGMAS_AT_FIRST
    if fit.rest_without(unsure_s) - fit.rest_with < (sigmas * sigma) ** 2:
        return False
    extra_mps2, slope_mps2 = fit.slopes()
    least_mps2 = max(LEAST_EXTRA_MPS2, LEAST_EXTRA_SHARE * deceleration_mps2)
    if extra_mps2 > -least_mps2 or slope_mps2 > -SHARE * deceleration_mps2:
        return False
    is_since = times >= fit.changed_s
    since = times[is_since]
    if line(since, values[is_since], NOISE_FLOOR_MPS).slope_mps2 > -least_mps2:
        return (
            False  # a motion that changed more often before than the fit allows: by themselves the speeds do not fall
        )
    lasted_s = float(times[-1]) - fit.changed_s
    error_mps2 = sigma / math.sqrt(float(((since - since.mean()) ** 2).sum())) + step / (2 * lasted_s)
    drop_mps = -slope_mps2 * lasted_s
    if -slope_mps2 - SHARE_ERRORS * error_mps2 < SHARE * deceleration_mps2:
        return False  # it may brake with less than its share, or only have stopped accelerating
    return drop_mps >= max(LEAST_DROP_MPS, STEPS * step) and -slope_mps2 - 3 * error_mps2 > least_mps2


def _changes(times: Floats) -> Floats:
    """The times at which the order may have started to act."""
    last_s = min(float(times[-LEAST_AFTER]), float(times[-1]) - LEAST_CHANGED_S, REACTS_WITHIN_S)
    return np.linspace(0.0, last_s, min(16, 2 + int(last_s / 0.08))) if last_s > 0.0 else np.empty(0)

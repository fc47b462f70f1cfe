"""By how much an agent's clock is ahead of the node's: at most, by which a frame that was held up, or not pulled, is no
older than stated, and likely, from which the time of an order counts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

SLEWS = 0.1  # a clock, by so much: chrony by 0.083 at most
DRIFT = 1e-3  # of two monotonic clocks that are not slewed otherwise: each by 500 ppm, as the kernel corrects it
ROUNDING_S = 0.01  # of a comparison of two clocks


def slewed_s() -> float:
    """By how much the monotonic clock of this system was slewed, in seconds since an arbitrary moment."""
    return time.clock_gettime(time.CLOCK_MONOTONIC) - time.clock_gettime(time.CLOCK_MONOTONIC_RAW)


class Steady:
    """Whether a monotonic clock ran evenly since it was noted. `slewed` answers as `slewed_s`."""

    def __init__(self, slewed: Callable[[], float] = slewed_s) -> None:
        self._slewed = slewed
        self._at_s = self._slewed_s = 0.0

    def note(self, now_s: float) -> None:
        self._at_s, self._slewed_s = now_s, self._slewed()

    def is_steady(self, now_s: float) -> bool:
        return abs(self._slewed() - self._slewed_s) <= ROUNDING_S + DRIFT / 2 * (now_s - self._at_s)


class AgentAhead:
    """Of one run of an agent. Times are of monotonic clocks, in seconds: `agent_s` of the agent's, others of ours."""

    def __init__(self, steady: Steady | None = None) -> None:
        self._steady = steady or Steady()
        self._most_s = math.inf
        self._at_s = 0.0

    def answered(self, requested_s: float, agent_s: float, now_s: float) -> None:
        """What was sent at `requested_s` reached the agent by `agent_s`."""
        most_s = agent_s - requested_s + SLEWS * (now_s - requested_s)
        self._most_s = min(most_s, self._most_s + SLEWS * (now_s - self._at_s))
        self._at_s = now_s
        self._steady.note(now_s)

    def received(self, agent_s: float, now_s: float) -> None:
        """What the agent sent at `agent_s` is here. Where it would have come before that, a clock stood still."""
        if agent_s - now_s > self._most_s + SLEWS * (now_s - self._at_s):
            self._most_s = math.inf

    def earliest(self, agent_s: float, now_s: float) -> float:
        """When the agent's clock showed `agent_s`, no later than it was; -inf where that is not known.

        No clock is slewed between an answer and now, other than by `DRIFT`, if the agent's is steady as well.
        """
        if now_s > self._at_s and not self._steady.is_steady(now_s):
            return -math.inf
        return agent_s - self._most_s - (DRIFT * (now_s - self._at_s) + ROUNDING_S if now_s > self._at_s else 0.0)


class LikelyAhead:
    """Of one run of an agent, with times as those of `AgentAhead`: where the least way there takes as long as the least
    way back. Both count for as long as no clock is slewed by more than `DRIFT`."""

    def __init__(self) -> None:
        self._least_s, self._most_s = -math.inf, math.inf
        self._at_s = 0.0

    def answered(self, requested_s: float, reached_s: float, sent_s: float, now_s: float) -> None:
        """What was sent at `requested_s` reached the agent at `reached_s` of its clock, and its answer of `sent_s` is
        here."""
        drift_s = DRIFT * (now_s - self._at_s)
        least_s, most_s = self._least_s - drift_s, self._most_s + drift_s
        at_least_s, at_most_s = sent_s - now_s, reached_s - requested_s
        if at_least_s > most_s or at_most_s < least_s:  # a clock was slewed, or stood still
            least_s, most_s = -math.inf, math.inf
        self._least_s, self._most_s = max(least_s, at_least_s), min(most_s, at_most_s)
        self._at_s = now_s

    def when(self, agent_s: float) -> float:
        """When the agent's clock showed `agent_s`; after an answer."""
        return agent_s - (self._least_s + self._most_s) / 2

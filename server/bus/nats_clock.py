"""The offset of an agent's clock from the node's: its upper bound and its likely value.

By the bound no frame is shown younger than it is, also one that was held up or not pulled. The age of an order counts
from the likely value.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable

SLEWS = 0.1  # a clock, by so much: chrony by 0.083 at most
DRIFT = 1e-3  # of two monotonic clocks that are not slewed otherwise: each by 500 ppm, as the kernel corrects it
ROUNDING_S = 0.01  # of a comparison of two clocks
LIKELY_FROM = 50  # answers: 8 s over a bad radio; by fewer the jitter counts, by more a slew counts for longer


def slewed_s() -> float:
    """By how much the monotonic clock of this system was slewed, in seconds since an arbitrary moment."""
    return time.clock_gettime(time.CLOCK_MONOTONIC) - time.clock_gettime(time.CLOCK_MONOTONIC_RAW)


class Steady:
    """Whether a monotonic clock ran evenly since it was noted. `slewed` answers as `slewed_s`."""

    def __init__(self, slewed: Callable[[], float] = slewed_s) -> None:
        self._slewed = slewed
        self.at_s = self._slewed_s = 0.0

    def note(self, now_s: float) -> None:
        self.at_s, self._slewed_s = now_s, self._slewed()

    def is_steady(self, now_s: float) -> bool:
        return abs(self._slewed() - self._slewed_s) <= ROUNDING_S + DRIFT / 2 * (now_s - self.at_s)


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
    """The likely offset of the clock of one run of an agent, with times as those of `AgentAhead`.

    It is exact where the least delay to the agent and the least delay back are equal. Only the last `LIKELY_FROM`
    answers count: a slew or a pause of less than a round trip contradicts none of the earlier ones.
    """

    def __init__(self) -> None:
        self._bounds_s: deque[tuple[float, float]] = deque(maxlen=LIKELY_FROM)  # of the offset, by each answer

    def answered(self, requested_s: float, reached_s: float, sent_s: float, now_s: float) -> None:
        """Count an answer of `sent_s` that is here, to a request that reached the agent at `reached_s` of its clock."""
        least_s, most_s = self._within_s()
        at_least_s, at_most_s = sent_s - now_s, reached_s - requested_s
        if at_least_s > most_s or at_most_s < least_s:  # a clock was slewed, or stood still
            self._bounds_s.clear()
        self._bounds_s.append((at_least_s, at_most_s))

    def when(self, agent_s: float) -> float:
        """Return when the agent's clock showed `agent_s`; after an answer."""
        return agent_s - sum(self._within_s()) / 2

    def _within_s(self) -> tuple[float, float]:
        return (
            max((least_s for least_s, _ in self._bounds_s), default=-math.inf),
            min((most_s for _, most_s in self._bounds_s), default=math.inf),
        )

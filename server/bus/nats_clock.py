"""By how much an agent's clock is ahead of the node's, at most: how old a frame is that nobody requested."""

from __future__ import annotations

import math

DRIFT = 5e-4  # of two monotonic clocks: as much as a system slews one


class AgentAhead:
    """Of one run of an agent. Times are of monotonic clocks, in seconds: `agent_s` of the agent's, others of ours."""

    def __init__(self) -> None:
        self._most_s = math.inf
        self._at_s = 0.0

    def answered(self, asked_s: float, agent_s: float, now_s: float) -> None:
        """What was sent at `asked_s` reached the agent by `agent_s`."""
        most_s = agent_s - asked_s
        if most_s <= self._most(now_s):
            self._most_s, self._at_s = most_s, now_s

    def received(self, agent_s: float, now_s: float) -> None:
        """What the agent sent at `agent_s` is here. Where it would have come before that, a clock stood still."""
        if agent_s - now_s > self._most(now_s):
            self._most_s = math.inf

    def earliest(self, agent_s: float, now_s: float) -> float:
        """When the agent's clock showed `agent_s`, no later than it was; -inf where that is not known."""
        return agent_s - self._most(now_s)

    def _most(self, now_s: float) -> float:
        return self._most_s + DRIFT * (now_s - self._at_s)

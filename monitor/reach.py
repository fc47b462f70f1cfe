"""Whether an alarm would reach an operator; the shell fills it, the check reads it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachFacts:
    """How many operators can hear alarms at one moment."""

    can: int = 0  # operators who have a phone that would sound an alarm now
    of: int = 0  # operators whose phones are known
    why: str = ""  # why those who cannot, cannot: a few words; "": nobody is known, or all can

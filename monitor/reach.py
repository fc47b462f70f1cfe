"""Whether an alarm would reach an operator; the shell fills it, the check reads it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachFacts:
    """The number of operators that can hear alarms now."""

    can: int = 0  # operators who have a phone that would sound an alarm now
    of: int = 0  # operators whose phones are known
    why: str = ""  # why the others cannot, in short; "": no operator, or all can

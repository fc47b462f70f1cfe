"""Messages that come and cannot be used: not a number, out of range, of another shape. That is no silence."""

from __future__ import annotations

from dataclasses import dataclass

NOT_A_NUMBER = " is not a number"


@dataclass(frozen=True, slots=True, kw_only=True)
class Unusable:
    """The newest messages of a signal, none of which could be used."""

    reason: str  # of the newest one
    at_s: float  # when the newest one came
    since_s: float  # when the first one in a row came
    count: int  # in a row
    horizon_s: float  # a silence of this signal longer than that is one
    period_s: float | None = None

    @property
    def words(self) -> str:
        """The reason as it follows the name of the signal: "not a number (linear.x)"."""
        field, is_not, rest = self.reason.partition(NOT_A_NUMBER)
        return f"not a number ({field})" if is_not and not rest else self.reason

    def is_coming(self, now_s: float) -> bool:
        return now_s - self.at_s <= self.horizon_s

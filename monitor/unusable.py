"""Messages that come without a value: not a number, out of range, of another shape, or by their own definition not
measured. That is no silence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

NOT_A_NUMBER = " is not a number"


@dataclass(frozen=True, slots=True, kw_only=True)
class Unusable:
    """The newest messages of a signal, none of which could be used."""

    reason: str  # of the newest one; of the newest wrong one, as long as such come
    at_s: float  # when the newest one came, wrong or declared
    since_s: float  # when the first one in a row came
    count: int  # in a row; of the wrong ones alone, as long as such come
    horizon_s: float  # a silence of this signal longer than that is one
    period_s: float | None = None
    is_declared: bool = False  # they declare the value as not measured, none of late is wrong: no fault of the sensor
    wrong_s: float | None = None  # when the newest wrong one came, where declared ones came after it

    @property
    def text(self) -> str:
        """The reason as it follows the name of the signal: "not a number (linear.x)"."""
        field, is_not, rest = self.reason.partition(NOT_A_NUMBER)
        return f"not a number ({field})" if is_not and not rest else self.reason

    def is_coming(self, now_s: float) -> bool:
        return now_s - self.at_s <= self.horizon_s


def refused(
    before: Mapping[str, Unusable],
    signal: str,
    reason: str,
    at_s: float,
    horizon_s: float,
    period_s: float | None,
    *,
    is_declared: bool = False,
) -> Mapping[str, Unusable]:
    """The unusable signals after one more message of `signal` without a value."""
    known = before.get(signal)
    if known is not None and known.is_declared != is_declared:
        wrong_s = known.at_s if known.wrong_s is None else known.wrong_s
        if is_declared and at_s - wrong_s <= horizon_s:
            now = replace(known, at_s=at_s, horizon_s=horizon_s, period_s=period_s, wrong_s=wrong_s)
            return MappingProxyType({**before, signal: now})
        known = None
    now = Unusable(
        reason=reason,
        at_s=at_s,
        since_s=at_s if known is None else known.since_s,
        count=1 if known is None else known.count + 1,
        horizon_s=horizon_s,
        period_s=period_s,
        is_declared=is_declared,
    )
    return MappingProxyType({**before, signal: now})


def without(before: Mapping[str, Unusable], signal: str) -> Mapping[str, Unusable]:
    """The unusable signals after a usable message of `signal`."""
    return MappingProxyType({name: one for name, one in before.items() if name != signal})

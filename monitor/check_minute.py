"""The last minute of every check: what it measured against which limit, and since when it answers as it does.

Bounded: a ring of one minute for each check that ever measured. Looked at once in each step; what a check found between
two looks is in its alarm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from monitor.check import Finding, Verdict
from monitor.trends import SPAN, STEP_S


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckCourse:
    """One check's last minute, the oldest step first; None: not checked then, or nothing measured."""

    since_s: float | None  # when it began to answer as it does now; None: it has not answered
    values: tuple[float | None, ...]
    limits: tuple[float | None, ...]


class _Ring:
    """Values and limits of one check by step; NaN: none."""

    __slots__ = ("limits", "values")

    def __init__(self) -> None:
        self.values = [math.nan] * SPAN
        self.limits = [math.nan] * SPAN


class CheckMinute:
    """All times are seconds of one monotonic clock."""

    def __init__(self) -> None:
        self._rings: dict[str, _Ring] = {}
        self._since: dict[str, tuple[Verdict, float]] = {}
        self._step: int | None = None  # the newest that was looked at
        self._first = 0

    def note(self, findings: Mapping[str, Finding], now_s: float) -> None:
        """Look at what the checks found, once in a step."""
        step = math.floor(now_s / STEP_S)
        if step == self._step:
            return
        self._skip_to(step)
        place = step % SPAN
        for name, finding in findings.items():
            before = self._since.get(name)
            if before is None or before[0] is not finding.verdict:
                self._since[name] = (finding.verdict, now_s)
            measured = finding.measured
            if measured is None or finding.verdict is Verdict.UNKNOWN:
                continue
            ring = self._rings.get(name)
            if ring is None:
                ring = self._rings[name] = _Ring()
            ring.values[place] = measured.value
            ring.limits[place] = math.nan if finding.limit is None else finding.limit.value

    def _skip_to(self, step: int) -> None:
        """Empty the places of the steps since the newest one; all where the clock went back or a minute was missed."""
        newest = self._step
        self._step = step
        if newest is None or step < newest or step - newest >= SPAN:
            self._rings.clear()
            self._first = step
            return
        for ring in self._rings.values():
            for missed in range(newest + 1, step + 1):
                ring.values[missed % SPAN] = ring.limits[missed % SPAN] = math.nan

    def course(self, name: str) -> CheckCourse:
        """The steps of one check."""
        since = self._since.get(name)
        ring, newest = self._rings.get(name), self._step
        if ring is None or newest is None:
            return CheckCourse(since_s=since[1] if since else None, values=(), limits=())
        steps = range(max(self._first, newest - SPAN + 1), newest + 1)
        return CheckCourse(
            since_s=since[1] if since else None,
            values=tuple(_number(ring.values[step % SPAN]) for step in steps),
            limits=tuple(_number(ring.limits[step % SPAN]) for step in steps),
        )


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None

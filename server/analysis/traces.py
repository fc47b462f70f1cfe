"""A run over time: every signal's numbers, what the checks measured against which limit, and the state of each tile of
the home tab."""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from monitor.alarm_spec import Priority
from monitor.check import Verdict
from monitor.geo import Plane
from monitor.runner import Monitor
from monitor.signals import SIGNALS
from monitor.state import Reading
from monitor.values import GpsFix

MOST_POINTS = 12_000  # of one curve: beyond that the lowest and the highest of each stretch stand for the rest
NOT_DRAWN = ("s", "Hz")  # ages and rates: the alarm bars say it better, and of every signal they would be many
GAP_PERIODS = 10
GAP_FLOOR_S = 1.0


@dataclass(slots=True)
class Series:
    """Numbers over time, in the order of time."""

    at_s: array[float] = field(default_factory=lambda: array("d"))
    values: array[float] = field(default_factory=lambda: array("d"))

    def add(self, at_s: float, value: float) -> None:
        self.at_s.append(at_s)
        self.values.append(value)

    def points(self) -> list[tuple[float, float | None]]:
        """As drawn: thinned where they are too many, with a None where nothing came for long."""
        if len(self.at_s) > MOST_POINTS:
            return _with_gaps(_extremes(self.at_s, self.values))
        return _with_gaps(list(zip(self.at_s, self.values, strict=True)))


@dataclass(slots=True)
class Measure:
    """What one check measured and allowed, tick by tick, where it measures a quantity."""

    check_id: str
    title: str
    label: str  # of what is measured
    unit: str
    needs: frozenset[str]
    measured: Series = field(default_factory=Series)
    allowed: Series = field(default_factory=Series)


class Traces:
    """Collects while a recording is judged."""

    def __init__(self) -> None:
        self.signals: dict[str, Series] = {}
        self.measures: dict[str, Measure] = {}
        self.track: list[tuple[float, float, float, float | None]] = []  # s, east m, north m, stated sigma m
        self._plane: Plane | None = None
        self._headlines = {name: signal.headline for name, signal in SIGNALS.items()}

    def take(self, changed: Iterable[str], reading: Callable[[str], Reading[Any] | None], now_s: float) -> None:
        """Record the values that a message changed."""
        for signal in changed:
            found = reading(signal)
            if found is None:
                continue
            value = found.value
            if isinstance(value, GpsFix):
                self._fix(value, now_s)
            headline = self._headlines[signal]
            number = None if headline is None else getattr(value, headline, None)
            if headline is not None:
                series = self.signals.get(signal)
                if series is None:
                    series = self.signals[signal] = Series()
                series.add(now_s, math.nan if number is None else float(number))

    def judged(self, monitor: Monitor, now_s: float) -> None:
        """Record the findings of all checks at a tick."""
        for check in monitor.checks:
            finding = monitor.findings.get(check.id)
            if finding is None or (finding.measured is None and finding.limit is None):
                continue
            quantity = finding.measured or finding.limit
            assert quantity is not None
            if quantity.unit in NOT_DRAWN:
                continue
            measure = self.measures.get(check.id)
            if measure is None:
                measure = self.measures[check.id] = Measure(
                    check_id=check.id,
                    title=check.label,
                    label=quantity.label,
                    unit=quantity.unit,
                    needs=check.needs,
                )
            if finding.measured is not None:
                measure.measured.add(now_s, finding.measured.value)
            if finding.limit is not None:
                measure.allowed.add(now_s, finding.limit.value)

    def _fix(self, fix: GpsFix, now_s: float) -> None:
        if fix.status < 0 or not (math.isfinite(fix.lat_deg) and math.isfinite(fix.lon_deg)):
            return
        if self._plane is None:
            self._plane = Plane(fix.lat_deg, fix.lon_deg)
        east_m, north_m = self._plane.enu(fix.lat_deg, fix.lon_deg)
        self.track.append((now_s, east_m, north_m, fix.sigma_m))


def _extremes(at_s: array[float], values: array[float]) -> list[tuple[float, float]]:
    """Each stretch's lowest and highest, so that no peak is lost. An hour has a quarter of a million numbers: they are
    not made pairs of before it is known which are kept."""
    stretch = math.ceil(2 * len(at_s) / MOST_POINTS)
    kept: list[tuple[float, float]] = []
    for begin in range(0, len(at_s), stretch):
        part = range(begin, min(begin + stretch, len(at_s)))
        known = [index for index in part if not math.isnan(values[index])]
        if not known:
            kept.append((at_s[begin], values[begin]))
            continue
        low, high = min(known, key=values.__getitem__), max(known, key=values.__getitem__)
        kept += sorted({(at_s[low], values[low]), (at_s[high], values[high])})
    return kept


def _with_gaps(pairs: list[tuple[float, float]]) -> list[tuple[float, float | None]]:
    steps = sorted(b[0] - a[0] for a, b in pairwise(pairs))
    usual_s = steps[len(steps) // 2] if steps else 0.0
    gap_s = max(GAP_FLOOR_S, GAP_PERIODS * usual_s)
    points: list[tuple[float, float | None]] = []
    for at_s, value in pairs:
        if points and at_s - points[-1][0] > gap_s:
            points.append((points[-1][0] + usual_s, None))
        points.append((at_s, value if math.isfinite(value) else None))
    return points


@dataclass(slots=True)
class CheckTimeline:
    """One tile over one run. Times are seconds since the beginning of the recording."""

    label: str
    priority: Priority  # of the most urgent alarm among its checks
    spans: list[tuple[float, float, Verdict, str]] = field(default_factory=list)  # from, to, verdict, text

    def seconds(self, verdict: Verdict) -> float:
        return sum(to_s - from_s for from_s, to_s, found, _ in self.spans if found is verdict)

    @property
    def why_not(self) -> str:
        """Why it could not be checked, the reason that lasted longest; "" where it always could."""
        reasons: Counter[str] = Counter()
        for from_s, to_s, found, text in self.spans:
            if found is Verdict.UNKNOWN:
                reasons[text] += max(to_s - from_s, 1e-9)  # type: ignore[assignment]
        return max(reasons, key=lambda text: reasons[text], default="")


class CheckTimelines:
    """The timelines of all tiles, sampled about once a second; the alarms have their own exact times."""

    def __init__(self) -> None:
        self._by_label: dict[str, CheckTimeline] = {}

    def sample(self, monitor: Monitor, now_s: float) -> None:
        for tile in monitor.tiles():
            timeline = self._by_label.get(tile.label)
            if timeline is None:
                priorities = [monitor.alarms[check_id].spec.priority for check_id in tile.checks]
                priority = min(priorities, key=lambda priority: priority.rank)
                timeline = self._by_label[tile.label] = CheckTimeline(label=tile.label, priority=priority)
            # The text of an OK changes with every number; only the reason of an unchecked tile is kept.
            text = tile.text if tile.verdict is not Verdict.OK else ""
            spans = timeline.spans
            if spans:
                from_s, _, verdict, before = spans[-1]
                if verdict is tile.verdict and (before == text or verdict is Verdict.FAULT):
                    continue  # its end is reported when something else begins
                spans[-1] = (from_s, now_s, verdict, before)
            spans.append((now_s, now_s, tile.verdict, text))

    def finish(self, end_s: float) -> tuple[CheckTimeline, ...]:
        for timeline in self._by_label.values():
            from_s, _, verdict, text = timeline.spans[-1]
            timeline.spans[-1] = (from_s, max(from_s, end_s), verdict, text)
        return tuple(self._by_label.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Unchecked:
    """A check that never had a result, so that the absence of its alarm proves nothing."""

    check_id: str
    label: str
    why: str


class Coverage:
    """Which checks ever had a result; sampled like the timelines."""

    def __init__(self) -> None:
        self._answered: set[str] = set()
        self._idle: set[str] = set()  # with nothing to check here: what is optional and not there is no gap
        self._reasons: dict[str, Counter[str]] = {}

    def sample(self, monitor: Monitor) -> None:
        for check_id, finding in monitor.findings.items():
            if check_id in self._answered:
                continue
            if finding.verdict is not Verdict.UNKNOWN:
                self._answered.add(check_id)
            elif not finding.applies:
                self._idle.add(check_id)
            else:
                self._reasons.setdefault(check_id, Counter())[finding.text] += 1

    def unchecked(self, monitor: Monitor) -> tuple[Unchecked, ...]:
        return tuple(
            Unchecked(check_id=check.id, label=check.label, why=self._reasons[check.id].most_common(1)[0][0])
            for check in monitor.checks
            if check.id in self._reasons and check.id not in self._answered | self._idle
        )

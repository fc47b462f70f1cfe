"""The state of each tile of the home tab over time: OK, fault, or not checked with a reason."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from monitor.alarm_spec import Priority
from monitor.check import Verdict
from monitor.runner import Monitor


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

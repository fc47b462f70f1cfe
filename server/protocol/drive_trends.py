"""The answer to a request for the trends of the whole drive, as docs/protocol.md has it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from typing_extensions import TypedDict

from monitor.alarm import AlarmMark
from monitor.alarm_spec import Priority
from monitor.drive_trends import DriveTrends, Span
from monitor.signals import CHARTED, SIGNALS
from server.protocol.doc import doc

MOST_SIGNALS = 4
LEAST_BUCKETS = 10
MOST_BUCKETS = 600
MOST_MARKS = 100
_DIGITS = 5


class TrendOffer(TypedDict):
    """A signal that can be drawn."""

    label: str
    unit: str
    has_data: Annotated[bool, doc("a message of it came in this drive")]


class DriveTrend(TypedDict):
    """One signal of the drive in buckets."""

    lowest: Annotated[list[float | None], doc("of each bucket; null: no number in it")]
    highest: list[float | None]
    gaps: Annotated[list[tuple[float, float]], doc("from and to, where no message of it came")]
    none: Annotated[list[tuple[float, float]], doc("from and to, where messages had no number: nothing in range")]
    limits: Annotated[list[tuple[float, float]], doc("from when on which threshold stood beside it")]


class TrendMark(TypedDict):
    """An announcement of an alarm."""

    at_s: float
    alarm: str
    title: str
    priority: Priority


class DriveTrendsAnswer(TypedDict):
    """`GET /api/trends/drive`. Times are seconds since the drive began."""

    start_ms: Annotated[int, doc("when the drive began, in ms since 1970")]
    length_s: Annotated[float, doc("of the drive until now, or of the recording")]
    known_s: Annotated[float, doc("up to here the server has read it: less than the length while it reads a recording")]
    is_sketch: Annotated[bool, doc("the buckets are those of the sketch, until the recording is read")]
    from_s: Annotated[float, doc("the beginning of the first bucket")]
    step_s: Annotated[float, doc("the width of a bucket")]
    signals: dict[str, DriveTrend]
    offered: Annotated[dict[str, TrendOffer], doc("all that can be drawn")]
    blind: Annotated[list[tuple[float, float]], doc("from and to, where no message of any signal came")]
    marks: Annotated[list[TrendMark], doc("of the part that is answered; at most 100, the most urgent")]
    marks_left_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Which part of the drive; `to_s` infinite: up to its end."""

    signals: tuple[str, ...] = tuple(CHARTED)
    from_s: float = 0.0
    to_s: float = math.inf
    buckets: int = 300

    @staticmethod
    def of(message: Mapping[str, Any]) -> Wanted:
        """As the route passes it on; what is no signal is left out."""
        to_s = message.get("to_s")
        return Wanted(
            signals=tuple(name for name in message.get("signals", ()) if name in CHARTED),
            from_s=float(message.get("from_s", 0.0)),
            to_s=math.inf if to_s is None else float(to_s),
            buckets=int(message.get("buckets", 300)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveFacts:
    """What an answer has besides the trends. `now_s` and the marks are on the clock of the trends."""

    now_s: float
    start_ms: int
    length_s: float
    marks: Iterable[AlarmMark] = field(default_factory=tuple)
    marks_left_out: int = 0


def answer(trends: DriveTrends, wanted: Wanted, facts: DriveFacts) -> DriveTrendsAnswer:
    """A part of a drive."""
    known_s = max(0.0, facts.now_s - trends.since_s)
    to_s = min(wanted.to_s, facts.length_s)
    view = trends.view(wanted.signals, wanted.from_s, to_s, wanted.buckets, facts.now_s)
    signals: dict[str, DriveTrend] = {
        name: {
            "lowest": _numbers(course.lowest),
            "highest": _numbers(course.highest),
            "gaps": _spans(course.gaps),
            "none": _spans(course.none),
            "limits": [(round(at_s, 2), value) for at_s, value in trends.limits(name)],
        }
        for name, course in view.courses.items()
    }
    marks, left_out = marks_between(facts.marks, trends.since_s, wanted.from_s, to_s)
    return {
        "start_ms": facts.start_ms,
        "length_s": round(facts.length_s, 3),
        "known_s": round(min(known_s, facts.length_s), 3),
        "is_sketch": False,
        "from_s": view.from_s,
        "step_s": view.step_s,
        "signals": signals,
        "offered": offered(trends),
        "blind": _spans(view.blind),
        "marks": marks,
        "marks_left_out": left_out + facts.marks_left_out,
    }


def of_sketch(sketch: DriveTrendsAnswer, trends: DriveTrends, wanted: Wanted, facts: DriveFacts) -> DriveTrendsAnswer:
    """A part of a drive as its sketch has it, with the limits of `trends` and the marks that are known so far."""
    step_s, length_s = sketch["step_s"], facts.length_s
    to_s = min(wanted.to_s, length_s)
    first, end = math.floor(wanted.from_s / step_s), math.ceil(to_s / step_s)

    def part(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
        return [span for span in spans if span[1] > wanted.from_s and span[0] < to_s]

    signals: dict[str, DriveTrend] = {}
    for name in wanted.signals:
        one = sketch["signals"].get(name)
        signals[name] = {
            "lowest": one["lowest"][first:end] if one is not None else [],
            "highest": one["highest"][first:end] if one is not None else [],
            "gaps": part(one["gaps"]) if one is not None else [],
            "none": part(one["none"]) if one is not None else [],
            "limits": [(round(at_s, 2), value) for at_s, value in trends.limits(name)],
        }
    marks, left_out = marks_between(facts.marks, 0.0, wanted.from_s, to_s)
    return {
        **sketch,
        "length_s": round(length_s, 3),
        "known_s": round(facts.now_s, 3),
        "is_sketch": True,
        "from_s": first * step_s,
        "signals": signals,
        "blind": part(sketch["blind"]),
        "marks": marks,
        "marks_left_out": left_out + facts.marks_left_out,
    }


def offered(trends: DriveTrends) -> dict[str, TrendOffer]:
    """Every signal that is one number."""
    found: dict[str, TrendOffer] = {}
    for name in CHARTED:
        signal = SIGNALS[name]
        label, unit = (signal.chart.label, signal.chart.unit) if signal.chart else (signal.label, signal.unit)
        found[name] = {"label": label, "unit": unit, "has_data": trends.has_data(name)}
    return found


def marks_between(
    marks: Iterable[AlarmMark], since_s: float, from_s: float, to_s: float
) -> tuple[list[TrendMark], int]:
    """The most urgent marks of a part of the drive in the order of time, and how many more there are."""
    inside = [mark for mark in marks if from_s <= mark.at_s - since_s <= to_s]
    kept = sorted(inside, key=lambda mark: (mark.priority.rank, mark.at_s))[:MOST_MARKS]
    shown: list[TrendMark] = [
        {
            "at_s": round(mark.at_s - since_s, 2),
            "alarm": mark.alarm,
            "title": mark.title,
            "priority": mark.priority,
        }
        for mark in sorted(kept, key=lambda mark: mark.at_s)
    ]
    return shown, len(inside) - len(kept)


def _numbers(numbers: Sequence[float | None]) -> list[float | None]:
    return [None if number is None else float(f"{number:.{_DIGITS}g}") for number in numbers]


def _spans(spans: Sequence[Span]) -> list[tuple[float, float]]:
    return [(round(a, 2), round(b, 2)) for a, b in spans]

"""The curves of the page, chosen by signal and independent of the particular checks."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from monitor.signals import SIGNALS
from server.analysis.traces import Measure, Series, Traces

Ink = Literal["ink", "ink2", "order", "you"]
_SAME_OF = 0.8  # so many of a check's numbers must be the signal's own for its limit to belong to that curve


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One signal in one panel."""

    signal: str
    label: str
    ink: Ink = "ink"


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """Signals of one unit over time."""

    title: str
    unit: str
    digits: int
    curves: tuple[Curve, ...]


_PANELS = (
    Panel(
        title="Speed",
        unit="m/s",
        digits=2,
        curves=(Curve(signal="command", label="ordered", ink="order"), Curve(signal="speed", label="speed")),
    ),
    Panel(
        title="Distance ahead",
        unit="m",
        digits=1,
        curves=(Curve(signal="scan", label="laser, all round", ink="ink2"), Curve(signal="distance", label="nearest")),
    ),
    Panel(
        title="Acceleration",
        unit="m/s²",
        digits=2,
        curves=(Curve(signal="acceleration", label="acceleration"),),
    ),
    Panel(
        title="Pedals",
        unit="%",
        digits=1,
        curves=(Curve(signal="accelerator", label="accelerator", ink="ink2"), Curve(signal="brake", label="brake")),
    ),
    Panel(title="Steering", unit="%", digits=1, curves=(Curve(signal="steering", label="steering"),)),
    Panel(title="Heading", unit="°", digits=0, curves=(Curve(signal="heading", label="heading"),)),
    Panel(title="Diagnostics, worst level", unit="", digits=0, curves=(Curve(signal="diagnostics", label="level"),)),
)
_DRAWN = frozenset(curve.signal for panel in _PANELS for curve in panel.curves)
# A signal whose last minute is kept for Home has a panel of its own where none above shows it.
PANELS = (
    *_PANELS,
    *(
        Panel(title=signal.label, unit=signal.unit, digits=2, curves=(Curve(signal=name, label=signal.label.lower()),))
        for name, signal in SIGNALS.items()
        if signal.trend and name not in _DRAWN
    ),
)


def panels(traces: Traces) -> list[dict[str, Any]]:
    """The panels that the page's script draws; empty ones are left out."""
    left = {
        name: measure
        for name, measure in traces.measures.items()
        if len(measure.allowed.at_s) > 1 and len(measure.measured.at_s) > 1
    }
    drawn = [panel for declared in PANELS if (panel := _panel(declared, traces, left)) is not None]
    return drawn + [_of_measure(measure) for measure in left.values()]


def _panel(declared: Panel, traces: Traces, left: dict[str, Measure]) -> dict[str, Any] | None:
    curves = []
    for curve in declared.curves:
        series = traces.signals.get(curve.signal)
        if series is not None and len(series.at_s) > 1:
            curves.append(_curve(series, curve.label, curve.ink, declared.digits + 1))
    if not curves:
        return None
    for name in _limits_of(declared, traces, left):
        curves.append(_curve(left.pop(name).allowed, "limit", "you", declared.digits + 1, is_limit=True))
    return {"title": declared.title, "unit": declared.unit, "digits": declared.digits, "curves": curves}


def _limits_of(declared: Panel, traces: Traces, left: dict[str, Measure]) -> list[str]:
    """The checks that measured just what a curve of the panel shows: their limits are drawn beside it."""
    return [
        name
        for name, measure in left.items()
        if measure.unit == declared.unit
        and any(
            curve.signal in measure.needs
            and (series := traces.signals.get(curve.signal)) is not None
            and _is_of(measure, series)
            for curve in declared.curves
        )
    ]


def _is_of(measure: Measure, series: Series) -> bool:
    same = 0
    for at_s, value in zip(measure.measured.at_s, measure.measured.values, strict=True):
        index = bisect_right(series.at_s, at_s) - 1
        if index >= 0 and math.isclose(abs(series.values[index]), abs(value), rel_tol=1e-3, abs_tol=1e-3):
            same += 1
    return same >= _SAME_OF * len(measure.measured.at_s)


def _of_measure(measure: Measure) -> dict[str, Any]:
    return {
        "title": measure.title,
        "unit": measure.unit,
        "digits": 2,
        "curves": [
            _curve(measure.measured, measure.label.lower(), "ink", 3),
            _curve(measure.allowed, "limit", "you", 3, is_limit=True),
        ],
    }


def _curve(series: Series, label: str, ink: Ink, digits: int, *, is_limit: bool = False) -> dict[str, Any]:
    times, values = [], []
    for at_s, value in _plain(series, is_limit):
        times.append(round(at_s, 3))
        values.append(None if value is None else round(value, digits))
    return {"label": label, "ink": ink, "limit": is_limit, "t": times, "v": values}


def _plain(series: Series, is_limit: bool) -> Iterator[tuple[float, float | None]]:
    """A limit stands for long: only its corners are kept."""
    points = series.points()
    for index, (at_s, value) in enumerate(points):
        is_corner = index in (0, len(points) - 1) or points[index - 1][1] != value or points[index + 1][1] != value
        if not is_limit or is_corner:
            yield at_s, value


def track(traces: Traces) -> dict[str, Any] | None:
    """The car's way in metres east and north of its first position; None where it had none."""
    points = traces.track
    if len(points) < 2:
        return None
    step = max(1, len(points) // 6000)
    kept = points[::step]
    if kept[-1] is not points[-1]:
        kept.append(points[-1])
    return {
        "t": [round(point[0], 2) for point in kept],
        "e": [round(point[1], 2) for point in kept],
        "n": [round(point[2], 2) for point in kept],
    }

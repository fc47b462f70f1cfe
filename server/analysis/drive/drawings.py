"""The drawings of a drive's report as SVG: map and speed. Only numbers of ours are put into them."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from monitor.geo import Plane
from server.analysis.drive.axis import Scale, nice_step, ticks, time_ticks
from server.recording.drive.facts import DriveFacts, modes_of
from server.recording.drive.modes import ModeSpan

THICKNESS = ((2.5, 1.5), (5.0, 3.0), (7.5, 5.0), (10.0, 7.5), (math.inf, 10.5))  # below m/s → px
MOST_POINTS = 700
GAP_S = 3.0  # between two positions: what was driven meanwhile is not drawn
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Sign:
    """A thing that happened: at a moment, drawn as `kind` (critical, warning, mark or wheel)."""

    at_s: float
    kind: str


def signs_of(facts: DriveFacts) -> list[Sign]:
    """Alarms, marks and interventions of a drive; advisories are in the list of alarms alone."""
    if facts.log is None:
        return []
    alarms = [Sign(facts.at_s(one.raised_ms), one.priority) for one in facts.log.alarms if one.priority != "advisory"]
    marks = [Sign(facts.at_s(row["marked_ms"]), "mark") for row in facts.log.marks]
    wheels = [Sign(facts.at_s(one.at_ms), "wheel") for one in facts.log.interventions]
    return sorted([*marks, *alarms, *wheels], key=lambda sign: sign.at_s)[:500]


def drive_map(facts: DriveFacts, width: float, height: float) -> Markup | None:
    """The track: thickness is speed, hollow is manual; None: no two positions."""
    places = _thinned(facts.motion.places)
    if len(places) < 2:
        return None
    plane = Plane(places[0][1], places[0][2])
    enu = [plane.enu(lat_deg, lon_deg) for _, lat_deg, lon_deg in places]
    east, north = [p[0] for p in enu], [p[1] for p in enu]
    scale = min((width - 40) / max(max(east) - min(east), 20), (height - 84) / max(max(north) - min(north), 20))
    mid_e, mid_n = (min(east) + max(east)) / 2, (min(north) + max(north)) / 2
    points = [(width / 2 + (e - mid_e) * scale, (height - 34) / 2 + 6 - (n - mid_n) * scale) for e, n in enu]
    times = [place[0] for place in places]
    parts = [*_grid(width, height, scale), *_track(facts, times, points)]
    parts.append(f'<circle class="start" cx="{points[0][0]:.1f}" cy="{points[0][1]:.1f}" r="5"/>')
    for sign in signs_of(facts):
        place = bisect_right(times, sign.at_s) - 1
        if 0 <= place and (sign.at_s - times[place] <= GAP_S):
            parts.append(sign_at(sign.kind, *points[place]))
    parts.append(
        f'<path class="ink fill" d="M{width - 18:.1f} 8l5 13-5-3-5 3z"/>'
        f'<text class="b" x="{width - 18:.1f}" y="36" text-anchor="middle">N</text>'
    )
    return svg(width, height, parts, "The track of the car, north up; thicker is faster, hollow is manual")


def speed_plot(facts: DriveFacts, width: float, height: float) -> Markup | None:
    """Speed with its limit, what happened above, the modes below; None: no speed was received."""
    course = facts.motion.speed
    if len(course.at_s) < 2:
        return None
    top, bottom, left, right = 44.0, height - 44.0, 42.0, width - 8
    limits = [value for _, value in facts.limits]
    highest = max(max(map(abs, course.values)), *limits, 1.0)
    marks = ticks(0.0, 1.04 * highest, 3)
    x = Scale(0.0, max(facts.length_s, 0.1), left, right)
    y = Scale(0.0, marks[-1], bottom, top)
    parts = _manual(facts, x, top, bottom) + horizontal(marks, y, left, right)
    parts += not_known(facts, x, top, bottom)
    parts += _limit(facts, x, y)
    pairs = [(at_s, abs(value)) for at_s, value in zip(course.at_s, course.values, strict=True)]
    for piece in _pieces(extremes(pairs)):
        parts.append(f'<path class="line" d="{path([(x(a), y(v)) for a, v in piece])}"/>')
    parts += _above(facts, pairs, x, y)
    parts += time_axis(facts, x, bottom, width) + _mode_bar(facts, x, height - 14)
    for sign in signs_of(facts):
        if 0 <= sign.at_s <= facts.length_s:
            parts.append(sign_at(sign.kind, x(sign.at_s), 32.0 if sign.kind == "mark" else 12.0))
    parts.append(f'<text x="{left - 6:.1f}" y="{top - 8:.1f}" text-anchor="end">m/s</text>')
    return svg(width, height, parts, "Speed over time, with its limit, what happened above it and the mode below it")


def svg(width: float, height: float, parts: Iterable[str], words: str) -> Markup:
    return Markup(f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{words}">{"".join(parts)}</svg>')


def path(points: Sequence[Point]) -> str:
    return "M" + "L".join(f"{px:.1f} {py:.1f}" for px, py in points)


def _thinned(places: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    step = max(1, math.ceil(len(places) / MOST_POINTS))
    kept = list(places[::step])
    return kept if not places or kept[-1] is places[-1] else [*kept, places[-1]]


def extremes(pairs: Sequence[Point]) -> list[Point]:
    """Each stretch's lowest and highest, so that no peak is lost."""
    if len(pairs) <= MOST_POINTS:
        return list(pairs)
    stretch = math.ceil(2 * len(pairs) / MOST_POINTS)
    kept: list[Point] = []
    for begin in range(0, len(pairs), stretch):
        part = pairs[begin : begin + stretch]
        kept += sorted({min(part, key=lambda one: one[1]), max(part, key=lambda one: one[1])})
    return kept


def _pieces(pairs: Sequence[Point]) -> list[list[Point]]:
    """Lines between gaps: a gap is never bridged."""
    usual = sorted(b[0] - a[0] for a, b in itertools.pairwise(pairs))
    gap_s = max(1.0, 6 * usual[len(usual) // 2]) if usual else 1.0
    pieces: list[list[Point]] = []
    for pair in pairs:
        if not pieces or pair[0] - pieces[-1][-1][0] > gap_s:
            pieces.append([])
        pieces[-1].append(pair)
    return pieces


def _grid(width: float, height: float, scale: float) -> list[str]:
    step_m = nice_step(width / scale, 6)
    step = step_m * scale
    parts = [
        f'<path class="grid" d="M{px:.1f} 0V{height - 34:.1f}"/>' for px in _multiples(width / 2 % step, step, width)
    ]
    parts += [f'<path class="grid" d="M0 {py:.1f}H{width:g}"/>' for py in _multiples(step / 2, step, height - 34)]
    name = f"{step_m / 1000:g} km" if step_m >= 1000 else f"{step_m:g} m"
    base = height - 10
    parts.append(
        f'<path class="edge" d="M6 {base - 5:.1f}V{base:.1f}H{6 + step:.1f}V{base - 5:.1f}"/>'
        f'<text class="halo" x="{12 + step:.1f}" y="{base:.1f}">{name}</text>'
    )
    right = width - 172
    if right > 12 + step + 50:
        parts.append(f'<text x="{right:.1f}" y="{base + 1:.1f}" text-anchor="end">0</text>')
        for number, (_, thick) in enumerate(THICKNESS):
            begin = right + 8 + number * 23
            parts.append(f'<path class="track" stroke-width="{thick}" d="M{begin:.1f} {base - 4:.1f}h18"/>')
        parts.append(f'<text x="{right + 128:.1f}" y="{base + 1:.1f}">12 m/s</text>')
    return parts


def _multiples(first: float, step: float, end: float) -> list[float]:
    return [first + number * step for number in range(int(max(0.0, end - first) / step) + 1)] if step > 1 else []


def _track(facts: DriveFacts, times: Sequence[float], points: Sequence[Point]) -> list[str]:
    """Pieces of one thickness and one mode; each begins where the one before ended."""
    spans = facts.log.modes if facts.log is not None else ()
    pieces: list[tuple[float, bool, list[Point]]] = []
    for index in range(1, len(points)):
        if times[index] - times[index - 1] > GAP_S:
            continue
        speed_mps = abs(facts.motion.speed.at(times[index]) or 0.0)
        thick = next(px for below, px in THICKNESS if speed_mps < below)
        manual = _mode_at(spans, facts.start_ms + times[index] * 1000) == "manual"
        if pieces and pieces[-1][:2] == (thick, manual) and pieces[-1][2][-1] is points[index - 1]:
            pieces[-1][2].append(points[index])
        else:
            pieces.append((thick, manual, [points[index - 1], points[index]]))
    parts = []
    for thick, manual, line in pieces:
        parts.append(f'<path class="track" stroke-width="{max(thick, 4.0) if manual else thick}" d="{path(line)}"/>')
        if manual:
            parts.append(f'<path class="track hollow" stroke-width="{max(thick, 4.0) - 2.4:.1f}" d="{path(line)}"/>')
    return parts


def _mode_at(spans: Sequence[ModeSpan], at_ms: float) -> str:
    return next((span.mode for span in spans if span.from_ms <= at_ms <= span.to_ms), "unknown")


def horizontal(marks: Sequence[float], y: Scale, left: float, right: float) -> list[str]:
    return [
        f'<path class="{"axis" if mark == marks[0] else "grid"}" d="M{left:g} {y(mark):.1f}H{right:.1f}"/>'
        f'<text x="{left - 6:g}" y="{y(mark) + 4.5:.1f}" text-anchor="end">{mark:g}</text>'
        for mark in marks
    ]


def time_axis(facts: DriveFacts, x: Scale, bottom: float, width: float) -> list[str]:
    parts = []
    for at_ms, name in time_ticks(facts.start_ms, facts.end_ms, 7 if width > 500 else 4):
        px = x(facts.at_s(at_ms))
        anchor = "start" if px < 60 else "end" if px > width - 26 else "middle"
        parts.append(
            f'<path class="axis" d="M{px:.1f} {bottom:.1f}v5"/>'
            f'<text x="{px:.1f}" y="{bottom + 18:.1f}" text-anchor="{anchor}">{name}</text>'
        )
    return parts


def _limit(facts: DriveFacts, x: Scale, y: Scale) -> list[str]:
    parts = []
    for number, (at_s, value) in enumerate(facts.limits):
        until_s = facts.limits[number + 1][0] if number + 1 < len(facts.limits) else facts.length_s
        parts.append(f'<path class="limit" d="M{x(at_s):.1f} {y(value):.1f}H{x(until_s):.1f}"/>')
    if facts.limits:
        at_s, value = facts.limits[0]
        parts.append(f'<text class="you halo" x="{x(at_s) + 6:.1f}" y="{y(value) - 5:.1f}">limit {value:.1f}</text>')
    return parts


def _above(facts: DriveFacts, pairs: Sequence[Point], x: Scale, y: Scale) -> list[str]:
    """Where the speed was above its limit."""
    starts = [at_s for at_s, _ in facts.limits]
    over: list[Point] = []
    for at_s, value in pairs:
        place = bisect_right(starts, at_s) - 1
        if place >= 0 and value > facts.limits[place][1]:
            over.append((at_s, value))
    if not over:
        return []
    pieces = _pieces(extremes(over))
    return [f'<path class="above" d="{path([(x(a), y(v)) for a, v in piece])}"/>' for piece in pieces]


def _manual(facts: DriveFacts, x: Scale, top: float, bottom: float) -> list[str]:
    spans = facts.log.modes if facts.log is not None else ()
    return [
        f'<rect class="manual" x="{x(facts.at_s(one.from_ms)):.1f}" y="{top:g}" '
        f'width="{x(facts.at_s(one.to_ms)) - x(facts.at_s(one.from_ms)):.1f}" height="{bottom - top:.1f}"/>'
        for one in spans
        if one.mode == "manual"
    ]


def _mode_bar(facts: DriveFacts, x: Scale, y: float) -> list[str]:
    parts = []
    for span in modes_of(facts):
        left, right = x(facts.at_s(span.from_ms)), x(facts.at_s(span.to_ms))
        if span.mode == "unknown":
            parts.append(hatch(left, right, y, y + 8))
        else:
            parts.append(
                f'<rect class="bar {span.mode}" x="{left:.1f}" y="{y:.1f}" '
                f'width="{max(right - left, 1):.1f}" height="8"/>'
            )
    return parts


def not_known(facts: DriveFacts, x: Scale, top: float, bottom: float) -> list[str]:
    """Hatched where nothing was received; between two parts, in which nothing was recorded, with an edge on both
    sides."""
    parts = [hatch(x(from_s), x(to_s), top, bottom) for from_s, to_s in facts.motion.blind_spans()[:200]]
    for from_s, to_s in facts.gaps[:200]:
        left, right = x(from_s), max(x(to_s), x(from_s) + 2)
        parts.append(hatch(left, right, top, bottom))
        parts.append(
            f'<path class="part" d="M{left:.1f} {top - 6:.1f}V{bottom:.1f}M{right:.1f} {top - 6:.1f}V{bottom:.1f}"/>'
        )
    return parts


def hatch(left: float, right: float, top: float, bottom: float) -> str:
    """Slanted lines within a box, each cut at its edges."""
    right = max(right, left + 2)
    height = bottom - top
    lines: list[str] = []
    offset = -height
    while offset < right - left and len(lines) < 400:
        x1, x2 = left + offset, left + offset + height
        y1, y2 = bottom, top
        if x1 < left:
            y1, x1 = bottom - (left - x1), left
        if x2 > right:
            y2, x2 = top + (x2 - right), right
        lines.append(f"M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}")
        offset += 7
    return (
        f'<rect class="none" x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{height:.1f}"/>'
        f'<path class="hatch" d="{"".join(lines)}"/>'
    )


def sign_at(kind: str, px: float, py: float) -> str:
    at = f'transform="translate({px:.1f} {py:.1f})"'
    if kind == "critical":
        return f'<path class="crit" {at} d="M0-6l6 6-6 6-6-6z"/>'
    if kind == "warning":
        return f'<path class="warn" {at} d="M0-7l7.5 13h-15z"/>'
    if kind == "mark":
        return f'<path class="flag" {at} d="M0 0v-15M0-15h12l-3.5 4.5 3.5 4.5h-12z"/>'
    return f'<g class="wheel" {at}><circle r="7.5"/><path d="M-7.5-1h15M0-1v8.5"/></g>'

"""The track of a drive as a small picture: its line simplified, its alarms as marks, in a square of 64 units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from monitor.geo import Plane
from monitor.tracks import TrackPoint
from server.protocol.answers import SketchAnswer

SIDE = 64.0
MARGIN = 9.0
LEAST_M = 20.0  # a smaller track does not fill the picture: the drift of a standing receiver would look like a drive
TOLERANCE = 0.6  # units: less than half of the line's own width
MOST_POINTS = 120  # of all lines
MOST_MARKS = 30
_PIECE = 0.05  # of all points: a smaller piece beyond a leap of the receiver does not decide the scale
_DRAWN = ("warning", "critical")  # advisories are counted, not drawn; critical ones are on top
Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sketch:
    """What is drawn, in units from the upper left corner."""

    lines: tuple[tuple[tuple[float, float], ...], ...]  # each where the way between its points is known
    start: tuple[float, float]
    marks: tuple[tuple[float, float, str], ...] = ()  # x, y, priority

    def as_json(self) -> SketchAnswer:
        """Lines as flat lists x, y, x, y …: some hundred bytes a drive."""
        return {
            "lines": [[number for point in line for number in point] for line in self.lines],
            "start": list(self.start),
            "marks": list(self.marks),
        }


def sketch(track: Sequence[TrackPoint], alarms: Sequence[tuple[float, str]] = ()) -> Sketch | None:
    """The picture of a track with its alarms (moment on the track's clock, priority); None: there was no position."""
    if not track:
        return None
    plane = Plane(track[0].lat_deg, track[0].lon_deg)
    enu = np.array([plane.enu(point.lat_deg, point.lon_deg) for point in track])
    begins = [0, *(i for i, point in enumerate(track) if i and (point.is_jump or point.is_after_gap)), len(track)]
    pieces = [(a, b) for a, b in pairwise(begins) if b - a >= _PIECE * len(track)]
    pieces = pieces or [max(pairwise(begins), key=lambda piece: piece[1] - piece[0])]
    shown = np.concatenate([enu[a:b] for a, b in pieces])
    middle = (shown.min(axis=0) + shown.max(axis=0)) / 2
    extent_m = max(float(np.ptp(shown, axis=0).max()), LEAST_M)
    placed = (enu - middle) * ((SIDE - 2 * MARGIN) / extent_m) * (1.0, -1.0) + SIDE / 2
    kept = _simple([placed[a:b] for a, b in pieces])
    return Sketch(
        lines=tuple(tuple(_rounded(point) for point in line) for line in kept),
        start=_rounded(placed[pieces[0][0]]),
        marks=_marks(track, placed, pieces, alarms),
    )


def _simple(pieces: Sequence[Points]) -> list[Points]:
    tolerance = TOLERANCE
    while True:
        kept = [piece[simplify(piece, tolerance)] for piece in pieces]
        if sum(map(len, kept)) <= max(MOST_POINTS, 2 * len(pieces)):
            return kept
        tolerance *= 1.6


def simplify(points: Points, tolerance: float) -> NDArray[np.bool_]:
    """Which points a line needs to stay within `tolerance` of itself (Douglas and Peucker, 1973); the ends always."""
    keep = np.zeros(len(points), dtype=np.bool_)
    keep[[0, -1]] = True
    waiting = [(0, len(points) - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first < 2:
            continue
        chord = points[last] - points[first]
        from_first = points[first + 1 : last] - points[first]
        length2 = float(chord @ chord)
        share = np.clip(from_first @ chord / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(len(from_first))
        away = np.hypot(*(from_first - share[:, None] * chord).T)
        farthest = int(away.argmax())
        if away[farthest] > tolerance:
            keep[first + 1 + farthest] = True
            waiting += [(first, first + 1 + farthest), (first + 1 + farthest, last)]
    return keep


def _marks(
    track: Sequence[TrackPoint],
    placed: Points,
    pieces: Sequence[tuple[int, int]],
    alarms: Sequence[tuple[float, str]],
) -> tuple[tuple[float, float, str], ...]:
    """Where the car was last seen at each alarm; of those at one place the most urgent."""
    moments = [point.at_s for point in track]
    found: dict[tuple[float, float], str] = {}
    for at_s, priority in sorted(alarms, key=lambda alarm: _DRAWN.index(alarm[1]) if alarm[1] in _DRAWN else -1):
        index = int(np.searchsorted(moments, at_s, side="right")) - 1
        if priority in _DRAWN and any(a <= index < b for a, b in pieces):
            place = _rounded(placed[index])
            found.pop(place, None)
            found[place] = priority
    return tuple((x, y, priority) for (x, y), priority in list(found.items())[-MOST_MARKS:])


def _rounded(point: Points) -> tuple[float, float]:
    return round(float(point[0]), 1), round(float(point[1]), 1)


_MARKS = {"critical": ("M0-5l5 5-5 5-5-5z", "#c80a1c"), "warning": ("M0-6.5l6 10.5h-12z", "#ffb420")}


def svg(drawn: Sketch | None, title: str) -> str:
    """A stand-alone SVG in the current text colour, for any theme.

    `title` is the text alternative, without markup. None: an empty square with the reason.
    """
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 64 64" role="img"><title>{title}</title>'
    if drawn is None:
        return (
            f'{head}<g fill="currentColor" font-family="sans-serif" font-size="11" text-anchor="middle">'
            '<text x="32" y="30">no</text><text x="32" y="43">position</text></g></svg>'
        )
    lines = "".join(f'<polyline points="{" ".join(f"{x:g},{y:g}" for x, y in line)}"/>' for line in drawn.lines)
    x, y = drawn.start
    marks = "".join(
        f'<path transform="translate({x:g} {y:g})" d="{_MARKS[priority][0]}" fill="{_MARKS[priority][1]}"/>'
        for x, y, priority in drawn.marks
        if priority in _MARKS
    )
    return (
        f'{head}<g fill="none" stroke="currentColor" stroke-width="2.5" stroke-linejoin="round" stroke-linecap="round">'
        f'{lines}<circle cx="{x:g}" cy="{y:g}" r="3.5" stroke-width="2"/></g>'
        f'<g stroke="currentColor" stroke-width=".75">{marks}</g></svg>'
    )


def from_json(body: SketchAnswer | None) -> Sketch | None:
    """What `as_json` made."""
    if body is None:
        return None
    return Sketch(
        lines=tuple(tuple(zip(line[::2], line[1::2], strict=True)) for line in body["lines"]),
        start=(body["start"][0], body["start"][1]),
        marks=tuple((mark[0], mark[1], mark[2]) for mark in body["marks"]),
    )

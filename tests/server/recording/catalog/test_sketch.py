"""The small picture of a track: simplified but true, whole but not blown up, its marks where the car was."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.tracks import TrackPoint
from server.recording.catalog.sketch import MARGIN, MOST_POINTS, SIDE, from_json, simplify, sketch, svg

LAT = 111_194.9  # metres a degree


def way(*places: tuple[float, float], breaks: tuple[int, ...] = ()) -> list[TrackPoint]:
    """Places in metres east and north, a second apart; a leap before those named."""
    return [
        TrackPoint(
            at_s=float(n), lat_deg=north / LAT, lon_deg=east / LAT, distance_m=0.0, number=n + 1, is_jump=n in breaks
        )
        for n, (east, north) in enumerate(places)
    ]


def test_no_position_no_picture() -> None:
    assert sketch([]) is None


def test_north_is_up_and_the_longer_side_fills_the_picture() -> None:
    drawn = sketch(way((0, 0), (0, 400), (100, 400)))
    assert drawn is not None
    (line,) = drawn.lines
    assert line[0] == drawn.start
    assert line[0][1] == SIDE - MARGIN
    assert line[1][1] == line[2][1] == MARGIN
    assert line[2][0] - line[1][0] == pytest.approx(11.5, abs=0.2)  # a quarter of the height
    assert line[1][0] + line[2][0] == pytest.approx(SIDE, abs=0.2)  # in the middle


def test_a_car_that_stands_is_a_point_and_not_a_drive() -> None:
    drawn = sketch(way(*((math.sin(n), math.cos(2 * n)) for n in range(50))))
    assert drawn is not None
    assert all(28 < x < 36 and 28 < y < 36 for x, y in drawn.lines[0])
    alone = sketch(way((3, 3)))
    assert alone is not None
    assert alone.lines == (((32.0, 32.0),),)


def test_no_line_is_drawn_over_a_leap_and_an_astray_point_does_not_shrink_the_rest() -> None:
    there = [(float(n), 10.0 * (n % 2)) for n in range(0, 300, 3)]
    drawn = sketch(way(*there, (90_000.0, 0.0), *((x, y + 40) for x, y in there), breaks=(100, 101)))
    assert drawn is not None
    assert len(drawn.lines) == 2
    xs = [x for line in drawn.lines for x, _ in line]
    assert min(xs) == MARGIN
    assert max(xs) == pytest.approx(SIDE - MARGIN, abs=0.2)


def test_marks_stand_where_the_car_was_and_the_urgent_one_is_seen() -> None:
    track = way(*((0.0, float(10 * n)) for n in range(11)))
    drawn = sketch(
        track,
        [(5.2, "critical"), (5.3, "warning"), (2.0, "warning"), (-1.0, "critical"), (3.0, "advisory"), (4.0, "odd")],
    )
    assert drawn is not None
    assert drawn.marks == ((32.0, 45.8, "warning"), (32.0, 32.0, "critical"))


@pytest.mark.parametrize("points", [3, 500, 40_000])
def test_the_simplified_line_is_near_every_point_of_the_true_one(points: int) -> None:
    t = np.linspace(0.0, 12.0, points)
    line = np.column_stack([20 * np.sin(t) + t, 20 * np.cos(1.3 * t)])
    keep = simplify(line, 0.6)
    kept = line[keep]
    assert keep[0]
    assert keep[-1]
    assert len(kept) < 200
    for place in line[:: max(1, points // 300)]:
        assert min(_away(place, a, b) for a, b in pairwise(kept)) <= 0.6 + 1e-9


def test_a_wild_track_stays_small() -> None:
    random = np.random.default_rng(7)
    drawn = sketch(way(*(tuple(place) for place in random.uniform(0, 900, (2000, 2)))))
    assert drawn is not None
    assert sum(map(len, drawn.lines)) <= MOST_POINTS


@given(
    st.lists(st.tuples(st.floats(-5e3, 5e3), st.floats(-5e3, 5e3)), min_size=1, max_size=40),
    st.lists(st.tuples(st.floats(-5, 50), st.sampled_from(["critical", "warning", "advisory", "<b>"])), max_size=8),
)
def test_any_track_is_a_proper_picture(places: list[tuple[float, float]], alarms: list[tuple[float, str]]) -> None:
    drawn = sketch(way(*places), alarms)
    assert drawn is not None
    for x, y in (point for line in drawn.lines for point in line):
        assert 0 <= x <= SIDE
        assert 0 <= y <= SIDE
    assert from_json(drawn.as_json()) == drawn
    ET.fromstring(svg(drawn, "a track"))


def test_without_a_position_the_picture_shows_that() -> None:
    root = ET.fromstring(svg(None, "No position was recorded"))
    assert "".join(root.itertext()) == "No position was recordednoposition"
    assert "#" not in svg(None, ""), "in the colour of the text around it, in any theme"


def _away(place: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    chord = b - a
    length2 = float(chord @ chord)
    share = min(1.0, max(0.0, float((place - a) @ chord) / length2)) if length2 else 0.0
    return float(np.hypot(*(place - a - share * chord)))

"""What the laser sees, against the plainest way of reckoning it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from server.simulator.laser import INTERLACED, Beams, Scenery, box, dense, fan

ONE_AHEAD = fan(0.0, math.radians(1), 1, 0.0, 0.0)


def plainly(scenery: Scenery, x_m: float, y_m: float, angle_rad: float) -> float:
    """Solves ray against face, one by one."""
    nearest = math.inf
    dx, dy = math.cos(angle_rad), math.sin(angle_rad)
    for (ax, ay), (bx, by) in scenery.faces.tolist():
        ex, ey = bx - ax, by - ay
        across = dx * ey - dy * ex
        if abs(across) < 1e-12:
            continue
        way = ((ax - x_m) * ey - (ay - y_m) * ex) / across
        share = ((ax - x_m) * dy - (ay - y_m) * dx) / across
        if way > 0 and 0 <= share <= 1:
            nearest = min(nearest, way)
    return nearest if nearest <= 81.0 else math.inf


def distance_to_faces(scenery: Scenery, x_m: float, y_m: float) -> float:
    begin, along = scenery.faces[:, 0], scenery.faces[:, 1] - scenery.faces[:, 0]
    away = np.array((x_m, y_m)) - begin
    share = np.clip((away * along).sum(axis=1) / (along * along).sum(axis=1), 0, 1)
    return float(np.hypot(*(away - share[:, None] * along).T).min())


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-110, 110), st.floats(-110, 110), st.floats(-7, 7), st.sampled_from((*INTERLACED, dense(97), dense(360)))
)
def test_every_beam_ends_at_the_first_face(x_m: float, y_m: float, yaw_rad: float, beams: Beams) -> None:
    scenery = Scenery()
    assume(distance_to_faces(scenery, x_m, y_m) > 0.01)  # a laser in a wall sees nothing worth a rule
    found = scenery.distances_m(x_m, y_m, yaw_rad, beams, 81.0)
    expected = np.array([plainly(scenery, x_m, y_m, yaw_rad + angle) for angle in beams.angles_rad.tolist()])
    # a beam that just grazes a corner may see it or not
    different = ~np.isclose(found, expected, rtol=1e-6, atol=1e-6)
    near = [
        plainly(scenery, x_m, y_m, yaw_rad + angle + nudge)
        for angle in beams.angles_rad[different].tolist()
        for nudge in (-1e-9, 1e-9)
    ]
    assert all(np.isclose(near, distance, rtol=1e-6).any() or math.isinf(distance) for distance in found[different])
    assert different.sum() <= 1


def test_a_face_seen_edge_on_is_no_obstacle() -> None:
    scenery = Scenery()
    scenery.put([((5.0, 100.0), (9.0, 100.0))])
    for yaw_rad in (0.0, 6e-44, -1e-12):
        assert float(scenery.distances_m(0.0, 100.0, yaw_rad, ONE_AHEAD, 81.0)[0]) > 20.0


def test_what_is_put_down_is_seen_until_it_is_taken_away() -> None:
    scenery = Scenery()
    x_m, y_m = 0.0, 100.0
    before = float(scenery.distances_m(x_m, y_m, math.pi, ONE_AHEAD, 81.0)[0])
    scenery.put(box(x_m - 10, y_m, math.pi / 2, 4.0, 2.0))
    assert float(scenery.distances_m(x_m, y_m, math.pi, ONE_AHEAD, 81.0)[0]) == pytest.approx(9.0)
    scenery.put(None)
    assert float(scenery.distances_m(x_m, y_m, math.pi, ONE_AHEAD, 81.0)[0]) == before


def test_nothing_beyond_the_range_is_seen() -> None:
    scenery = Scenery()
    wall_m = float(scenery.distances_m(0, 100, math.pi / 2, ONE_AHEAD, 81.0)[0])
    assert 24.0 < wall_m < 25.0  # the flats of the outer wall stand a little inside its radius of 125 m
    assert math.isinf(scenery.distances_m(0, 100, math.pi / 2, ONE_AHEAD, wall_m - 0.01)[0])

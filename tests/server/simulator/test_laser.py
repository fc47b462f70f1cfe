"""The interlaced SICK, the dense scanner, and the distance estimator on top."""

from __future__ import annotations

import math

import numpy as np
import pytest

from server.simulator.car import SimulatedCar
from server.simulator.laser import INTERLACED, Laser, Scenery, box, dense, nearest
from server.simulator.vehicle import LASER_AHEAD_M, Motion

DEGREE = math.radians(1)
HERE = Motion(x_m=0.0, y_m=100.0, yaw_rad=math.pi)


def measured(thing: list[tuple[tuple[float, float], tuple[float, float]]], turn: int) -> np.ndarray:
    scenery = Scenery()
    scenery.put(thing)
    return Laser(scenery, np.random.default_rng(1)).ranges_m(HERE, INTERLACED[turn])


def test_the_two_turns_of_the_mirror_give_181_and_180_beams() -> None:
    whole, half = INTERLACED
    assert len(whole.angles_rad) == 181
    assert len(half.angles_rad) == 180
    assert (whole.angle_min_rad, whole.angle_max_rad) == pytest.approx((-90 * DEGREE, 90 * DEGREE))
    assert (half.angle_min_rad, half.angle_max_rad) == pytest.approx((-89.5 * DEGREE, 89.5 * DEGREE))
    for beams in INTERLACED:
        count = round((beams.angle_max_rad - beams.angle_min_rad) / beams.increment_rad) + 1
        assert count == len(beams.angles_rad)
        assert (count - 1) * beams.time_increment_s <= 1.1 * beams.scan_time_s
        # the real car's own messages say so
        assert beams.time_increment_s == pytest.approx(0.000037, abs=5e-7)
        assert beams.scan_time_s == pytest.approx(0.013333, abs=5e-7)


@pytest.mark.parametrize("turn", [0, 1])
def test_beam_i_stands_at_angle_min_plus_i_increments(turn: int) -> None:
    """A post 30° to the left of a car that heads west is met by the beam of that angle, and not by its mirror image."""
    angle = math.pi + 30 * DEGREE
    x_m = HERE.x_m - LASER_AHEAD_M + 8 * math.cos(angle)
    y_m = HERE.y_m + 8 * math.sin(angle)
    ranges = measured(box(x_m, y_m, 0.0, 0.4, 0.4), turn)
    beams = INTERLACED[turn]
    index = round((30 * DEGREE - beams.angle_min_rad) / beams.increment_rad)
    assert ranges[index] == pytest.approx(8.0, abs=0.3)
    assert ranges[len(ranges) - 1 - index] > 10.0


def test_ranges_are_whole_centimetres_with_some_noise_and_some_invalid_beams() -> None:
    laser = Laser(Scenery(), np.random.default_rng(1))
    scans = np.array([laser.ranges_m(HERE, INTERLACED[0]) for _ in range(200)], dtype=float)
    valid = scans[np.isfinite(scans)]
    assert np.allclose(valid, np.round(valid, 2), atol=1e-5)
    wall = scans[:, 30][np.isfinite(scans[:, 30])]
    assert 0.003 < wall.std() < 0.03
    share = np.isnan(scans).mean()
    assert 0 < share < 0.01
    assert np.isposinf(scans).any()
    assert valid.min() >= 0.0
    assert valid.max() <= 81.0


def test_the_estimator_tells_the_nearest_return_within_a_tenth_of_a_radian() -> None:
    beams = INTERLACED[0]
    ranges = np.full(181, 50.0, dtype=np.float32)
    ranges[90 + 5] = 12.0  # 5° to the left: inside 0.1 rad
    ranges[90 + 6] = 3.0  # 6°: outside
    ranges[90] = np.nan
    assert nearest(ranges, beams) == pytest.approx((12.0, 5 * DEGREE), abs=1e-6)


def test_with_nothing_ahead_the_estimator_tells_range_max_and_angle_min() -> None:
    for beams in INTERLACED:
        assert nearest(np.full(len(beams.angles_rad), np.inf, dtype=np.float32), beams) == (81.0, beams.angle_min_rad)


def test_scans_come_interlaced_and_the_estimator_agrees_with_them() -> None:
    counts = []
    steps = SimulatedCar().steps()
    while len(counts) < 20:
        by_topic = {message.topic: message.message for message in next(steps).messages}
        scan = by_topic.get("/catvehicle/front_laser_points")
        if scan is None:
            continue
        ranges = scan["ranges"]
        counts.append(len(ranges))
        assert scan["angle_min"] == pytest.approx((-90 if len(ranges) == 181 else -89.5) * DEGREE)
        angles = scan["angle_min"] + scan["angle_increment"] * np.arange(len(ranges))
        ahead = ranges[np.abs(angles) <= 0.1]
        assert by_topic["/DistanceEstimator/dist"]["data"] == pytest.approx(float(np.nanmin(ahead)))
        assert abs(by_topic["/DistanceEstimator/angle"]["data"]) <= 0.1
    assert counts in ([181, 180] * 10, [180, 181] * 10)


def test_a_dense_scan_goes_all_round() -> None:
    beams = dense(1440)
    assert len(beams.angles_rad) == 1440
    assert beams.angle_min_rad == -math.pi
    assert beams.angle_max_rad == pytest.approx(math.pi - 2 * math.pi / 1440)
    assert round((beams.angle_max_rad - beams.angle_min_rad) / beams.increment_rad) + 1 == 1440


@pytest.mark.parametrize("count", [-1, 0, 15, 20_001])
def test_too_few_or_too_many_beams_are_refused(count: int) -> None:
    with pytest.raises(ValueError, match=str(count)):
        dense(count)

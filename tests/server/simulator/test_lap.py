"""The lap: closed, smooth, and found again from a place on it."""

from __future__ import annotations

import math

import pytest

from server.simulator.lap import LENGTH_M, STOP_M, lap


def test_it_is_closed_and_without_a_kink() -> None:
    stations = [LENGTH_M * share / 2000 for share in range(2001)]
    poses = [lap().at(station) for station in stations]
    step_m = LENGTH_M / 2000
    for before, after in zip(poses, poses[1:] + poses[:1], strict=True):
        way_m = math.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
        assert way_m < step_m * 1.001
        turned = math.remainder(after.yaw_rad - before.yaw_rad, 2 * math.pi)
        assert abs(turned) <= step_m / 12.0 + 1e-9  # the tightest bend has a radius of 12 m


def test_it_goes_once_round_to_the_left() -> None:
    turned = lap().at(LENGTH_M - 1e-6).yaw_rad - lap().at(0).yaw_rad
    assert turned == pytest.approx(2 * math.pi, abs=1e-4)


@pytest.mark.parametrize("station_m", [0.0, 0.3, 250.0, STOP_M, 600.1, LENGTH_M - 0.2])
def test_a_place_on_it_is_found_again(station_m: float) -> None:
    pose = lap().at(station_m)
    for near_m in (None, station_m - 4.0, station_m + 4.0):
        found_m = lap().nearest_m(pose.x_m, pose.y_m, near_m=near_m)
        assert math.remainder(found_m - station_m, LENGTH_M) == pytest.approx(0, abs=0.02)


def test_a_place_beside_it_is_found_too() -> None:
    pose = lap().at(400.0)
    x_m, y_m = pose.x_m - 2 * math.sin(pose.yaw_rad), pose.y_m + 2 * math.cos(pose.yaw_rad)
    assert lap().nearest_m(x_m, y_m, near_m=398.0) == pytest.approx(400.0, abs=0.05)

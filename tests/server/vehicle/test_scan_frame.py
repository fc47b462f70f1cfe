"""A scan on its way to a page: what its beams say, and how the obstacle check judged it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from monitor.instruments import ObstacleLimits
from monitor.obstacle_view import corridor_ahead, is_blind, look_ahead
from monitor.state import Snapshot
from monitor.values import LaserScan, Steering, Twist
from server.protocol import serialize
from server.vehicle import scan_feed
from tests.monitor.checks.known import ask, known
from tests.monitor.test_corridor import sweep
from tests.server import scan_frames
from tests.server.scan_frames import ScanFrame

LIMITS = ObstacleLimits()
WALL = (60.0, 0.0, 50.0)


def seen(
    scan: LaserScan, *, speed_mps: float | None = 4.2, percent: float | None = 0.0, age_s: float = 0.0
) -> Snapshot:
    speed = None if speed_mps is None else Twist(speed_mps=speed_mps, yaw_rate_radps=None)
    steering = None if percent is None else Steering(percent=percent, tyre_rad=percent * -0.00536)
    return known(scan=scan, speed=speed, steering=steering, age_s=age_s)


def sent(snapshot: Snapshot, *, age_s: float = 0.0, kinds_kept: bool = True, was_active: bool = False) -> ScanFrame:
    scan = snapshot.need("scan")
    judged = scan_feed.judged(scan, snapshot, LIMITS, was_active=was_active)
    return scan_frames.read(serialize.scan_frame(scan, number=1, age_s=age_s, kinds_kept=kinds_kept, judged=judged))


@pytest.mark.parametrize("turned", [False, True], ids=["left to right", "negative increment"])
@pytest.mark.parametrize("percent", [0.0, -15.0, 15.0, None])
def test_the_page_is_sent_the_gap_and_the_bend_of_the_obstacle_check(percent: float | None, turned: bool) -> None:
    things = [(9.0, 0.0, 0.4), (9.0, 2.3, 0.4), (9.0, -2.3, 0.4), WALL]
    snapshot = seen(sweep(things, turned=turned), percent=percent)
    frame = sent(snapshot)
    finding = ask("obstacle", snapshot)
    assert finding.measured is not None
    assert frame.gap_m == pytest.approx(finding.measured.value, rel=1e-6)
    assert frame.stopping_m == pytest.approx(4.2 * 1.0 + 4.2**2 / 6, abs=0.005)
    assert frame.tyre_angle_rad == pytest.approx(corridor_ahead(snapshot, LIMITS).tyre_angle_rad, abs=1e-9)
    assert math.copysign(1.0, frame.tyre_angle_rad or 1.0) == (-1.0 if percent == 15.0 else 1.0)
    # The beam is one of the two that end on the thing.
    x_m, y_m = (
        frame.codes[frame.beam] * frame.scale_m * f(frame.angle_min_rad + frame.beam * frame.angle_increment_rad)
        for f in (math.cos, math.sin)
    )
    assert math.hypot(x_m - 9.0, y_m - (0.0 if not percent else math.copysign(2.3, -percent))) < 0.6


def test_a_bend_takes_another_object_for_the_nearest() -> None:
    things = [(9.0, 2.3, 0.5), (14.0, 0.0, 0.4), WALL]
    straight, left = sent(seen(sweep(things), percent=0.0)), sent(seen(sweep(things), percent=-15.0))
    assert straight.gap_m == pytest.approx(14.0, abs=0.2)
    assert 8.0 < left.gap_m < 11.0
    assert left.beam > straight.beam  # farther to the left


@pytest.mark.parametrize(
    ("snapshot", "stopping_m", "tyre_rad"),
    [
        pytest.param(seen(sweep([WALL]), speed_mps=None), None, 0.0, id="speed not known"),
        pytest.param(seen(sweep([WALL]), speed_mps=math.nan), None, 0.0, id="speed is NaN"),
        pytest.param(seen(sweep([WALL]), speed_mps=0.0), 0.0, 0.0, id="standing"),
        pytest.param(seen(sweep([WALL]), speed_mps=1e6), 655.34, 0.0, id="beyond what the frame can say"),
        pytest.param(seen(sweep([WALL]), percent=math.nan), 7.14, 0.0, id="steering is NaN"),
        pytest.param(seen(sweep([WALL]), percent=-1e9), 7.14, 0.6, id="steering beyond any car's"),
    ],
)
def test_what_is_not_known_is_not_sent(snapshot: Snapshot, stopping_m: float | None, tyre_rad: float) -> None:
    frame = sent(snapshot)
    assert frame.stopping_m == (None if stopping_m is None else pytest.approx(stopping_m, abs=0.005))
    assert frame.tyre_angle_rad == pytest.approx(tyre_rad)


def test_what_is_too_old_does_not_bend_the_corridor_nor_stop_the_car() -> None:
    snapshot = seen(sweep([WALL]), percent=-40.0)
    late = replace(snapshot, now_s=snapshot.now_s + 1.5)
    judged = scan_feed.judged(late.readings["scan"].value, late, LIMITS, was_active=False)
    assert (judged.tyre_angle_rad, judged.stopping_m) == (0.0, None)


@pytest.mark.parametrize(("was_active", "gap_m"), [(False, 80.0), (True, 8.0)])
def test_while_an_obstacle_is_alarmed_the_corridor_is_wider_as_the_judge_has_it(was_active: bool, gap_m: float) -> None:
    snapshot = seen(sweep([(8.0, 1.6, 0.3)], beams=721, nothing=80.0))
    frame = sent(snapshot, was_active=was_active)
    finding = ask("obstacle", snapshot, was_active=was_active)
    assert frame.gap_m == pytest.approx(gap_m, abs=0.2)
    assert frame.wider_m == (0.2 if was_active else 0.0)
    assert finding.measured is not None
    assert finding.measured.value == pytest.approx(frame.gap_m, rel=1e-6)


def test_nothing_in_the_corridor_and_a_corridor_not_seen_are_two_things() -> None:
    nothing = sent(seen(sweep([(9.0, 8.0, 1.0)], nothing=80.0)))
    assert (nothing.beam, nothing.gap_m) == (serialize.NO_BEAM, 0.0)
    blind = sent(seen(sweep([], nothing=np.nan)))
    assert (blind.beam, blind.gap_m) == (serialize.BLIND, 0.0)
    corridor = corridor_ahead(known(), LIMITS)
    assert is_blind(look_ahead(sweep([], nothing=np.nan), corridor))
    empty = replace(sweep([]), ranges_m=np.empty(0, dtype=np.float32))
    assert not is_blind(look_ahead(empty, corridor))


@pytest.mark.parametrize("beams", [0, 1, 2, 1440, 10_000, 65_535])
def test_any_number_of_beams(beams: int) -> None:
    scan = replace(
        sweep([]), ranges_m=np.full(beams, 7.0, dtype=np.float32), angle_increment_rad=math.pi / max(beams, 1)
    )
    frame = sent(seen(scan))
    assert frame.codes.size == beams
    assert np.allclose(frame.codes * frame.scale_m, 7.0, atol=2e-3)


def test_a_laser_that_looks_back_cannot_see_the_corridor() -> None:
    scan = replace(
        sweep([]),
        ranges_m=np.full(90, 2.0, dtype=np.float32),
        angle_min_rad=math.pi / 2 + 0.1,
        angle_increment_rad=0.03,
    )
    assert sent(seen(scan)).beam == serialize.BLIND


def test_an_open_end_invents_no_return() -> None:
    """A sensor without a range_max: +Inf is nothing in range, never a return at the end of the scale."""
    ranges = np.array([5.0, np.inf, -np.inf, np.nan, 5.0], dtype=np.float32)
    frame = sent(seen(replace(sweep([]), ranges_m=ranges, range_max_m=math.inf)))
    assert list(frame.codes[1:4]) == [serialize.NOTHING, serialize.TOO_CLOSE, serialize.INVALID]
    assert np.allclose(frame.codes[[0, 4]] * frame.scale_m, 5.0, atol=4e-3)


@pytest.mark.parametrize(("age_s", "sent_s"), [(0.0, 0.0), (0.0126, 0.013), (1e9, 65.535), (-1.0, 0.0)])
def test_the_age(age_s: float, sent_s: float) -> None:
    assert sent(seen(sweep([WALL])), age_s=age_s).age_s == pytest.approx(sent_s)


def test_1081_beams_stay_within_2200_bytes() -> None:
    scan = sweep([WALL], beams=1081)
    frame = serialize.scan_frame(
        scan, number=1, age_s=0.0, kinds_kept=True, judged=scan_feed.judged(scan, known(), LIMITS, was_active=False)
    )
    assert len(frame) + 4 <= 2200  # with the WebSocket header

"""The laser: blind or not, and scans that contradict themselves; a real interlaced SICK does not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from monitor.scan_shape import LEARNED_FROM, ScanHabit, difference
from monitor.values import LaserScan
from tests.monitor.checks.known import LINK, ask, known
from tests.monitor.test_corridor import sweep


def shaped(beams: int, low_deg: float, high_deg: float, step_deg: float, **times: float) -> LaserScan:
    return LaserScan(
        ranges_m=np.full(beams, 5.0, dtype=np.float32),
        angle_min_rad=math.radians(low_deg),
        angle_max_rad=math.radians(high_deg),
        angle_increment_rad=math.radians(step_deg),
        time_increment_s=times.get("time_increment_s", 0.0),
        scan_time_s=times.get("scan_time_s", 0.0),
        range_min_m=0.1,
        range_max_m=81.0,
        frame_id="laser",
    )


@pytest.mark.parametrize(
    ("blind", "verdict"),
    [(0.0, "ok"), (0.38, "ok"), (0.69, "ok"), (0.85, "ok"), (0.97, "fault"), (1.0, "fault")],
    ids=["all return", "a healthy UTM-30LX", "a healthy RPLidar", "bad light", "nearly blind", "blind"],
)
def test_blind(blind: float, verdict: str) -> None:
    scan = sweep([(60.0, 0.0, 50.0)])
    ahead = np.arange(76, 105)
    scan.ranges_m[ahead[: round(blind * ahead.size)]] = np.nan
    assert ask("laser_blind", known(scan=scan)).verdict == verdict


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, 0.05, 90.0], ids=str)
def test_every_kind_of_unusable_beam_is_blind(value: float) -> None:
    assert ask("laser_blind", known(scan=sweep([], nothing=value))).verdict == "fault"


def test_a_scan_that_does_not_look_ahead_is_blind() -> None:
    assert ask("laser_blind", known(scan=shaped(50, 100, 149, 1.0))).verdict == "fault"
    assert ask("laser_blind", known(scan=shaped(0, 0, 0, 1.0))).verdict == "fault"


@pytest.mark.parametrize(
    ("scan", "verdict", "level"),
    [
        pytest.param(shaped(181, -90, 90, 1.0), "ok", 0, id="SICK, even"),
        pytest.param(shaped(180, -89.5, 89.5, 1.0), "ok", 0, id="SICK, odd"),
        pytest.param(shaped(181, 90, -90, -1.0), "ok", 0, id="negative increment"),
        pytest.param(shaped(180, -90, 90, 1.0), "unknown", 0, id="off by one, how it counts is not known"),
        pytest.param(shaped(182, -90, 90, 1.0), "unknown", 0, id="one too many"),
        pytest.param(shaped(179, -90, 90, 1.0), "fault", 2, id="two missing"),
        pytest.param(shaped(90, -90, 90, 1.0), "fault", 2, id="half of it"),
        pytest.param(shaped(181, 90, -90, 1.0), "fault", 2, id="angles and increment contradict"),
        pytest.param(shaped(1, 0, 0, 1.0), "ok", 0, id="one beam"),
        pytest.param(
            shaped(181, -90, 90, 1.0, time_increment_s=3.7e-5, scan_time_s=1 / 75), "ok", 0, id="the SICK's own times"
        ),
        pytest.param(
            shaped(181, -90, 90, 1.0, time_increment_s=7.4e-5, scan_time_s=1 / 75), "ok", 0, id="the report's formula"
        ),
        pytest.param(
            shaped(181, -90, 90, 1.0, time_increment_s=1e-3, scan_time_s=1 / 75), "fault", 1, id="longer than a scan"
        ),
        pytest.param(shaped(181, -90, 90, 1.0, time_increment_s=1e-3), "ok", 0, id="scan time not given"),
    ],
)
def test_shape(scan: LaserScan, verdict: str, level: int) -> None:
    finding = ask("scan_shape", known(scan=scan))
    assert (finding.verdict, finding.level) == (verdict, level)


LESS, EQUAL, MORE = -1, 0, 1


@pytest.mark.parametrize("usual", [{LESS}, {EQUAL}, {MORE}, {LESS, EQUAL}, {EQUAL, MORE}, {LESS, EQUAL, MORE}], ids=str)
@pytest.mark.parametrize("beams", [178, 179, 180, 181, 182, 183, 184])
def test_a_count_is_judged_by_the_habit_of_the_driver(usual: set[int], beams: int) -> None:
    snapshot = replace(known(scan=shaped(beams, -90, 90, 1.0)), scan_habit=frozenset(usual))
    finding = ask("scan_shape", snapshot)
    off = beams - 181
    assert (finding.verdict, finding.level) == (
        ("fault", 2) if abs(off) > 1 else ("ok", 0) if off in usual else ("fault", 1)
    )


DIFFERENCES = {
    "as its angles give": (shaped(181, -90, 90, 1.0), 0),
    "YDLIDAR X4": (shaped(720, -180, 180, 0.5), -1),
    "velodyne_laserscan, whose step does not divide the circle": (shaped(897, -180, 180, math.degrees(0.007)), -1),
    "LD19, fewest": (shaped(454, 0, 360, math.degrees(0.01384)), 0),
    "LD19, most": (shaped(456, 0, 360, math.degrees(0.01384)), 1),
    "two less": (shaped(719, -180, 180, 0.5), -2),
    "half of it": (shaped(361, -180, 180, 0.5), -360),
    "turning right": (shaped(180, 90, -90, -1.0), -1),
    "one beam": (shaped(1, 0, 0, 1.0), 0),
    "no step": (shaped(2, 0, 0, 0.0), None),
    "angles and step contradict": (shaped(181, 90, -90, 1.0), None),
}


@pytest.mark.parametrize(("scan", "off"), DIFFERENCES.values(), ids=DIFFERENCES)
def test_how_many_beams_a_scan_has_more_than_its_angles_give(scan: LaserScan, off: int | None) -> None:
    assert difference(scan) == off


def test_a_habit_is_that_of_the_first_scans_and_a_large_difference_is_none() -> None:
    habit = ScanHabit()
    for beams in [180, 90, *[180] * (LEARNED_FROM - 2)]:
        habit.add(shaped(beams, -90, 90, 1.0))
    assert habit.usual is None
    habit.add(shaped(180, -90, 90, 1.0))
    assert habit.usual == {LESS}
    habit.add(shaped(181, -90, 90, 1.0))
    assert habit.usual == {LESS}


def test_nothing_to_compare() -> None:
    assert ask("scan_shape", known(scan=shaped(1, 0, 0, 0.0))).verdict == "unknown"


@pytest.mark.parametrize("id", ["laser_blind", "scan_shape"])
def test_not_published_and_silent(id: str) -> None:
    assert not ask(id, known()).applies
    assert ask(id, known(link=replace(LINK, published=frozenset({"scan"})))).applies
    assert ask(id, known(age_s=2.0, scan=shaped(181, -90, 90, 1.0))).verdict == "unknown"

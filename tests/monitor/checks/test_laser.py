"""The laser: blind or not, and scans that contradict themselves; a real interlaced SICK does not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

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
        pytest.param(shaped(180, -90, 90, 1.0), "fault", 1, id="off by one (velodyne_laserscan)"),
        pytest.param(shaped(182, -90, 90, 1.0), "fault", 1, id="one too many"),
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


def test_nothing_to_compare() -> None:
    assert ask("scan_shape", known(scan=shaped(1, 0, 0, 0.0))).verdict == "unknown"


@pytest.mark.parametrize("id", ["laser_blind", "scan_shape"])
def test_not_published_and_silent(id: str) -> None:
    assert not ask(id, known()).applies
    assert ask(id, known(link=replace(LINK, published=frozenset({"scan"})))).applies
    assert ask(id, known(age_s=2.0, scan=shaped(181, -90, 90, 1.0))).verdict == "unknown"

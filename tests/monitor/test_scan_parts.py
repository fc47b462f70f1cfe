"""A laser that sends its sweep in parts: what is ahead is judged by the part that looks there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from monitor.check import Finding
from monitor.instruments import ObstacleLimits
from monitor.scan import Mounting
from monitor.scan_shape import MOST_PARTS, SWEEP_S
from monitor.shell_facts import LinkFacts
from monitor.state import State
from monitor.values import LaserScan
from tests.monitor.checks.known import check_of
from tests.monitor.test_corridor import sweep

DEGREE = math.pi / 180


def parts(
    gap_m: float | None, *, beams: int, of: int = 360, first: int = 0, from_deg: float = -180.0
) -> Iterator[LaserScan]:
    """A turn of `of` beams of 1° in messages of so many, that sees a post ahead."""
    angles = (from_deg + np.arange(of)) * DEGREE
    ranges = np.full(of, 30.0, dtype=np.float32)
    if gap_m is not None:
        ahead = np.abs(np.angle(np.exp(1j * angles)))
        ranges[ahead <= math.atan(0.3 / gap_m) + 1e-6] = gap_m
    for at in range(first, of, beams):
        piece = ranges[at : at + beams]
        yield replace(
            sweep([]),
            ranges_m=piece,
            angle_min_rad=float(angles[at]),
            angle_max_rad=float(angles[at] + (piece.size - 1) * DEGREE),
            angle_increment_rad=DEGREE,
        )


def found(state: State, now_s: float, check: str = "obstacle", *, was_active: bool = False) -> Finding:
    one = check_of(check)
    return one.find(state.snapshot(now_s), one.limits(), was_active)


def driven(*turns: list[LaserScan], turn_s: float = 0.1) -> tuple[State, list[Finding], float]:
    """A state that received these turns, what was found after each message, and the time."""
    state, findings, now_s = State(), [], 10.0
    state.link(LinkFacts(phase="monitoring", connected_s=0.0, bridge_answers=True))
    for turn in turns:
        for scan in turn:
            now_s += turn_s / len(turn)
            state.receive("scan", scan, now_s)
            findings.append(found(state, now_s))
    return state, findings, now_s


@pytest.mark.parametrize("beams", [30, 10, 7])
@pytest.mark.parametrize("from_deg", [-180.0, 0.0, 90.0], ids=["seam behind", "seam ahead", "seam on the left"])
def test_a_post_ahead_is_an_obstacle_after_each_part_and_nothing_is_unknown(beams: int, from_deg: float) -> None:
    turns = [list(parts(4.0, beams=beams, from_deg=from_deg)) for _ in range(4)]
    state, findings, now_s = driven(*turns)
    assert {finding.verdict for finding in findings[len(turns[0]) :]} == {"fault"}
    assert findings[-1].text.startswith("Obstacle 4.0 m ahead, 4° ")  # one of its edges
    assert found(state, now_s, "laser_blind").verdict == "ok"


def test_once_it_is_gone_it_is_no_obstacle() -> None:
    turns = [list(parts(gap_m, beams=30)) for gap_m in (4.0, None, None)]
    _, findings, _ = driven(*turns)
    assert findings[len(turns[0])].verdict == "fault"
    assert findings[-1].verdict == "ok"


def test_parts_that_never_look_ahead_say_nothing_of_it() -> None:
    turns = [[one for one in parts(None, beams=30) if abs(one.angle_min_rad + 15 * DEGREE) > 1.0] for _ in range(4)]
    _, findings, _ = driven(*turns)
    assert {finding.verdict for finding in findings} == {"unknown"}
    half = [[one for one in parts(None, beams=30) if one.angle_min_rad >= -1e-6] for _ in range(4)]
    _, findings, _ = driven(*half)
    assert {finding.verdict for finding in findings} == {"unknown"}
    assert findings[-1].text == "The laser looks into a part of the corridor"


def test_a_part_that_stopped_coming_counts_no_longer() -> None:
    whole, lacking = list(parts(4.0, beams=30)), [one for one in parts(4.0, beams=30) if abs(one.angle_min_rad) > 0.6]
    state, findings, now_s = driven(whole, whole, *[lacking] * 5)
    assert findings[-1].verdict == "fault"
    state, findings, now_s = driven(whole, *[lacking] * round(2 * SWEEP_S / 0.1))
    assert findings[-1].verdict == "unknown"
    assert state.snapshot(now_s).scan_parts


def test_a_laser_that_sends_its_sweep_whole_has_no_parts_and_what_is_kept_is_bounded() -> None:
    state, _, now_s = driven(*[[sweep([])]] * 20)
    assert state.snapshot(now_s).scan_parts == ()
    odd = [replace(sweep([]), angle_min_rad=-1.5 - 1e-4 * n) for n in range(500)]
    state, _, now_s = driven(odd, turn_s=0.5)
    assert len(state.snapshot(now_s).scan_parts) <= MOST_PARTS
    # The clock is set back: nothing that was kept would ever grow old.
    state.receive("scan", odd[0], 1.0)
    assert state.snapshot(1.0).scan_parts == ()


def test_each_part_is_seen_from_where_its_own_laser_is() -> None:
    """Two lasers of one topic, on the left corner and on the right one, each with a half of the view."""
    left = Mounting(origin="transforms", x_m=2.5, y_m=0.8)
    right = Mounting(origin="transforms", x_m=2.0, y_m=-0.8)
    both = [
        replace(next(parts(4.0, beams=100, first=180)), mounting=left, frame_id="left"),
        replace(next(parts(None, beams=180, first=0)), mounting=right, frame_id="right"),
    ]
    state, _, now_s = driven(*[both] * 3)
    finding = found(state, now_s)
    assert finding.verdict == "fault"
    assert finding.measured is not None
    assert finding.measured.value == pytest.approx(4.0, abs=0.05)
    assert ObstacleLimits().bumper_ahead_m == 0.0

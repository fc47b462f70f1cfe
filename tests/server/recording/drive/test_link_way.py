"""The link along the way, against a drive whose truth is known; and the metres unseen of late or missing messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from monitor.values import Twist
from server.analysis.drive.drive_report import report_json
from server.analysis.drive.sheet import _blind, _blind_head
from server.analysis.drive.tables import report_rows
from server.recording.catalog import annotations
from server.recording.drive.facts import DriveFacts, read_facts
from server.recording.drive.link_way import LEAST_M, blind_times, late_times, link_along
from server.recording.drive.motion import Motion
from server.recording.read.read import Recording, open_recording
from tests.server.recording.drive.story import in_two_parts, recorded

ENDS_S = 40.0
Steps = Sequence[tuple[float, float]]


def test_each_stretch_has_its_delay_and_what_was_not_received(tmp_path: Path) -> None:
    """10 m/s all the time: the delay grows by 1 ms with each second, and so with each 10 m, up to 119 ms at 990 m."""
    with open_recording([recorded(tmp_path)]) as recording:
        found = link_along(read_facts(recording))
    assert [(one.from_m, one.to_m) for one in found[:3]] == [(0.0, 20.0), (20.0, 40.0), (40.0, 60.0)]
    assert found[-1].to_m == pytest.approx(1200, abs=15)
    assert [one.delay_s for one in found[:3]] == [pytest.approx(s, abs=0.002) for s in (0.0205, 0.0225, 0.0245)]
    assert (found[20].most_s, found[-1].delay_s) == (pytest.approx(0.061, abs=0.002), pytest.approx(0.119))
    blind = [(one.from_m, one.blind_s) for one in found if one.blind_s > 0.5]
    assert [at_m for at_m, _ in blind] == [600.0, 620.0], "4 s of 10 m/s"
    assert sum(one.blind_s for one in found) == pytest.approx(4.0, abs=0.2)


def test_between_two_parts_there_is_neither_delay_nor_loss(tmp_path: Path) -> None:
    with open_recording(in_two_parts(tmp_path)) as recording:
        found = link_along(read_facts(recording))
    assert found[-1].to_m == pytest.approx(1800, abs=15)
    assert sum(one.blind_s for one in found) == pytest.approx(4.0, abs=0.2)
    assert found[-1].delay_s == pytest.approx(0.077, abs=0.001), "the second part begins anew; 5 s of it"


def test_a_car_that_stood_has_no_way() -> None:
    motion = Motion(10.0)
    assert link_along(DriveFacts(start_ms=0, end_ms=10_000, log=None, motion=motion, late=[(0.0, 0.02)])) == []
    motion._by_speed.add(1.0, LEAST_M - 1)
    assert link_along(DriveFacts(start_ms=0, end_ms=10_000, log=None, motion=motion, late=[(0.0, 0.02)])) == []


def drive(speeds: Steps, *, others: Sequence[float] = (), late: Steps = (), limit: Steps = ((0.0, 3.0),)) -> DriveFacts:
    """`others`: times of messages without a speed."""
    motion = Motion(ENDS_S)
    came = sorted([(at_s, speed) for at_s, speed in speeds] + [(at_s, math.nan) for at_s in others])
    for at_s, speed in came:
        motion.message_received("/any", at_s)
        if not math.isnan(speed):
            motion.value_decoded("speed", Twist(speed_mps=speed), at_s, None)
    return DriveFacts(
        start_ms=0, end_ms=round(ENDS_S * 1000), log=None, motion=motion, late=late, accelerations=limit,
        are_settings_recorded=True,
    )  # fmt: skip


def steady(
    speed_mps: float, from_s: float = 0.0, to_s: float = ENDS_S, step_s: float = 0.5
) -> list[tuple[float, float]]:
    return [(from_s + step_s * n, speed_mps) for n in range(int((to_s - from_s) / step_s) + 1)]


def test_the_way_counts_from_the_last_speed_to_the_next_message() -> None:
    (gap,) = blind_times(drive([*steady(4.0, 0.0, 10.0), *steady(4.0, 14.0)]))
    assert (gap.from_s, gap.to_s, gap.metres) == (10.0, 14.0, 4 * 4 + 3 * 16 / 2)
    (back,) = blind_times(drive([*steady(-4.0, 0.0, 10.0), *steady(4.0, 14.0)]))
    assert back.metres == gap.metres


def test_a_speed_that_fell_silent_before_the_gap_counts_from_then() -> None:
    facts = drive([*steady(4.0, 0.0, 8.0), *steady(4.0, 14.0)], others=[8.5, 9.0, 9.5, 10.0])
    (gap,) = blind_times(facts)
    assert (gap.from_s, gap.metres) == (10.0, 4 * 6 + 3 * 36 / 2)


def test_the_delay_of_the_link_is_part_of_the_way() -> None:
    facts = drive([*steady(4.0, 0.0, 10.0), *steady(4.0, 14.0)], late=[(-2.0, 0.1), (9.0, 0.3), (12.0, 2.0)])
    assert blind_times(facts)[0].metres == pytest.approx(4 * 4.45 + 3 * 4.45**2 / 2)


def test_without_a_speed_or_a_limit_it_is_not_known() -> None:
    silent = drive(steady(4.0, 20.0), others=[0.0, 0.5, 1.0])
    assert [gap.metres for gap in blind_times(silent)] == [None]
    unlimited = drive([*steady(4.0, 0.0, 10.0), *steady(4.0, 14.0)], limit=())
    assert [gap.metres for gap in blind_times(unlimited)] == [None]


def test_the_end_of_the_recording_is_blind_too_and_the_highest_limit_in_force_counts() -> None:
    facts = drive(steady(2.0, 0.0, 30.0), limit=[(0.0, 1.0), (35.0, 5.0), (39.9, 2.0)])
    (gap,) = blind_times(facts)
    assert (gap.from_s, gap.to_s, gap.metres) == (30.0, ENDS_S, 2 * 10 + 5 * 100 / 2)


def test_a_late_link_has_the_farthest_way_of_what_it_showed() -> None:
    speeds = [*steady(1.0, 0.0, 9.5), *steady(6.0, 10.0, 12.0), *steady(1.0, 12.5)]
    facts = drive(speeds, late=[(0.0, 0.1), (8.0, 0.9), (11.0, 1.5), (13.0, 0.4)])
    (late,) = late_times(facts)
    assert (late.from_s, late.to_s, late.late_s) == (8.0, 13.0, 1.65)
    assert late.metres == pytest.approx(6 * 2.15 + 3 * 2.15**2 / 2)  # 1.5 s under way, half a second until the next one
    assert late_times(drive([], late=[(0.0, 3.0)], others=steady_times()))[0].metres is None
    assert late_times(drive(speeds, late=[(0.0, 0.4)])) == []


def shown(facts: DriveFacts) -> dict[str, Any]:
    recording = cast(Recording, SimpleNamespace(count=1, damage=[], metadata={}, paths=(), files=(), start_s=0.0))
    return report_json(facts, recording, name="", load=None, verified=(), annotations=annotations.NONE)


def steady_times() -> list[float]:
    return [0.5 * n for n in range(80)]


def test_the_report_has_them_on_its_sheet_and_in_its_tables() -> None:
    facts = drive([*steady(4.0, 0.0, 10.0), *steady(4.0, 14.0)], late=[(0.0, 0.1), (20.0, 0.8), (25.0, 0.1)])
    found = shown(facts)
    assert found["blind"] == [{"from_s": 10.0, "to_s": 14.0, "unseen_m": 44.1}]
    assert found["late"] == [{"from_s": 20.0, "to_s": 25.0, "unseen_m": 8.96, "late_s": 0.95}]
    assert _blind(found, 0) == [
        ("00:00:10", "no message from the car", "≤ 44.1 m unseen", "4.0 s"),
        ("00:00:20", "messages up to 0.9 s late", "≤ 9.0 m unseen", "5.0 s"),
    ]
    assert _blind_head(found) == "metres: last speed and at most 3.0 m/s²"
    rows = {row[0]: row[-1] for row in report_rows(found) if row[0] in ("blind", "late")}
    assert rows == {"blind": "≤ 44.1 m unseen", "late": "≤ 9.0 m unseen"}
    other = replace(facts, late=(), are_settings_recorded=False)
    found = shown(other)
    assert _blind_head(found) == ("metres: last speed and at most 3.0 m/s² (as set today), delay of the link not known")

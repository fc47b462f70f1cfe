"""What is answered of a drive: small and soon for eight hours, and a sketch in the place of what is not read yet."""

from __future__ import annotations

import math
import random
import time
from dataclasses import replace

import orjson
import pytest

from monitor.alarm import MOST_MARKS, AlarmMark, AlarmMarks, Transition
from monitor.alarm_spec import Priority
from monitor.catalog import AllLimits
from monitor.drive_trends import MOST_SPANS, DriveTrends
from server.protocol.drive_trends import MOST_BUCKETS, DriveFacts, DriveTrendsAnswer, Wanted, answer, of_sketch
from tests.frames import check_shape
from tests.monitor.test_alarm import SPEC

EIGHT_HOURS_S = 8 * 3600.0
FOUR = ("speed", "distance", "brake", "steering")


def facts(length_s: float, marks: int = 0) -> DriveFacts:
    found = [
        AlarmMark(
            at_s=i * length_s / marks,
            alarm="nearest_object_slow",
            title="Nearest object slower than expected",
            priority=Priority.CRITICAL if i % 50 == 0 else Priority.WARNING,
        )
        for i in range(marks)
    ]
    return DriveFacts(now_s=length_s, start_ms=1_790_000_000_000, length_s=length_s, marks=found)


@pytest.fixture(scope="module")
def eight_hours() -> DriveTrends:
    """Numbers of all lengths every half second, with as many gaps as are kept."""
    chance = random.Random(1)
    trends = DriveTrends(0.0)
    trends.set_limits(AllLimits(), 0.0)
    for step in range(int(EIGHT_HOURS_S * 2)):
        if step % 100 < 6:  # 3 s of silence twice a minute
            continue
        for name in FOUR:
            trends._lines[name].note(chance.uniform(-123.456, 123.456), step / 2, 1.0)
    return trends


@pytest.mark.field
@pytest.mark.parametrize("part", [(0.0, math.inf), (3600.0, 7200.0), (28_000.0, 28_060.0)])
def test_any_part_of_eight_hours_comes_within_0_3_s_and_60_kB(
    eight_hours: DriveTrends, part: tuple[float, float]
) -> None:
    wanted = Wanted(signals=FOUR, from_s=part[0], to_s=part[1], buckets=500)  # as the page requests
    began_s = time.process_time()
    found = orjson.dumps(answer(eight_hours, wanted, facts(EIGHT_HOURS_S, marks=1000)))
    took_s = time.process_time() - began_s
    check_shape(found, DriveTrendsAnswer)
    assert took_s <= 0.3
    assert len(found) <= 60_000


def test_the_finest_answer_of_all_is_bounded_too(eight_hours: DriveTrends) -> None:
    wanted = Wanted(signals=FOUR, buckets=MOST_BUCKETS)
    found = answer(eight_hours, wanted, facts(EIGHT_HOURS_S, marks=1000))
    assert len(orjson.dumps(found)) <= 80_000
    assert all(len(one["gaps"]) <= MOST_SPANS for one in found["signals"].values())
    assert (len(found["marks"]), found["marks_left_out"]) == (100, 900)
    assert sum(mark["priority"] == "critical" for mark in found["marks"]) == 20  # the most urgent are kept


def test_a_sketch_stands_in_for_what_is_not_read_yet(eight_hours: DriveTrends) -> None:
    whole = answer(eight_hours, Wanted(signals=FOUR, buckets=360), facts(EIGHT_HOURS_S))
    unread = DriveTrends(0.0)
    unread.set_limits(AllLimits(), 0.0)
    known = DriveFacts(now_s=12.0, start_ms=5, length_s=EIGHT_HOURS_S)
    found = of_sketch(whole, unread, Wanted(signals=("speed", "scan"), from_s=3600.0, to_s=7200.0), known)
    check_shape(orjson.dumps(found), DriveTrendsAnswer)
    assert (found["is_sketch"], found["known_s"], found["length_s"]) == (True, 12.0, EIGHT_HOURS_S)
    first = round(found["from_s"] / found["step_s"])
    speed = found["signals"]["speed"]
    assert speed["lowest"] == whole["signals"]["speed"]["lowest"][first : first + len(speed["lowest"])]
    assert found["from_s"] <= 3600.0
    assert found["from_s"] + len(speed["lowest"]) * found["step_s"] >= 7200.0
    assert all(a < 7200.0 and b > 3600.0 for a, b in speed["gaps"])
    assert speed["limits"] == [(0.0, AllLimits().speed_limit.max_mps)]
    assert found["signals"]["scan"]["lowest"] == []  # no sketch has it
    assert found["offered"]["speed"]["has_data"]


def test_the_marks_of_a_drive_are_bounded_and_the_urgent_are_kept() -> None:
    marks = AlarmMarks()
    marks._marks = [
        AlarmMark(at_s=i, alarm="x", title="X", priority=Priority.ADVISORY if i % 2 else Priority.CRITICAL)
        for i in range(MOST_MARKS)
    ]
    one = Transition(
        alarm_id="speed_limit", spec=SPEC, occurrence=1, change="raised", at_s=1e6, text="", announces=True
    )
    marks.add(replace(one, announces=False), 1e6)
    assert marks.left_out == 0
    marks.add(one, 1e6)
    assert marks.left_out == 1
    assert len(list(marks)) == MOST_MARKS
    assert all(mark.at_s != 1 for mark in marks)  # the oldest advisory went

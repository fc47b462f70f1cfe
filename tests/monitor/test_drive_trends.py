"""The whole drive in buckets: exact lowest and highest, gaps kept as gaps, and never more memory than documented."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor import drive_trends
from monitor.catalog import AllLimits, changed
from monitor.drive_trends import BASE_S, CAPACITY, FACTOR, LEVELS, MOST_SPANS, DriveTrends, Spans
from monitor.signals import CHARTED, SIGNALS
from monitor.state import State
from monitor.values import Distance, Effort, GpsFix, Level, Twist

EIGHT_HOURS_S = 8 * 3600.0


def single(number: float) -> float:
    """As four bytes hold it."""
    return float(struct.unpack("f", struct.pack("f", number))[0])


def noted(trends: DriveTrends, *messages: tuple[float, float], horizon_s: float = 1.0) -> DriveTrends:
    for at_s, number in messages:
        trends._lines["speed"].note(number, at_s - trends.since_s, horizon_s)
    return trends


def test_every_signal_that_is_one_number_can_be_drawn() -> None:
    assert set(CHARTED) == set(SIGNALS) - {"mode"}, "who drives is a text"
    assert CHARTED["speed"] == "speed_mps"
    assert CHARTED["position"] == "alt_m"


def test_lowest_and_highest_of_each_bucket_and_nothing_where_nothing_came() -> None:
    trends = noted(DriveTrends(100.0), (100.01, 4.0), (100.05, 3.0), (100.2, 5.0), (100.8, 4.5))
    view = trends.view(["speed"], 0.0, 1.0, 10, 101.0)
    assert (view.from_s, view.step_s) == (0.0, BASE_S)
    course = view.courses["speed"]
    assert course.lowest == (3.0, None, None, 4.5)
    assert course.highest == (5.0, None, None, 4.5)
    assert course.gaps == ()  # all of it is within the signal's patience


@settings(deadline=None)
@given(
    messages=st.lists(st.tuples(st.floats(0.0, 3000.0), st.floats(-1e6, 1e6, width=32)), min_size=1, max_size=300),
    window=st.tuples(st.floats(0.0, 3000.0), st.floats(0.0, 3000.0)),
    buckets=st.integers(10, 600),
)
def test_buckets_hold_exactly_what_brute_force_finds(
    messages: list[tuple[float, float]], window: tuple[float, float], buckets: int
) -> None:
    trends = noted(DriveTrends(0.0), *sorted(messages, key=lambda one: one[0]))
    from_s, to_s = sorted(window)
    view = trends.view(["speed"], from_s, to_s, buckets, 3000.0)
    course = view.courses["speed"]
    assert len(course.lowest) <= buckets + 2
    assert view.from_s <= from_s
    assert view.from_s + len(course.lowest) * view.step_s >= to_s - 1e-6
    for i, (low, high) in enumerate(zip(course.lowest, course.highest, strict=True)):
        # Seconds and widths are multiples of a quarter: their sums are exact.
        begin_s = view.from_s + i * view.step_s
        inside = [single(number) for at_s, number in messages if begin_s <= at_s < begin_s + view.step_s]
        assert low == (min(inside) if inside else None)
        assert high == (max(inside) if inside else None)


@settings(deadline=None)
@given(st.lists(st.floats(0.01, 8.0), min_size=1, max_size=200), st.floats(1.0, 3.0))
def test_gaps_are_what_brute_force_finds(waits: list[float], horizon_s: float) -> None:
    at_s, gaps, messages = 0.0, [], []
    for wait_s in waits:
        before_s, at_s = at_s, at_s + wait_s
        if at_s - before_s > horizon_s:
            gaps.append((before_s, at_s))
        messages.append((at_s, 1.0))
    trends = noted(DriveTrends(0.0), *messages, horizon_s=horizon_s)
    course = trends.view(["speed"], 0.0, at_s, 600, at_s).courses["speed"]
    step_s = trends.view(["speed"], 0.0, at_s, 600, at_s).step_s
    # Gaps closer than a bucket are one; none is lost and none is invented.
    for begin_s, end_s in gaps:
        assert any(a <= begin_s + 1e-6 and end_s <= b + 1e-6 for a, b in course.gaps)
    for (_, end_s), (begin_s, _) in zip(course.gaps, course.gaps[1:], strict=False):
        assert begin_s - end_s >= step_s
    assert sum(b - a for a, b in course.gaps) <= sum(b - a for a, b in gaps) + step_s * len(gaps)


def test_a_signal_that_falls_silent_is_a_gap_up_to_now() -> None:
    trends = noted(DriveTrends(0.0), (0.5, 1.0), (1.0, 2.0))
    assert trends.view(["speed"], 0.0, 2.0, 10, 1.9).courses["speed"].gaps == ()
    assert trends.view(["speed"], 0.0, 9.0, 10, 9.0).courses["speed"].gaps == ((1.0, 9.0),)
    assert trends.view(["brake"], 0.0, 9.0, 10, 9.0).courses["brake"].gaps == ((0.0, 9.0),)  # never came


def test_messages_without_a_number_are_no_gap_and_no_number() -> None:
    trends = noted(DriveTrends(0.0), (0.1, 1.0), (0.6, math.nan), (1.1, math.inf), (1.6, 2.0), (2.1, math.nan))
    course = trends.view(["speed"], 0.0, 2.5, 10, 2.5).courses["speed"]
    assert course.gaps == ()
    assert course.none == ((0.6, 1.6), (2.1, 2.1)) or course.none == ((0.6, 1.6),)
    assert [number for number in course.lowest if number is not None] == [1.0, 2.0]


def test_no_message_of_any_signal_is_a_blind_time() -> None:
    trends, state = DriveTrends(0.0), State()
    for at_s in (0.2, 0.7, 5.0, 5.5):
        trends.receive(state.receive("speed", Twist(speed_mps=at_s), at_s), state, at_s)
    view = trends.view(["speed"], 0.0, 9.0, 100, 9.0)
    assert view.blind == ((0.7, 5.0), (5.5, 9.0))


@pytest.mark.parametrize(
    ("signal", "value", "number"),
    [
        ("speed", Twist(speed_mps=4.5), 4.5),
        ("brake", Effort(percent=30.0), 30.0),
        ("distance", Distance(distance_m=12.5), 12.5),
        ("position", GpsFix(lat_deg=1.0, lon_deg=2.0, alt_m=748.5), 748.5),
        ("fuel", Level(value=0.5, unit="%"), 0.5),
    ],
)
def test_each_signal_by_its_own_number(signal: str, value: object, number: float) -> None:
    trends, state = DriveTrends(0.0), State()
    assert not trends.has_data(signal)
    trends.receive(state.receive(signal, value, 0.1), state, 0.1)  # type: ignore[arg-type]
    assert trends.view([signal], 0.0, 1.0, 10, 1.0).courses[signal].lowest[0] == number
    assert trends.has_data(signal)


def test_what_comes_on_events_only_has_no_gaps() -> None:
    trends, state = DriveTrends(0.0), State()
    for at_s in (0.5, 100.0):
        trends.receive(state.receive("fuel", Level(value=1.0, unit="l"), at_s), state, at_s)
    gaps = trends.view(["fuel"], 0.0, 500.0, 100, 500.0).courses["fuel"].gaps
    assert all(begin_s == 0.0 for begin_s, _ in gaps)


def test_limits_stand_from_when_they_were_set() -> None:
    trends = DriveTrends(50.0)
    trends.set_limits(AllLimits(), 50.0)
    trends.set_limits(AllLimits(), 60.0)
    trends.set_limits(changed(AllLimits(), {"speed_limit.max_mps": 9.0}), 70.0)
    assert trends.limits("speed") == ((0.0, AllLimits().speed_limit.max_mps), (20.0, 9.0))
    assert trends.limits("distance") == ((0.0, AllLimits().obstacle.standoff_m),)
    assert trends.limits("brake") == ()


def test_eight_hours_stay_within_the_documented_memory() -> None:
    trends = DriveTrends(0.0)
    peak_s = 5 * 3600.0 + 0.1
    for second in range(int(EIGHT_HOURS_S)):
        for name in ("speed", "brake"):
            trends._lines[name].note(99.0 if abs(second - peak_s) < 0.5 else second % 7, float(second), 1.5)
    trends.view(["speed", "brake"], 0.0, EIGHT_HOURS_S, 300, EIGHT_HOURS_S)
    assert trends.bytes() <= 2 * LEVELS * CAPACITY * 8
    assert trends.bytes() / 2 < 310_000  # of each signal, measured
    whole = trends.view(["speed"], 0.0, EIGHT_HOURS_S, 300, EIGHT_HOURS_S)
    highest = [number for number in whole.courses["speed"].highest if number is not None]
    assert len(highest) <= 302
    assert max(highest) == 99.0  # one second of eight hours is not lost
    # The last minute is as fine as there is; the first hour only as its level still has it.
    assert trends.view(["speed"], EIGHT_HOURS_S - 60, EIGHT_HOURS_S, 300, EIGHT_HOURS_S).step_s == BASE_S
    assert trends.view(["speed"], 0.0, 60.0, 300, EIGHT_HOURS_S).step_s == BASE_S * FACTOR**2


def test_what_a_level_has_forgotten_is_not_taken_for_now(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drive_trends, "CAPACITY", 8)
    trends = noted(DriveTrends(0.0), (0.1, 77.0), (3.9, 1.0))
    view = trends.view(["speed"], 0.0, 4.0, 100, 4.0)
    assert view.step_s == BASE_S * FACTOR  # the finest level no longer holds the beginning
    assert view.courses["speed"].highest == (77.0, None, None, 1.0)
    late = trends.view(["speed"], 2.3, 4.0, 100, 4.0)
    assert (late.step_s, late.courses["speed"].highest[-1]) == (BASE_S, 1.0)
    assert 77.0 not in late.courses["speed"].highest


def test_spans_are_bounded_and_cover_all_that_was_added() -> None:
    spans = Spans()
    for i in range(3 * MOST_SPANS):
        spans.add(3.0 * i, 3.0 * i + 1 + 0.1 * (i % 7))
    found = spans.between(0.0, 1e9, None, apart_s=0.0)
    assert len(found) == MOST_SPANS
    assert all(any(a <= 3.0 * i and 3.0 * i + 1 <= b for a, b in found) for i in range(3 * MOST_SPANS))


@pytest.mark.parametrize(
    ("from_s", "to_s"), [(-5.0, 3.0), (0.0, 1e9), (9.0, 2.0), (1e9, 2e9), (0.0, math.inf), (0.0, 0.0)]
)
def test_whatever_part_is_requested_stays_within_the_drive(from_s: float, to_s: float) -> None:
    trends = noted(DriveTrends(0.0), (0.5, 1.0), (9.5, 2.0))
    view = trends.view(["speed"], from_s, to_s, 20, 10.0)
    assert 0.0 <= view.from_s <= 10.0
    assert 1 <= len(view.courses["speed"].lowest) <= 22
    assert all(0.0 <= a <= b <= 10.0 for a, b in view.courses["speed"].gaps)

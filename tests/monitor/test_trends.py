"""The last minute of a signal: lowest and highest of each step, holes kept as holes, and never more than a minute."""

from __future__ import annotations

import math
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.signals import SIGNALS
from monitor.state import State
from monitor.trends import NO_NUMBER, SPAN, STEP_S, TRENDS, Trends
from monitor.values import Distance, Twist


def test_lowest_and_highest_of_a_step_and_a_hole() -> None:
    trends = Trends(100.0)
    for at_s, speed in ((100.01, 4.0), (100.05, 3.0), (100.19, 5.0), (100.65, 4.4)):
        trends.note("speed", speed, at_s)
    piece = trends.piece(101.0)
    assert (piece.since, piece.first) == (500, 500)
    assert piece.now == pytest.approx(505.0)
    assert piece.rows["speed"] == ((3.0, 5.0), None, None, (4.4, 4.4), None)
    assert set(piece.rows) == set(TRENDS)
    assert piece.rows["brake"] == (None,) * 5


def test_the_step_that_is_not_over_is_not_reported() -> None:
    trends = Trends(0.0)
    trends.note("speed", 1.0, 0.1)
    assert trends.piece(0.19).rows["speed"] == ()
    assert trends.piece(0.21).rows["speed"] == ((1.0, 1.0),)


@pytest.mark.parametrize("number", [None, math.nan, math.inf, -math.inf])
def test_a_message_without_a_number_is_no_hole_and_no_number(number: float | None) -> None:
    trends = Trends(0.0)
    trends.note("distance", number, 0.1)
    trends.note("distance", number, 0.3)
    trends.note("distance", 7.0, 0.35)
    trends.note("distance", 8.0, 0.5)
    trends.note("distance", number, 0.55)
    assert trends.piece(0.7).rows["distance"] == (NO_NUMBER, (7.0, 7.0), (8.0, 8.0))


def test_what_was_before_a_minute_is_gone_and_not_taken_for_now() -> None:
    trends = Trends(0.0)
    trends.note("speed", 99.0, 0.1)
    trends.note("speed", 1.0, 59.5)
    late = trends.piece(60.1)
    assert len(late.rows["speed"]) == SPAN - 1
    assert [row for row in late.rows["speed"] if row] == [(1.0, 1.0)]
    assert set(trends.piece(3600.0).rows["speed"]) == {None}


@pytest.mark.parametrize(
    ("after", "first", "count"),
    [(None, 401, 299), (690, 691, 9), (699, 700, 0), (5, 401, 299), (10**15, 700, 0)],
)
def test_only_what_came_after(after: int | None, first: int, count: int) -> None:
    piece = Trends(0.0).piece(700 * STEP_S + 0.001, after=after)
    assert (piece.first, len(piece.rows["speed"])) == (first, count)


def test_a_few_for_each_frame() -> None:
    assert len(Trends(0.0).piece(10.0, at_most=4).rows["speed"]) == 4
    assert len(Trends(9.7).piece(10.1, at_most=4).rows["speed"]) == 2  # no step before the beginning


def test_the_state_shows_which_number_stands_for_a_signal() -> None:
    assert all(SIGNALS[name].headline for name in TRENDS)
    state, trends = State(), Trends(0.0)
    for at_s, speed in ((0.05, 3.0), (0.1, 2.5)):
        trends.receive(state.receive("speed", Twist(speed_mps=speed, yaw_rate_radps=None), at_s), state, at_s)
    trends.receive(state.receive("distance", Distance(distance_m=None, none_in_range=True), 0.1), state, 0.1)
    rows = trends.piece(0.3).rows
    assert rows["speed"] == ((2.5, 3.0),)
    assert rows["distance"] == (NO_NUMBER,)


@given(st.lists(st.tuples(st.floats(0, 200), st.floats(-50, 50)), max_size=200))
def test_nothing_is_invented(received: list[tuple[float, float]]) -> None:
    trends = Trends(0.0)
    received.sort(key=lambda one: one[0])
    for at_s, number in received:
        trends.note("speed", number, at_s)
    end_s = (received[-1][0] if received else 0.0) + STEP_S
    piece = trends.piece(end_s)
    for i, row in enumerate(piece.rows["speed"]):
        expected = [number for at_s, number in received if math.floor(at_s / STEP_S) == piece.first + i]
        assert row == ((min(expected), max(expected)) if expected else None)


def test_an_hour_at_75_hz_takes_no_more_room_than_a_minute() -> None:
    trends = Trends(0.0)
    line = trends._lines["distance"]
    before = [sys.getsizeof(ring) for ring in (line.step, line.lowest, line.highest)]
    for i in range(3600 * 75 // 10):
        trends.note("distance", float(i), i / 7.5)
    assert [sys.getsizeof(ring) for ring in (line.step, line.lowest, line.highest)] == before

"""Small parts of the judge exactly at their limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from monitor.alarm import Alarm
from monitor.alarm_spec import Priority
from monitor.car_clock import AHEAD_S, CONTRADICTION_S, IN_TIME_S, SAME_JUMP_S, SAMPLES, CarClock, StampedDelay, merged
from monitor.catalog import AllLimits, changed
from monitor.checks.signal_slow import expected_rates, set_hz
from monitor.components import FORGOTTEN_AFTER_S, ONE_INTERVAL_S, SILENT_AFTER_S, Components
from monitor.freeze_detection import Repeats
from monitor.inhibition import CauseTable, standing, suppressed, table_of
from monitor.instruments import ObstacleLimits, stopping_m, time_gap_s
from monitor.motion import Slope
from monitor.obstacle_view import corridor_ahead
from monitor.reading import AT_MOST_S, BEFORE_S, Reading, ReadingHistory, Unusable, with_unusable, without_unusable
from monitor.snapshot import NotFresh
from monitor.values import Component, Diagnostics, Steering, Twist
from tests.monitor.checks.known import known
from tests.monitor.test_alarm import BAD, SPEC


def alarm(name: str, priority: Priority = Priority.WARNING, **fields: Any) -> Alarm:
    return replace(Alarm(id=name, spec=replace(SPEC, priority=priority)), **fields)


def test_the_most_urgent_stands_first_and_of_those_the_newest_and_the_shelf_comes_last() -> None:
    alarms = [
        alarm("shelved", Priority.CRITICAL, active=True, shelved_until_s=9.0, announced_s=9.0),
        alarm("quiet shelf", shelved_until_s=9.0),
        alarm("old", active=True, announced_s=1.0),
        alarm("never", active=True),
        alarm("new", active=True, announced_s=2.0),
        alarm("early", active=True, announced_s=0.5),
        alarm("unseen", acknowledged=False, announced_s=1.5),
        alarm("critical", Priority.CRITICAL, active=True, announced_s=0.1),
        alarm("explained", Priority.CRITICAL, active=True, suppressed_by=("x",)),
        alarm("off", Priority.CRITICAL, active=True, out_of_service=True),
        alarm("rest"),
    ]
    names = ["critical", "new", "unseen", "old", "early", "never", "shelved", "quiet shelf"]
    assert [one.id for one in standing(alarms)] == names
    hidden = [
        alarm("b", active=True, suppressed_by=("x",)),
        alarm("a", finding=BAD, suppressed_by=("x",)),
        alarm("c", Priority.CRITICAL, acknowledged=False, suppressed_by=("x",)),
        alarm("stands", active=True),
        alarm("well", suppressed_by=("x",)),
    ]
    assert [one.id for one in suppressed(hidden)] == ["c", "a", "b"]


def test_two_inhibitors_of_one_alarm_both_explain_it_and_so_do_theirs() -> None:
    table = CauseTable({"effect": ("one", "two"), "one": ("root",), "two": (), "root": ()})
    assert table.inhibitors == {"one", "two", "root"}
    for name in ("one", "two", "root"):
        table.note(alarm(name, condition=True), 1.0)
    assert table.holding("effect", 1.0) == ("one", "root", "two")
    spec = replace(SPEC, inhibited_by=("cause",))
    of = table_of([alarm("cause", condition=True), replace(alarm("effect"), spec=spec)])
    of.note(alarm("cause", condition=True), 1.0)
    assert (of.order, of.holding("effect", 1.0)) == (["cause", "effect"], ("cause",))
    graced = table_of([replace(alarm("cause"), spec=replace(SPEC, grace_s=3.0)), replace(alarm("effect"), spec=spec)])
    graced.note(alarm("cause", condition=True), 1.0)
    graced.note(alarm("cause"), 2.0)
    assert [graced.holding("effect", now_s) for now_s in (4.9, 5.0)] == [("cause",), ()]


def test_the_car_s_clock_is_known_between_question_and_answer() -> None:
    clock = CarClock()
    assert (clock.ahead_s, clock.requested_s, clock.epoch) == (None, None, 0)
    clock.answered(10.0, 10.5, 110.3)  # ahead by 99.8 … 100.3 s
    assert (clock.ahead_s, clock.requested_s, clock.epoch) == (pytest.approx(100.3), 10.0, 0)
    clock.answered(11.0, 11.2, 111.1)  # 99.9 … 100.1
    assert clock.ahead_s == pytest.approx(100.1)
    clock.answered(12.0, 12.9, 112.8)  # 99.9 … 100.8: the closest counts
    assert (clock.ahead_s, clock.requested_s, clock.epoch) == (pytest.approx(100.1), 12.0, 0)


@pytest.mark.parametrize(("by_s", "is_another"), [(0.99, False), (1.01, True), (-0.99, False), (-1.01, True)])
def test_two_answers_that_contradict_each_other_are_of_two_clocks(by_s: float, is_another: bool) -> None:
    clock = CarClock()
    clock.answered(10.0, 10.0, 110.0)
    clock.answered(11.0, 11.0, 111.0 + by_s * CONTRADICTION_S)
    assert clock.epoch == int(is_another)
    newest_s = 100.0 + by_s * CONTRADICTION_S
    assert clock.ahead_s == pytest.approx(newest_s if is_another else min(100.0, newest_s))


def test_an_old_answer_counts_no_more() -> None:
    clock = CarClock()
    clock.answered(0.0, 1.0, 100.0)
    for number in range(SAMPLES):
        assert clock.ahead_s == pytest.approx(100.0)
        clock.answered(number + 1.0, number + 1.9, number + 101.5)
    assert clock.ahead_s == pytest.approx(100.5)


@pytest.mark.parametrize(
    ("late_s", "is_known"),
    [
        (0.0, True),
        (IN_TIME_S - 0.01, True),
        (IN_TIME_S + 0.01, False),
        (0.01 - AHEAD_S, True),
        (-0.01 - AHEAD_S, False),
    ],
)
def test_stamps_are_of_that_clock_where_they_were_once_in_time(late_s: float, is_known: bool) -> None:
    clock, delay = CarClock(), StampedDelay()
    assert delay.late_s(1.0, 5.0, clock) is None
    clock.answered(10.0, 10.0, 110.0)
    assert delay.late_s(111.0 - late_s, 11.0, clock) == (pytest.approx(late_s) if is_known else None)
    if is_known:
        assert delay.late_s(113.0, 20.0, clock) == pytest.approx(7.0)  # once in time, it is late now
        clock.answered(30.0, 30.0, 500.0)  # another clock: nothing is known of its stamps
        assert delay.late_s(501.0, 40.0, clock) is None


def test_stamps_that_step_back_count_again_after_the_next_answer() -> None:
    clock, delay = CarClock(), StampedDelay()
    clock.answered(10.0, 10.0, 110.0)
    assert delay.late_s(111.0, 11.0, clock) == pytest.approx(0.0)
    assert delay.late_s(110.9, 12.0, clock) is None
    assert delay.late_s(113.0, 13.0, clock) is None
    clock.answered(12.0, 12.0, 112.0)
    assert delay.late_s(114.0, 14.0, clock) is None  # requested when they stepped back
    clock.answered(14.5, 14.5, 114.5)
    assert delay.late_s(115.0, 15.0, clock) == pytest.approx(0.0)


def test_unusable_messages_are_counted_in_a_row() -> None:
    one = with_unusable({}, "speed", "x is not a number", 1.0, 0.5, 0.1)
    assert dict(one) == {
        "speed": Unusable(reason="x is not a number", at_s=1.0, since_s=1.0, count=1, horizon_s=0.5, period_s=0.1)
    }
    two = with_unusable(one, "speed", "no field x", 2.0, 0.5, None)
    assert two["speed"] == Unusable(reason="no field x", at_s=2.0, since_s=1.0, count=2, horizon_s=0.5, period_s=None)
    both = with_unusable(two, "brake", "no field x", 3.0, 0.5, None)
    assert (both["brake"].count, both["speed"].count) == (1, 2)
    assert set(without_unusable(both, "speed")) == {"brake"}
    assert [two["speed"].is_coming(now_s) for now_s in (2.5, 2.501)] == [True, False]


@pytest.mark.parametrize(
    ("reason", "text"),
    [
        ("x.y is not a number", "not a number (x.y)"),
        ("x is not a number, but z", "x is not a number, but z"),
        ("no x", "no x"),
    ],
)
def test_the_reason_as_it_follows_a_name(reason: str, text: str) -> None:
    assert replace(with_unusable({}, "speed", reason, 1.0, 0.5, None)["speed"]).text == text


@pytest.mark.parametrize(
    ("speed_mps", "metres", "gap_s"),
    [
        (0.0, 0.0, None),
        (0.1, 0.1 + 0.01 / 6, None),
        (0.2, 0.2 + 0.04 / 6, 50.0),
        (6.0, 12.0, 10.0 / 6),
        (-6.0, 12.0, None),
    ],
)
def test_stopping_distance_and_time_gap(speed_mps: float, metres: float, gap_s: float | None) -> None:
    assert stopping_m(speed_mps, ObstacleLimits()) == pytest.approx(metres)
    assert time_gap_s(10.0, speed_mps) == (None if gap_s is None else pytest.approx(gap_s))


@pytest.mark.parametrize(
    ("tyre_rad", "angle_rad"),
    [(0.0, 0.0), (0.101, 0.1), (-0.104, -0.105), (0.9, 0.6), (-0.9, -0.6), (None, 0.0), (math.nan, 0.0)],
)
@pytest.mark.parametrize(("was_active", "half_m"), [(False, 1.2), (True, 1.4)])
def test_the_corridor_is_bent_by_the_tyres_and_wider_while_alarmed(
    tyre_rad: float | None, angle_rad: float, was_active: bool, half_m: float
) -> None:
    snapshot = known(steering=Steering(percent=0.0, tyre_rad=tyre_rad))
    corridor = corridor_ahead(snapshot, ObstacleLimits(), was_active=was_active)
    assert corridor.tyre_angle_rad == pytest.approx(angle_rad)
    assert corridor.half_width_m == pytest.approx(half_m)
    assert (corridor.wheelbase_m, corridor.laser_ahead_m) == (2.62, 2.5)


def reading(at_s: float) -> Reading[Any]:
    return Reading(value=at_s, received_s=at_s, horizon_s=1.0)


@pytest.mark.parametrize(
    ("times", "before"),
    [
        ([0.0], None),
        ([0.0, BEFORE_S - 0.01], None),
        ([0.0, BEFORE_S], 0.0),
        ([0.0, AT_MOST_S], 0.0),
        ([0.0, AT_MOST_S + 0.01], None),
        ([0.0, 0.25, 0.5, 0.75, 1.0], 0.5),
        ([100.0, 100.5, 0.0, 0.5], 0.0),  # the clock went back
        ([100.0, 100.5, 101.0], 100.5),
    ],
)
def test_the_reading_before_is_old_enough_and_not_too_old(times: list[float], before: float | None) -> None:
    history = ReadingHistory()
    for at_s in times:
        history.add(reading(at_s))
    assert (history.before and history.before.received_s) == before


def test_a_component_is_stale_after_its_time_and_forgotten_in_the_end() -> None:
    def message_of(name: str) -> Diagnostics:
        return Diagnostics(components=(Component(name=name, level=0, message="fine"),))

    known_parts = Components()
    for at_s, name in [
        (100.0, "a"),
        (101.0, "a"),
        (101.0, "a"),
        (102.0, "a"),
        (198.0, "b"),
        (199.0, "b"),
        (200.0, "b"),
    ]:
        found = known_parts.merge(message_of(name), at_s)
    assert [one.name for one in found.components] == ["b"]
    known_parts.merge(message_of("c"), 200.0)
    found = known_parts.merge(message_of("c"), 200.0 + SILENT_AFTER_S)
    assert [(one.name, one.level) for one in found.components] == [("b", 0), ("c", 0)]
    found = known_parts.merge(message_of("c"), 206.0)
    assert [(one.name, one.level, one.message) for one in found.components] == [
        ("b", 3, "no report for 6 s"),
        ("c", 0, "fine"),
    ]
    assert [one.name for one in known_parts.merge(message_of("c"), 200.0 + FORGOTTEN_AFTER_S).components] == ["b", "c"]
    assert [one.name for one in known_parts.merge(message_of("c"), 200.1 + FORGOTTEN_AFTER_S).components] == ["c"]
    assert Diagnostics(components=()).worst == 0


def test_a_slow_component_gets_three_times_its_period_and_a_second_message_at_once_is_no_period() -> None:
    def merge(parts: Components, at_s: float, *names: str) -> dict[str, int]:
        message = Diagnostics(components=tuple(Component(name=name, level=0, message="") for name in names))
        return {one.name: one.level for one in parts.merge(message, at_s).components}

    parts = Components()
    for at_s in (90.0, 100.0, 110.0):
        merge(parts, at_s, "slow")
    assert merge(parts, 140.0, "other")["slow"] == 0
    assert merge(parts, 140.1, "other")["slow"] == 3
    merge(parts, 150.0, "twice", "twice")
    merge(parts, 151.0, "twice", "twice")
    assert merge(parts, 151.0 + ONE_INTERVAL_S, "other")["twice"] == 0
    assert merge(parts, 151.1 + ONE_INTERVAL_S, "other")["twice"] == 3


def test_rates_that_are_set_and_rates_that_are_learned() -> None:
    limits = AllLimits()
    assert expected_rates(limits) == {}
    limits = changed(limits, {"signals.speed_hz": 0.5})
    assert expected_rates(limits) == {"speed": 0.5}
    assert set_hz(limits.signals, "speed") == 0.5  # type: ignore[attr-defined]
    assert set_hz(limits.signals, "unknown signal") == 0.0  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("after_s", "by_s", "is_one"),
    [
        (0.0, -2.0, True),
        (SAME_JUMP_S, -2.0, True),
        (SAME_JUMP_S + 0.01, -2.0, False),
        (-0.1, -2.0, False),
        (0.0, 2.0, False),
    ],
)
def test_a_jump_that_several_signals_show_is_one(after_s: float, by_s: float, is_one: bool) -> None:
    first = merged(None, "speed", 100.0, -3.0)
    assert (first.at_s, first.by_s, first.signals) == (100.0, -3.0, ("speed",))
    second = merged(first, "brake", 100.0 + after_s, by_s)
    expected = (100.0, -3.0, ("speed", "brake")) if is_one else (100.0 + after_s, by_s, ("brake",))
    assert (second.at_s, second.by_s, second.signals) == expected
    assert merged(first, "speed", 100.0, -2.0).signals == ("speed",)


def test_a_slope_keeps_the_newest_that_are_enough() -> None:
    slope = Slope()
    for number in range(60):
        found = slope.add(0.05 * number, 0.0 if number < 30 else 0.05 * (number - 30))
    assert found == pytest.approx(1.0)
    assert slope.add(2.0, 0.0) is None  # the clock went back
    assert slope.add(2.1, math.nan) is None


def test_a_repeat_knows_nothing_at_first() -> None:
    assert (Repeats().stamp_n, Repeats().stamp_s) == (0, 0.0)


@pytest.mark.parametrize(
    ("has_value", "age_s", "is_unusable", "why", "short"),
    [
        (True, 1.0, True, None, ""),  # a fresh value counts, whatever came after it
        (True, 1.1, True, "Speed: not a number (x)", "unusable"),
        (False, 0.0, True, "Speed: not a number (x)", "unusable"),
        (True, 1.1, False, "Speed is 1.1 s old", "stale"),
        (False, 0.0, False, "Speed is not published", "no data"),
    ],
)
def test_why_a_value_is_not_there(
    has_value: bool, age_s: float, is_unusable: bool, why: str | None, short: str
) -> None:
    snapshot = known(age_s=age_s, speed=Twist(speed_mps=3.0) if has_value else None)
    if is_unusable:
        snapshot = replace(snapshot, unusable=with_unusable({}, "speed", "x is not a number", 100.0, 1.0, None))
    if why is None:
        assert snapshot.need("speed").speed_mps == 3.0
        return
    with pytest.raises(NotFresh) as missing:
        snapshot.need("speed")
    assert (missing.value.why, missing.value.short) == (why, short)

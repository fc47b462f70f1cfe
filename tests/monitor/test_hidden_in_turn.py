"""Conditions that are never announced, in any order and overlap: what they explain is announced within a bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor.alarm_spec import AlarmSpec
from monitor.check import OK, Finding, fault, unknown
from monitor.inhibition import GRACE_S, UNSEEN_S
from monitor.runner import Monitor
from tests.monitor.test_alarm import SPEC
from tests.monitor.test_runner import Script, at, check

BAD = fault("bad")
UNKNOWN = unknown("no value")
TICK_S = 0.1
EXPLAIN: dict[str, AlarmSpec] = {
    "late": replace(SPEC, on_delay_s=1.0, off_delay_s=2.0, grace_s=GRACE_S),
    "silent": replace(SPEC, on_delay_s=2.0, off_delay_s=0.0, grace_s=GRACE_S, inhibited_by=("late",)),
    "overload": replace(SPEC, on_delay_s=5.0, off_delay_s=1.0),
}
SLOW = replace(SPEC, on_delay_s=5.0, off_delay_s=2.0, inhibited_by=("silent", "overload"))
# It may be hidden first at the end of its own delay, then for the longest of theirs, and as long as what explains these
# hides them (the late link hides the silent car), and begins its delay once more.
WITHIN_S = 2.0 * SLOW.on_delay_s + (5.0 + UNSEEN_S) + (1.0 + UNSEEN_S) + 4 * TICK_S


class Car:
    """Four checks whose findings are written by hand."""

    def __init__(self) -> None:
        self.scripts = {name: Script() for name in (*EXPLAIN, "slow")}
        specs = EXPLAIN | {"slow": SLOW}
        self.monitor = Monitor([check(name, script, alarm=specs[name]) for name, script in self.scripts.items()])
        self.ticks = 0
        self.announced: list[tuple[float, str]] = []

    @property
    def now_s(self) -> float:
        return self.ticks * TICK_S

    def tick(self, **findings: Finding) -> None:
        self.ticks += 1
        for name, finding in findings.items():
            self.scripts[name].finding = finding
        happened = self.monitor.step(at(self.now_s))
        self.announced += [(self.now_s, transition.alarm_id) for transition in happened if transition.announces]


def shorter_than_its_delay(name: str) -> st.SearchStrategy[list[bool]]:
    """Whether the condition holds at each tick, to be repeated: never for as long as its alarm's on-delay."""
    most = round(EXPLAIN[name].on_delay_s / TICK_S) - 1
    phase = st.tuples(st.integers(1, most), st.one_of(st.integers(1, 60), st.integers(80, 125)))
    return st.lists(phase, min_size=1, max_size=3).map(
        lambda phases: [holds for on, off in phases for holds in (True,) * on + (False,) * off]
    )


SCHEDULES = st.fixed_dictionaries({name: shorter_than_its_delay(name) for name in EXPLAIN})


@settings(max_examples=50)
@given(SCHEDULES, st.integers(0, 100))
def test_a_signal_that_is_slow_for_good_is_announced(schedules: dict[str, list[bool]], well_ticks: int) -> None:
    car = Car()
    for tick in range(well_ticks + round(WITHIN_S / TICK_S)):
        found = {name: BAD if holds[tick % len(holds)] else OK for name, holds in schedules.items()}
        car.tick(**found, slow=OK if tick < well_ticks else BAD)
    assert [name for _, name in car.announced] == ["slow"]


def in_turn(car: Car, for_s: float, slow: Finding) -> None:
    """The link is late for 0.8 s, and 6 s later there is an overload of 4.9 s; both are over before they come again."""
    until = car.ticks + round(for_s / TICK_S)
    while car.ticks < until:
        tick = car.ticks % 130
        car.tick(late=BAD if tick < 8 else OK, overload=BAD if 60 <= tick < 109 else OK, slow=slow)


def test_two_in_turn_hide_a_slow_signal_for_a_bounded_time() -> None:
    car = Car()
    in_turn(car, 60.0, OK)
    in_turn(car, 60.0, BAD)
    assert [name for _, name in car.announced] == ["slow"]
    assert car.announced[0][0] < 60.0 + WITHIN_S


@pytest.mark.parametrize(("before_s", "announced"), [(6.0, ["late"]), (15.0, ["slow", "late"])])
def test_what_an_announced_alarm_explains_is_hidden_and_its_time_begins_anew(
    before_s: float, announced: list[str]
) -> None:
    car = Car()
    in_turn(car, before_s, BAD)
    for _ in range(300):
        car.tick(late=BAD, overload=OK, slow=BAD)
    for tick in range(40):
        car.tick(late=OK, overload=BAD if tick > 25 else OK, slow=BAD)
    assert [name for _, name in car.announced] == announced
    assert car.monitor.alarms["slow"].suppressed_by == ("overload",)


@pytest.mark.parametrize(
    ("absence", "absent_s", "announced"),
    [(OK, 2.0, ["slow"]), (UNKNOWN, 2.0, ["slow"]), (UNKNOWN, 9.0, ["slow"]), (OK, 9.0, [])],
    ids=["moments", "unknown", "long unknown", "long"],
)
def test_a_fault_that_comes_and_goes_begins_anew_after_a_long_absence_only(
    absence: Finding, absent_s: float, announced: list[str]
) -> None:
    car = Car()
    for _ in range(9):
        in_turn(car, 2.0, BAD)
        in_turn(car, absent_s, absence)
    in_turn(car, SLOW.on_delay_s + 2 * TICK_S, BAD)
    assert [name for _, name in car.announced] == announced


OF_MESSAGES = ("link_lost", "link_late_moving", "link_late", "car_silent", "no_message")


def announced_of_link(seconds: float, found: Callable[[float], dict[str, Finding]]) -> list[str]:
    """What the alarms of catgraph itself announce; `stale` is of each signal."""
    specs = {name: alarm.spec for name, alarm in Monitor().alarms.items()}
    stale = [name for name in specs if name.startswith("signal_stale.")]
    scripts = {name: Script() for name in (*OF_MESSAGES, *stale)}
    monitor = Monitor([check(name, script, alarm=specs[name]) for name, script in scripts.items()])
    announced = []
    for tick in range(round(seconds / TICK_S)):
        now = found(tick * TICK_S)
        for name, script in scripts.items():
            script.finding = now.get("stale" if name in stale else name, OK)
        happened = monitor.step(at((tick + 1) * TICK_S))
        announced += [transition.alarm_id for transition in happened if transition.announces]
    return announced


@pytest.mark.parametrize(
    ("found", "announced"),
    [
        (lambda t: {"link_late_moving": BAD if t < 0.3 else OK, "link_late": BAD, "stale": BAD}, "link_late"),
        (lambda t: {"link_late_moving": BAD if t < 0.3 else UNKNOWN, "link_late": BAD, "stale": BAD}, "link_late"),
        (lambda t: {"link_late_moving": BAD if t % 1 < 0.3 else OK, "link_late": BAD, "stale": BAD}, "link_late"),
        (
            lambda t: {
                "link_late_moving": BAD if t < 0.3 else OK,
                "link_late": BAD if t % 1.5 < 0.75 else OK,
                "car_silent": BAD if t >= 1.95 else OK,
                "stale": BAD,
            },
            "car_silent",
        ),
    ],
    ids=["moved for a moment", "whether it moves is not known", "moves for moments", "late for moments, then silent"],
)
def test_what_explains_all_signals_is_announced_alone_also_where_something_hides_it_for_a_while(
    found: Callable[[float], dict[str, Finding]], announced: str
) -> None:
    assert announced_of_link(20.0, found) == [announced]

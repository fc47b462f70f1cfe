"""The alarm load after EEMUA 191: how many in ten minutes, what is a flood, what chatters."""

from __future__ import annotations

import pytest

from monitor.alarm import Change, Transition
from monitor.load import KEPT, RecentLoad, most_within
from tests.monitor.test_alarm import SPEC


def change_of(at_s: float, change: Change = "raised", name: str = "a", announces: bool = True) -> Transition:
    return Transition(
        alarm_id=name,
        spec=SPEC,
        occurrence=1,
        change=change,
        at_s=at_s,
        text="",
        announces=announces and change in ("raised", "recaused", "unshelved"),
    )


@pytest.mark.parametrize(
    ("announced", "now_s", "number", "flood", "bearable"),
    [
        ([], 0.0, 0, False, True),
        ([0.0], 0.0, 1, False, True),
        ([0.0], 599.9, 1, False, True),
        ([0.0], 600.0, 0, False, True),
        ([0.0, 1.0], 2.0, 2, False, False),
        ([float(n) for n in range(10)], 10.0, 10, False, False),
        ([float(n) for n in range(11)], 11.0, 11, True, False),
        ([float(n) for n in range(11)], 600.5, 10, False, False),
        ([-30.0], 10.0, 1, False, True),  # announced before this run
    ],
)
def test_alarms_of_the_last_ten_minutes(
    announced: list[float], now_s: float, number: int, flood: bool, bearable: bool
) -> None:
    recent = RecentLoad()
    for at_s in announced:
        recent.add([change_of(at_s, name=f"alarm {at_s}")])
    load = recent.at(now_s)
    assert (load.in_10_min, load.is_flood, load.is_bearable) == (number, flood, bearable)


def test_only_what_is_announced_loads_the_operator() -> None:
    recent = RecentLoad()
    recent.add(
        [
            change_of(0.0, announces=False),
            change_of(1.0, "acknowledged"),
            change_of(2.0, "shelved"),
            change_of(3.0, "cleared"),
        ]
    )
    recent.add([change_of(4.0, "recaused"), change_of(5.0, "unshelved")])
    assert recent.at(6.0).in_10_min == 2


@pytest.mark.parametrize(
    ("turns", "now_s", "chattering"),
    [
        ([0.0, 10.0], 20.0, False),
        ([0.0, 10.0, 20.0], 20.0, True),
        ([0.0, 10.0, 20.0], 59.9, True),
        ([0.0, 10.0, 20.0], 60.0, False),
        ([0.0, 30.0, 61.0], 61.0, False),
    ],
)
def test_an_alarm_that_turns_three_times_in_a_minute_chatters(
    turns: list[float], now_s: float, chattering: bool
) -> None:
    recent = RecentLoad()
    for number, at_s in enumerate(turns):
        recent.add([change_of(at_s, "cleared" if number % 2 else "raised"), change_of(at_s, "acknowledged", name="b")])
    load = recent.at(now_s)
    assert load.chattering == (("a",) if chattering else ())
    if chattering:
        assert not load.is_bearable


def test_three_alarms_of_one_turn_each_do_not_chatter() -> None:
    recent = RecentLoad()
    recent.add([change_of(float(n), name=name) for n, name in enumerate("abc")])
    assert recent.at(3.0).chattering == ()


@pytest.mark.parametrize("back_s", [1.0, 300.0, 1e9])
def test_a_clock_that_went_back_makes_no_flood_and_forgets_in_time(back_s: float) -> None:
    recent = RecentLoad()
    recent.add([change_of(2e9)])
    assert recent.at(2e9 - back_s).in_10_min == (1 if back_s < 600 else 0)
    recent.add([change_of(2e9 - back_s)])
    assert 1 <= recent.at(2e9 - back_s).in_10_min <= 2


def test_a_storm_is_bounded_in_memory() -> None:
    recent = RecentLoad()
    recent.add(change_of(n / 1000, name=f"{n}") for n in range(3 * KEPT))
    assert recent.at(15.0).in_10_min == KEPT
    assert recent.at(15.0).is_flood


@pytest.mark.parametrize(
    ("times", "most"), [([], 0), ([1.0], 1), ([0, 60.0], 2), ([0, 60.1], 1), ([0, 1, 2, 90, 91], 3)]
)
def test_the_most_within_one_minute(times: list[float], most: int) -> None:
    assert most_within(times, 60.0) == most

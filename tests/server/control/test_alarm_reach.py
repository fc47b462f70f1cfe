"""Which phones can alarm right now, and how many operators that are."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.shell_facts import ReachFacts
from server.control.alarm_reach import BLIND_S, FORGOTTEN_S, FRESH_S, MOST, MOST_SHOWN, AlarmReach, Present
from server.control.lease import Operator
from server.protocol.operator_state import ReaderEnded

READY = Present(is_visible=True, sound="ready", awake="ready", vibrates=True, battery=0.5, is_charging=False, lag_s=0.1)


def one(name: str, page: str = "", who: str = "") -> Operator:
    return Operator(page=page or f"page-{name}", who=who or f"device-{name}", name=name)


def test_a_server_without_pages_reaches_nobody() -> None:
    assert AlarmReach().facts(0.0) == ReachFacts(can=0, of=0, why="")


@pytest.mark.parametrize(
    ("status", "age_s", "why"),
    [
        (READY, 0.0, None),
        (READY, FRESH_S, None),
        (READY, FRESH_S + 0.01, "silent"),
        (replace(READY, is_visible=False), 0.0, "hidden"),
        (replace(READY, lag_s=BLIND_S), 0.0, None),
        (replace(READY, is_drawing=False), 0.0, "undrawn"),
        (replace(READY, lag_s=BLIND_S + 0.1), 0.0, "blind"),  # its status arrives, and it receives no state itself
        (replace(READY, is_replaying=True), 0.0, "replay"),
        (replace(READY, sound="refused"), 0.0, "sound"),
        (replace(READY, sound="asks"), 0.0, "sound"),
        (replace(READY, sound="missing"), 0.0, "sound"),
        (replace(READY, sound="interrupted"), 0.0, "sound"),  # an iPhone that is called
        (replace(READY, awake="refused"), 0.0, None),  # it may fall asleep, and then reports nothing
        (replace(READY, awake="missing", vibrates=False, battery=None, is_charging=None), 0.0, None),
    ],
)
def test_what_keeps_a_phone_from_alarming(status: Present, age_s: float, why: ReaderEnded | None) -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann"), status, 10.0)
    (page,) = reach.all(10.0 + age_s)
    assert page.why_not(10.0 + age_s) == why
    assert reach.facts(10.0 + age_s).can == (1 if why is None else 0)


def test_two_of_three_operators() -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann"), READY, 0.0)
    reach.update_status(one("Ben"), READY, 0.0)
    reach.update_status(one("Cem"), replace(READY, sound="refused"), 0.0)
    assert reach.facts(1.0) == ReachFacts(can=2, of=3, why="sound off")
    reach.update_status(one("Cem"), READY, 2.0)
    assert reach.facts(3.5) == ReachFacts(can=1, of=3, why="2 × no contact")


def test_two_pages_of_one_device_are_one_operator_reached_by_either() -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann", "page-1"), replace(READY, is_visible=False), 0.0)
    reach.update_status(one("Ann", "page-2"), READY, 0.0)
    assert reach.facts(0.0) == ReachFacts(can=1, of=1, why="")
    reach.update_status(one("Ann", "page-3"), replace(READY, sound="refused"), 0.2)
    assert reach.facts(0.2) == ReachFacts(can=1, of=1, why="")
    reach.update_status(one("Ann", "page-2"), replace(READY, sound="asks"), 0.5)
    assert reach.facts(0.5).can == 0


def test_who_sleeps_counts_for_five_minutes_and_who_leaves_does_not() -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann"), READY, 0.0)
    reach.update_status(one("Ben"), READY, 0.0)
    reach.leave(one("Ben"))
    assert reach.facts(FORGOTTEN_S) == ReachFacts(can=0, of=1, why="no contact")
    assert reach.facts(FORGOTTEN_S + 0.1).of == 0


def test_no_more_than_so_many_pages_are_kept_and_the_newest_stay() -> None:
    reach = AlarmReach()
    for number in range(MOST + 5):
        reach.update_status(one(f"{number:03}"), READY, number / 100)
    assert len(reach.all(1.0)) == MOST
    assert reach.all(1.0)[0].of.name == "005"


def test_the_state_shows_each_page_and_how_many_it_leaves_out() -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann"), replace(READY, sound="refused"), 0.0)
    shown = reach.as_json(0.5)
    assert shown == {
        "can": 0, "of": 1, "why": "sound off", "left_out": 0,
        "pages": [{
            "page": "page-Ann", "name": "Ann", "can": False, "why": "sound", "why_text": "sound off", "here": True,
            "awake": "ready", "vibrates": True, "battery": 0.5, "charging": False, "heard_s": 0.5,
        }],
    }  # fmt: skip
    for number in range(MOST_SHOWN):
        reach.update_status(one(str(number)), READY, 0.0)
    assert (len(reach.as_json(0.0)["pages"]), reach.as_json(0.0)["left_out"]) == (MOST_SHOWN, 1)


@pytest.mark.parametrize(
    ("status", "age_s", "can"),
    [
        (READY, 0.0, 1),
        (READY, FRESH_S, 1),
        (READY, FRESH_S + 0.01, 0),
        (replace(READY, is_visible=False), 0.0, 0),
        (replace(READY, is_drawing=False), 0.0, 0),
        (replace(READY, lag_s=BLIND_S + 0.1), 0.0, 0),
        (replace(READY, is_replaying=True), 0.0, 0),
        (replace(READY, sound="asks"), 0.0, 0),
        (replace(READY, sound="interrupted"), 0.0, 0),
    ],
)
def test_a_page_of_another_car_counts_only_while_it_would_sound(status: Present, age_s: float, can: int) -> None:
    reach = AlarmReach()
    reach.update_status_elsewhere(one("Ann"), status, 10.0)
    assert reach.facts(10.0 + age_s) == ReachFacts(can=can, of=can, why="")  # of one that cannot nothing is expected
    assert (reach.all(10.0), reach.heard_s(), reach.is_here(one("Ann"), 10.0)) == ([], None, False)
    assert reach.find("page-Ann", 10.0) is None
    reach.update_status(one("Ben"), replace(READY, sound="refused"), 10.0 + age_s)
    assert reach.facts(10.0 + age_s) == ReachFacts(can=can, of=can + 1, why="sound off")


def test_a_page_of_another_car_leaves_and_is_one_operator_with_a_page_that_is_here() -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann", "page-1"), replace(READY, sound="refused"), 0.0)
    reach.update_status_elsewhere(one("Ann", "page-2"), READY, 0.0)
    assert reach.facts(0.0) == ReachFacts(can=1, of=1, why="")
    reach.leave_elsewhere(one("Ann", "page-2"))
    assert reach.facts(0.0) == ReachFacts(can=0, of=1, why="sound off")
    for number in range(MOST + 5):
        reach.update_status_elsewhere(one(f"{number:03}"), READY, 1.0)
    assert reach.facts(1.0).can == MOST


def test_a_page_in_which_a_key_was_pressed_is_here_and_sounds_no_alarm_by_that() -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann"), READY, 0.0)
    reach.update_status(one("Ben"), replace(READY, is_visible=False), 0.0)
    for name in ("Ann", "Ben", "Cem"):
        reach.note_command(one(name), 5.0)
    assert [reach.is_here(one(name), 5.0) for name in ("Ann", "Ben", "Cem")] == [True, False, False]
    assert reach.is_here(one("Ann"), 8.0)
    assert not reach.is_here(one("Ann"), 8.1)
    assert reach.facts(5.0).can == 0
    reach.update_status(one("Ann"), replace(READY, is_visible=False), 6.0)
    assert not reach.is_here(one("Ann"), 6.0)


def test_here_is_who_is_seen() -> None:
    reach = AlarmReach()
    reach.update_status(one("Ann"), READY, 0.0)
    reach.update_status(one("Ben"), replace(READY, is_visible=False), 0.0)
    assert reach.is_here(one("Ann"), 1.0)
    assert not reach.is_here(one("Ben"), 1.0)
    assert not reach.is_here(one("Ann"), 3.1)
    assert not reach.is_here(one("Ann", who="device-Ben"), 1.0)
    assert reach.find("page-Ann", 1.0) == one("Ann")
    assert reach.find("page-Ben", 1.0) is None

"""Alarms, who drives and the departure check, as they are read back."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.values import Mode
from server.protocol.alarm_state import StandingAlarm
from server.protocol.departure import DepartureState
from server.protocol.driving_state import ModeState, WhyUnknown
from server.vehicle.handover_lines import MOST_ALARMS, alarm_lines, departure_line, driving_line


def mode(now: Mode, why: WhyUnknown | None = None, since_ms: int | None = 5) -> ModeState:
    return {"mode": now, "why": why, "since_ms": since_ms, "way_m": None, "source": "/mode", "open": []}


def check(state: Any, **counts: int) -> DepartureState:
    known = {"done": 10, "failed": 0, "not_applicable": 0, "of": 12, **counts}
    return {"state": state, **known, "by": "A. K. (Pixel)", "at_ms": 7}  # type: ignore[typeddict-item]


def test_who_drives() -> None:
    one = driving_line(mode("autonomous"))
    assert (one.key, one.title, one.text, one.since_ms) == ("driving:autonomous:", "The car drives itself", "", 5)
    one = driving_line(mode("unknown", "silent"))
    assert (one.title, one.text) == ("Who drives is not known", "The topic for it is silent.")
    assert one.since_ms is None, "since when nobody knows is no fact"
    assert one.key != driving_line(mode("unknown", "flickers")).key


@pytest.mark.parametrize(
    ("state", "title", "text"),
    [
        (check("none"), "No departure check was made", ""),
        (check("open"), "Departure check is not signed", "Begun by A. K. (Pixel): 10 of 12 items done."),
        (
            check("signed", not_applicable=2),
            "Departure check signed",
            "Signed by A. K. (Pixel): 10 of 12 items done, 2 not applicable.",
        ),
        (
            check("signed", failed=1),
            "Departure check signed with failed items",
            "Signed by A. K. (Pixel): 10 of 12 items done, 1 failed.",
        ),
    ],
    ids=["none", "open", "signed", "failed"],
)
def test_the_departure_check(state: DepartureState, title: str, text: str) -> None:
    one = departure_line(state, {})
    assert (one.title, one.text) == (title, text)


def test_an_item_that_turns_is_no_other_line_and_a_signature_is() -> None:
    before = departure_line(check("open"), {}).key
    assert before == departure_line(check("open", done=11), {}).key
    assert before != departure_line(check("signed"), {}).key
    tyres = departure_line(check("open", failed=1), {"tyres": "Tyres"})
    assert before != tyres.key, "it is read back anew"
    assert tyres.key != departure_line(check("open", failed=1), {"brake": "Brake"}).key, "so is another item"
    assert tyres.text == "Begun by A. K. (Pixel): 10 of 12 items done, 1 failed: Tyres."


def standing(name: str, **more: Any) -> StandingAlarm:
    found: Any = {
        "id": name, "occurrence": 1, "title": f"Alarm {name}", "ended_title": f"{name} is over",
        "priority": "warning", "state": "UNACKED", "active": True, "raised_ms": 5, "text": "0.4 m",
        "trip_text": "0.5 m",
        "acknowledged_by": None, "shelved_until_ms": None, "shelved_by": None, **more,
    }  # fmt: skip
    return found  # type: ignore[no-any-return]


def test_an_acknowledged_alarm_is_a_line_with_its_owner_and_its_age() -> None:
    known = standing("drift", state="ACKED", acknowledged_by="A. K. (Pixel)")
    (line,) = alarm_lines([known])
    assert (line.kind, line.key, line.title, line.since_ms) == ("alarm", "alarm:drift:1", "Alarm drift", 5)
    assert line.text == "0.4 m Acknowledged by A. K. (Pixel)."
    (waiting,) = alarm_lines([standing("drift")])
    assert waiting.text == "0.4 m Not acknowledged."
    (ended,) = alarm_lines([standing("drift", state="RTN_UNACKED", active=False, text="")])
    assert (ended.title, ended.text) == ("drift is over", "0.5 m Not acknowledged.")


def test_a_shelved_alarm_is_a_line_after_the_others_with_who_shelved_it_and_until_when() -> None:
    shelf = {"state": "SHELVED", "shelved_by": "Ann", "shelved_until_ms": 99}
    lines = alarm_lines([standing("hidden", **shelf), standing("drift")])
    assert [line.key for line in lines] == ["alarm:drift:1", "shelved:hidden:1"]
    assert (lines[1].kind, lines[1].title, lines[1].text) == ("shelved", "Shelved: Alarm hidden", "0.4 m By Ann.")
    assert (lines[1].until_ms, lines[1].since_ms) == (99, None)
    alone = alarm_lines([standing("hidden", **shelf)])
    assert [line.title for line in alone] == ["No alarm is active", "Shelved: Alarm hidden"]


def test_more_alarms_than_have_a_line_of_their_own_are_one_that_changes_with_them() -> None:
    many = [standing(f"a{n}") for n in range(MOST_ALARMS + 3)]
    lines = alarm_lines(many)
    assert [line.key for line in lines[:MOST_ALARMS]] == [f"alarm:a{n}:1" for n in range(MOST_ALARMS)]
    assert (len(lines), lines[-1].title) == (MOST_ALARMS + 1, "3 more alarms")
    assert len(alarm_lines(many[:MOST_ALARMS])) == MOST_ALARMS, "none is left for it"
    again = alarm_lines([*many[:-1], standing(f"a{MOST_ALARMS + 2}", occurrence=2)])
    assert again[-1].title == "3 more alarms"
    assert again[-1].key != lines[-1].key, "another occurrence is read back anew"
    shelved = [standing(f"s{n}", state="SHELVED") for n in range(MOST_ALARMS + 1)]
    assert len(alarm_lines(shelved)) == MOST_ALARMS + 2, "each shelved one has its line"

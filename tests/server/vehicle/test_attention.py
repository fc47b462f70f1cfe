"""A car's item in the attention queue: the session alone decides who has it, and writes each step into the log."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.alarm_spec import Priority
from server.bus.bus import ALL
from server.protocol.commands import BY_KIND
from server.vehicle.car_attention import MOST_PEOPLE
from server.web.remote_frames import LONGEST_SUMMARY
from tests.server.vehicle.attended import ANN, BEN, PROGRAM, WALL_MS, Attended

ITEM = ("take_item", "release_item", "offer_item", "answer_item", "withdraw_item")


def needing(priority: Priority = Priority.CRITICAL) -> Attended:
    car = Attended()
    car.tick(0.5)
    car.faults = {priority}
    car.tick(0.5)
    return car


async def test_a_quiet_car_and_one_with_an_advisory_need_nobody() -> None:
    car = Attended()
    car.tick(1.0)
    assert car.summary["attention"] is None
    car.faults = {Priority.ADVISORY}
    car.tick(1.0)
    assert car.summary["worst"]["priority"] == "advisory"
    assert car.item is None


@pytest.mark.parametrize(("priority", "escalates_ms"), [(Priority.WARNING, None), (Priority.CRITICAL, 30_500)])
async def test_an_item_begins_with_an_alarm(priority: Priority, escalates_ms: int | None) -> None:
    item = needing(priority).item
    assert item is not None
    begun_ms = item["since_ms"] - WALL_MS
    assert 500 <= begun_ms <= 600
    assert (item["assigned"], item["offered"], item["escalated_ms"]) == (None, None, None)
    assert (item["escalates_ms"] is None) == (escalates_ms is None)
    if escalates_ms is not None:
        assert item["escalates_ms"] == item["since_ms"] + 30_000


async def test_it_stays_while_an_alarm_is_active_or_unacknowledged() -> None:
    car = needing(Priority.WARNING)
    alarm = car.summary["worst"]
    await car.accepted(ANN, "acknowledge", alarm=alarm["id"], occurrence=alarm["occurrence"])
    assert car.item is not None, "it is active"
    car.faults = set()
    car.tick(1.0)
    assert car.item is None
    car.faults = {Priority.CRITICAL}
    car.tick(1.0)
    assert car.item is not None


async def test_two_people_take_hand_over_and_release_and_the_log_names_them() -> None:
    car = needing()
    for page in (ANN, BEN):
        car.report(page)
    await car.accepted(ANN, "take_item")
    assert car.item is not None
    assert car.item["assigned"] == {"name": "Ann", "page": "page-a", "since_ms": WALL_MS + 1000}
    assert car.item["escalates_ms"] is None
    assert await car.refused(BEN, "take_item") == "This car is assigned to Ann: take it over, or ask."
    assert car.summary["people"] == [{"page": "page-a", "name": "Ann"}, {"page": "page-b", "name": "Ben"}]
    await car.accepted(ANN, "offer_item", to="page-b", vehicle="ocelot")
    assert car.item["assigned"]["name"] == "Ann"
    assert car.item["offered"] == {"by": "Ann", "name": "Ben", "page": "page-b", "since_ms": WALL_MS + 1000}
    assert await car.refused(ANN, "answer_item", accept=True) == "You have no offer to take over."
    await car.accepted(BEN, "answer_item", accept=True)
    assert (car.item["assigned"]["name"], car.item["offered"]) == ("Ben", None)
    assert await car.refused(ANN, "release_item") == "This car is assigned to Ben."
    await car.accepted(ANN, "take_item", over=True)
    await car.accepted(ANN, "offer_item", to="page-b")
    await car.accepted(BEN, "answer_item", accept=False)
    await car.accepted(ANN, "offer_item", to="page-b")
    await car.accepted(ANN, "withdraw_item")
    await car.accepted(ANN, "release_item")
    assert car.item["assigned"] is None
    logged = [(event["act"], event["by"], event["holder"], event["before"]) for event in car.log]
    assert logged == [
        ("taken", "Ann", "Ann", None),
        ("offered", "Ann", "Ann", None),
        ("accepted", "Ben", "Ben", "Ann"),
        ("taken_over", "Ann", "Ann", "Ben"),
        ("offered", "Ann", "Ann", None),
        ("declined", "Ben", "Ann", None),
        ("offered", "Ann", "Ann", None),
        ("withdrawn", "Ann", "Ann", None),
        ("released", "Ann", None, "Ann"),
    ]
    assert [event["page"] for event in car.log[:3]] == ["page-a", "page-a", "page-b"]
    assert car.item["escalates_ms"] == WALL_MS + 31_000


async def test_nobody_takes_it_and_it_is_escalated_once() -> None:
    car = needing()
    car.tick(60.0)
    assert [(event["act"], event["by"], event["text"]) for event in car.log] == [
        ("escalated", None, "Nobody took “Test critical” within 30 s: escalated to the supervisor.")
    ]
    assert car.item is not None
    assert car.item["escalates_ms"] is None
    assert car.item["escalated_ms"] == pytest.approx(car.item["since_ms"] + 30_000, abs=60)
    await car.accepted(BEN, "take_item")
    assert car.item["escalated_ms"] is None


async def test_a_page_that_falls_silent_loses_it_after_10_s() -> None:
    car = needing()
    await car.accepted(ANN, "take_item")
    car.tick(100.0, reporting=(ANN,))
    assert [event["act"] for event in car.log] == ["taken"]
    car.tick(9.0, reporting=(BEN,))
    assert [event["act"] for event in car.log] == ["taken"]
    car.tick(2.0, reporting=(BEN,))
    assert [(event["act"], event["by"], event["holder"], event["before"]) for event in car.log[1:]] == [
        ("unassigned", None, None, "Ann")
    ]
    assert car.item is not None
    assert car.item["assigned"] is None
    assert 28_000 <= car.item["escalates_ms"] - WALL_MS - 1000 * car.now_s <= 30_000, "begun anew"


async def test_a_page_that_leaves_has_10_s_to_come_back() -> None:
    """As over a reload; that of the car itself as well."""
    car = needing()
    await car.accepted(ANN, "present", visible=True, sound="ready", awake="ready")
    await car.accepted(ANN, "take_item")
    await car.accepted(ANN, "present", visible=False, sound="asks", awake="asks", leaves=True)
    car.tick(9.0)
    await car.accepted(ANN, "present", visible=True, sound="ready", awake="ready")
    car.tick(9.0)
    assert [event["act"] for event in car.log] == ["taken"]
    await car.accepted(ANN, "present", visible=False, sound="asks", awake="asks", leaves=True)
    car.tick(11.0)
    assert [event["act"] for event in car.log] == ["taken", "unassigned"]


async def test_the_assignment_ends_with_the_item() -> None:
    car = needing()
    await car.accepted(ANN, "take_item")
    alarm = car.summary["worst"]
    car.faults = set()
    car.tick(1.0)
    if car.item is not None:
        await car.accepted(ANN, "acknowledge", alarm=alarm["id"], occurrence=alarm["occurrence"])
    assert car.item is None
    assert await car.refused(ANN, "release_item") == "This car needs nobody now."
    car.faults = {Priority.CRITICAL}
    car.tick(1.0)
    assert car.item is not None
    assert car.item["assigned"] is None


async def test_a_program_has_it_while_it_takes_it_again() -> None:
    car = needing()
    await car.accepted(PROGRAM, "take_item")
    for _ in range(4):
        car.tick(8.0)
        await car.accepted(PROGRAM, "take_item")
    assert car.item is not None
    assert car.item["assigned"]["name"] == "dispatch"
    assert [event["act"] for event in car.log] == ["taken"]
    assert await car.refused({**PROGRAM, "by": "other"}, "release_item") == "This car is assigned to dispatch."
    car.tick(11.0)
    assert [event["act"] for event in car.log] == ["taken", "unassigned"]


async def test_only_a_page_that_is_seen_gets_an_offer() -> None:
    car = needing()
    car.report(ANN)
    await car.accepted(ANN, "take_item")
    assert await car.refused(ANN, "offer_item", to="page-b") == "That page is closed or not visible."
    car.report({**BEN, "visible": False})
    assert await car.refused(ANN, "offer_item", to="page-b") == "That page is closed or not visible."
    car.report(BEN)
    await car.accepted(ANN, "offer_item", to="page-b")


@pytest.mark.parametrize("kind", ITEM)
async def test_what_is_meant_for_another_car_is_refused(kind: str) -> None:
    more = {"offer_item": {"to": "page-b"}, "answer_item": {"accept": True}}.get(kind, {})
    why = await needing().refused(ANN, kind, vehicle="serval", **more)
    assert why == "This was meant for serval, and this is ocelot: nothing was sent to either."


@pytest.mark.parametrize(
    "command",
    [
        {"kind": "offer_item"},
        {"kind": "offer_item", "to": "x" * 400},
        {"kind": "offer_item", "to": ["page-b"]},
        {"kind": "answer_item"},
        {"kind": "answer_item", "accept": "yes"},
        {"kind": "take_item", "over": 1},
    ],
)
async def test_what_is_no_command_changes_nothing(command: dict[str, Any]) -> None:
    car = needing()
    await car.refused(ANN, **command)
    assert car.log == []


def test_items_need_no_control_and_are_commands_of_the_page_of_all_cars() -> None:
    assert {kind for kind, one in BY_KIND.items() if one.from_fleet} == {
        *ITEM,
        "acknowledge",
        "end_planned_stop",
        "outcome",
    }
    assert {BY_KIND[kind].needs for kind in ITEM} == {"operator"}


async def test_a_summary_stays_within_its_bound_whoever_is_there() -> None:
    car = needing()
    widest = "\N{GRINNING FACE}" * 40
    pages = [{"by": widest, "who": f"phone {number}", "page": f"{number:040d}"} for number in range(60)]
    for page in pages:
        car.report(page)
    assert (await car.ask(pages[0], "present", visible=True, sound="ready", awake="ready"))["ok"]
    await car.accepted(pages[0], "control", do="take")
    await car.accepted(pages[0], "take_item")
    await car.accepted(pages[0], "offer_item", to=pages[1]["page"])
    car.faults.add(Priority.WARNING)
    car.tick(0.5)
    person = {"name": "A" + widest[:29], "role": "operator"}
    await car.accepted(pages[0] | {"person": person}, "acknowledge", alarm="test_warning", occurrence=1)
    car.report(pages[1] | {"duties": {person["name"]: WALL_MS}})
    car.say_what = '"' * 10_000
    car.tick(0.5)
    frame = car.bus.newest(ALL, "ocelot")
    assert car.summary["unowned"]["by"] == f"{person['name']} ({widest})"
    assert frame is not None
    assert car.summary["worst"]["text"] == '"' * 100
    assert 1 < len(car.summary["people"]) < MOST_PEOPLE
    assert len(str(frame.payload).encode()) <= LONGEST_SUMMARY
    for number in range(60):
        car.report({"by": f"P{number}", "who": f"phone {number}", "page": f"page-{number}"})
    car.tick(0.5)
    assert len(car.summary["people"]) == MOST_PEOPLE

"""An acknowledged alarm whose owner is off duty: list, hand-over and queue show that, until somebody takes it."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.alarm_spec import Priority
from monitor.restoring import restore
from server.control.authorization import MOST_DUTIES
from server.protocol.commands import BY_KIND
from server.vehicle.restore import recall
from tests.server.vehicle.attended import ANN, BEN, PROGRAM, SEEN, WALL_MS, Attended

AK = {"person": {"name": "A. K.", "role": "operator", "device": "dev-a"}}
MR = {"person": {"name": "M. R.", "role": "safety_driver"}}
OFF_MS = WALL_MS + 2000
BOTH: dict[str, Any] = {"duties": {"A. K.": None, "M. R.": None}}
LEFT: dict[str, Any] = {"duties": {"A. K.": OFF_MS, "M. R.": None}}
TAKE = {"alarm": "test_warning", "occurrence": 1}


async def acknowledged(by: dict[str, Any] = ANN | AK) -> Attended:
    """A car with a warning that somebody has acknowledged who is on duty."""
    car = Attended()
    car.tick(0.5)
    car.faults = {Priority.WARNING}
    car.tick(0.5, reporting=(ANN,))
    for who in (ANN | AK | BOTH, BEN | MR | BOTH):
        await car.accepted(SEEN | who, "present")
    await car.accepted(by, "acknowledge", **TAKE)
    return car


async def left() -> Attended:
    """The same after the duty of who acknowledged it ended; no page reports that they left."""
    car = await acknowledged()
    await car.accepted(SEEN | BEN | MR | LEFT, "present")
    car.tick(0.5)
    return car


def listed(car: Attended) -> tuple[Any, ...]:
    (alarm,) = car.session.frame()["alarms"]
    return alarm["state"], alarm["acknowledged_by"], alarm["off_duty_ms"]


async def test_it_says_since_when_its_owner_is_off_duty() -> None:
    car = await acknowledged()
    car.tick(0.5)
    assert listed(car) == ("ACKED", "A. K. (Ann)", None)
    assert car.summary["unowned"] is None
    car = await left()
    assert listed(car) == ("ACKED", "A. K. (Ann)", OFF_MS)
    assert car.summary["unowned"] == {"count": 1, "by": "A. K. (Ann)", "since_ms": OFF_MS}
    await car.accepted(SEEN | BEN | MR | {"duties": {"M. R.": None}}, "present")  # removed from the list of people
    assert listed(car)[2] == OFF_MS
    await car.accepted(SEEN | ANN | AK | BOTH, "present")  # back on duty: it is theirs
    assert listed(car)[2] is None


async def test_the_log_says_when_an_owner_goes_off_duty_and_comes_back() -> None:
    car = await left()
    await car.accepted(SEEN | ANN | AK | BOTH, "present")
    car.tick(0.5)
    events = [
        (event["text"], event["owner"], event["off_duty_ms"])
        for event in reversed(car.bus.past_events("ocelot", change="owner"))
    ]
    assert events == [
        ("A. K. (Ann) is off duty and has acknowledged: Test warning.", "A. K. (Ann)", OFF_MS),
        ("A. K. (Ann) is on duty again, and has acknowledged: Test warning.", "A. K. (Ann)", None),
    ]


async def test_the_page_of_another_car_says_it_too() -> None:
    car = await acknowledged()
    car.report(BEN | MR | LEFT)
    assert listed(car)[2] == OFF_MS


@pytest.mark.parametrize(
    "stated", [{"duties": ["A. K."]}, {"duties": {"A. K.": "x", 7: 8, "B": True}}, {"duties": None}]
)
async def test_what_cannot_be_read_changes_nothing(stated: dict[str, Any]) -> None:
    car = await acknowledged()
    await car.accepted(SEEN | BEN | MR | stated, "present")
    assert listed(car) == ("ACKED", "A. K. (Ann)", None)


async def test_it_is_a_line_of_the_hand_over() -> None:
    car = await left()
    await car.accepted(BEN | MR, "control", do="take")
    await car.accepted(SEEN | ANN | LEFT, "present")
    await car.accepted(BEN | MR, "offer_control", to="page-a")
    offered: Any = car.session.frame()["control"]["handover"]
    (line,) = (one for one in offered["lines"] if one["kind"] == "alarm")
    assert line["text"].endswith("Acknowledged by A. K. (Ann).")
    assert line["off_duty_ms"] == OFF_MS


async def test_who_takes_it_is_its_owner_also_after_a_restart() -> None:
    car = await left()
    await car.accepted(BEN | MR, "take_alarm", **TAKE)
    assert listed(car) == ("ACKED", "M. R. (Ben)", None)
    car.tick(0.5)
    assert car.summary["unowned"] is None
    (event,) = car.bus.past_events("ocelot", change="handed_over")
    assert (event["alarm"], event["person"], event["occurrence"], event["announces"]) == (
        "test_warning",
        "M. R.",
        1,
        False,
    )
    past = recall(car.bus, "ocelot", now_s=car.now_s, wall_ms=WALL_MS + round(car.now_s * 1000))
    assert restore({}, past.transitions)["test_warning"].acknowledged_by == "M. R. (Ben)"
    why = await car.refused(ANN | AK, "take_alarm", **TAKE)
    assert why == "Test warning: M. R. (Ben) has acknowledged it and is not off duty."


@pytest.mark.parametrize("who", [BEN, PROGRAM])
async def test_only_who_is_on_duty_takes_it_while_people_sign_on(who: dict[str, Any]) -> None:
    car = await left()
    assert "Sign on first" in await car.refused(who, "take_alarm", **TAKE)
    assert listed(car)[2] == OFF_MS
    await car.accepted(SEEN | BEN | {"duties": {}}, "present")  # the list is empty: nobody can sign on
    await car.accepted(who, "take_alarm", **TAKE)
    assert listed(car)[2] is None


async def test_once_the_list_is_emptied_who_never_signed_on_takes_it() -> None:
    """Who was removed is still stated as off duty, and nobody can sign on."""
    car = await left()
    await car.accepted(SEEN | BEN | {"duties": {"A. K.": OFF_MS}, "listed": 1}, "present")
    assert "Sign on first" in await car.refused(BEN, "take_alarm", **TAKE)
    await car.accepted(SEEN | BEN | {"duties": {"A. K.": OFF_MS}, "listed": 0}, "present")
    await car.accepted(BEN, "take_alarm", **TAKE)
    assert listed(car)[:2] == ("ACKED", "Ben")


async def test_nobody_takes_what_has_an_owner_or_was_raised_again() -> None:
    car = await acknowledged()
    assert "is not off duty" in await car.refused(BEN | MR, "take_alarm", **TAKE)
    car = await acknowledged(by=PROGRAM)  # a program is never on duty
    await car.accepted(SEEN | BEN | MR | LEFT, "present")
    assert "is not off duty" in await car.refused(BEN | MR, "take_alarm", **TAKE)
    car = await left()
    gone = "This alarm is not an acknowledged one any more: look at the list again."
    assert await car.refused(BEN | MR, "take_alarm", alarm="test_warning", occurrence=2) == gone
    assert await car.refused(BEN | MR, "take_alarm", alarm="unknown", occurrence=1) == gone
    assert "meant for serval" in await car.refused(BEN | MR, "take_alarm", vehicle="serval", **TAKE)
    assert BY_KIND["take_alarm"].needs == "operator"


async def test_another_moment_of_the_same_end_is_not_logged_again() -> None:
    """Two web nodes whose clocks or lists differ state it in turn."""
    car = await left()
    for off_ms in (OFF_MS + 2000, OFF_MS, OFF_MS + 2000):
        await car.accepted(SEEN | BEN | MR | {"duties": {"A. K.": off_ms, "M. R.": None}}, "present")
        car.tick(0.5)
        assert listed(car)[2] == off_ms
    assert len(car.bus.past_events("ocelot", change="owner")) == 1


async def test_after_a_restart_it_is_known_from_the_log_and_from_no_list_of_people() -> None:
    """The list keeps so many who were removed, and each of them for so many days."""
    car = Attended(after=await left())
    car.tick(0.5)
    assert listed(car) == ("ACKED", "A. K. (Ann)", OFF_MS)
    await car.accepted(SEEN | BEN | MR | {"duties": {"M. R.": None}}, "present")
    assert listed(car) == ("ACKED", "A. K. (Ann)", OFF_MS)
    assert len(car.bus.past_events("ocelot", change="owner")) == 2  # the recording that begins now has it too
    await car.accepted(BEN | MR, "take_alarm", **TAKE)
    assert listed(car) == ("ACKED", "M. R. (Ben)", None)
    again = Attended(after=car)
    again.tick(0.5)
    assert listed(again) == ("ACKED", "M. R. (Ben)", None)


async def test_after_a_restart_who_came_back_or_acknowledged_it_later_is_not_off_duty() -> None:
    car = await left()
    await car.accepted(SEEN | ANN | AK | BOTH, "present")
    car.tick(0.5)
    again = Attended(after=car)
    again.tick(0.5)
    assert listed(again)[2] is None
    car = await left()
    car.faults = set()
    car.tick(30.0)
    car.faults = {Priority.WARNING}
    car.tick(0.5)
    await car.accepted(SEEN | ANN | AK | BOTH, "present")
    await car.accepted(ANN | AK, "acknowledge", **TAKE | {"occurrence": 2})
    again = Attended(after=car)
    again.tick(0.5)
    assert listed(again) == ("ACKED", "A. K. (Ann)", None)


async def test_among_many_who_are_off_duty_the_owners_stay_known() -> None:
    car = await left()
    for hundred in range(0, 500, 100):
        many = {f"P {number}": OFF_MS for number in range(hundred, hundred + 100)}
        await car.accepted(SEEN | BEN | MR | {"duties": {"M. R.": None} | many}, "present")
    assert listed(car)[2] == OFF_MS
    assert len(car.session._parts.authorization._off_ms) == MOST_DUTIES + 1

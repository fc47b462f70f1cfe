"""Who is on duty, at a car: in its log, in the item that is escalated, in a hand-over with read-back."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from monitor.alarm import AlarmState
from monitor.alarm_spec import Priority
from monitor.restoring import restore
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.simulator.car import SimulatedCar
from server.vehicle import handover_lines
from server.vehicle.restore import recall
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.server.vehicle.attended import ANN, BEN, PROGRAM, SEEN, WALL_MS, Attended
from tests.server.vehicle.car_source import CarSource
from tests.world.played import run

AK = {"person": {"name": "A. K.", "role": "operator", "device": "dev-a"}}
MR = {"person": {"name": "M. R.", "role": "safety_driver"}}
BOSS: dict[str, Any] = {"supervisors": ["J. D."]}
NOBODY: dict[str, Any] = {"supervisors": []}


def escalated(car: Attended) -> str:
    return next(str(event["text"]) for event in car.log if event["act"] == "escalated")


@pytest.mark.parametrize(
    ("stated", "text", "shown"),
    [
        (BOSS, "escalated to J. D., supervisor.", ["J. D."]),
        ({"supervisors": ["J. D.", "K. L."]}, "escalated to J. D. and K. L., supervisors.", ["J. D.", "K. L."]),
        (NOBODY, "escalated, but no supervisor is on duty.", []),
        ({}, "escalated to the supervisor.", None),  # of a web node without data on people
        ({"supervisors": "J. D."}, "escalated to the supervisor.", None),
    ],
)
async def test_a_critical_alarm_is_escalated_to_who_is_on_duty(
    stated: dict[str, Any], text: str, shown: list[str] | None
) -> None:
    car = Attended()
    car.faults = {Priority.CRITICAL}
    car.tick(32.0, reporting=(ANN | stated,))
    assert escalated(car).endswith(text)
    assert car.item is not None
    assert car.item["supervisors"] == shown


async def test_who_is_supervisor_is_not_known_once_no_page_states_it() -> None:
    car = Attended()
    car.faults = {Priority.CRITICAL}
    car.tick(1.0, reporting=(ANN | BOSS,))
    assert car.item is not None
    assert car.item["supervisors"] == ["J. D."]
    car.tick(11.5)
    assert car.item["supervisors"] is None


async def test_what_a_person_does_is_logged_with_their_name_and_role() -> None:
    car = Attended()
    car.tick(0.5)
    car.faults = {Priority.WARNING}
    car.tick(0.5, reporting=(ANN,))
    await car.accepted(ANN | AK, "acknowledge", alarm="test_warning", occurrence=1)
    assert car.session.frame()["alarms"][0]["acknowledged_by"] == "A. K. (Ann)"
    await car.accepted(BEN, "shelve", alarm="test_warning", occurrence=1, minutes=5.0)
    await car.accepted(PROGRAM | AK, "unshelve", alarm="test_warning")
    events = {event["change"]: event for event in car.bus.past_events(car.name) if event["by"]}
    assert events["acknowledged"]["by"] == "A. K. (Ann)"
    assert (events["acknowledged"]["person"], events["acknowledged"]["role"]) == ("A. K.", "operator")
    assert events["shelved"]["by"] == "Ben"
    assert "person" not in events["shelved"]


async def test_a_mark_bears_the_person_who_made_it() -> None:
    car = Attended()
    await car.accepted(ANN | AK, "mark", mark="m-1", at_ms=WALL_MS)
    await car.accepted(BEN, "mark", mark="m-2", at_ms=WALL_MS)
    second, first = car.bus.past_events(car.name, change="mark")
    assert (first["by"], first["person"], first["role"]) == ("A. K. (Ann)", "A. K.", "operator")
    assert (second["by"], "person" in second) == ("Ben", False)


def test_a_slow_down_bears_the_person_who_ordered_it() -> None:
    assert run(slowed()) == [("ordered", "A. K. (Ann)", "A. K.", "operator")]


async def slowed() -> list[tuple[str, str, str, str]]:
    """A simulated car that drives and is slowed: who ordered it, as its log has it."""
    loop = asyncio.get_running_loop()
    simulated = SimulatedCar(seed=3, start_s=WALL_MS / 1000)
    bus, source = LocalBus(Journal(None), now=loop.time), CarSource(simulated)
    session = Session(
        Vehicle(name="ocelot", address="ws://192.0.2.1:9090"),
        bus,
        now=loop.time,
        wall_ms=lambda: WALL_MS + round(loop.time() * 1000),
        server=dict,  # type: ignore[arg-type]
        open_source=source,
    )
    await session.start()
    orders = [(8.0, "arm"), (9.0, "slow_down")]
    for step in simulated.steps():
        now_s = step.at_s - WALL_MS / 1000
        if now_s > 10.0:
            break
        await asyncio.sleep(max(0.0, now_s - loop.time()))
        if orders and now_s >= orders[0][0]:
            answer = await session._commands.handle(ANN | AK | {"kind": orders.pop(0)[1]})
            assert answer["ok"], answer
        source.publish(step.messages)
    found = reversed(bus.past_events("ocelot", change="slow_down"))
    await session.stop()
    return [(one["step"], one["by"], one["person"], one["role"]) for one in found if one["step"] == "ordered"]


async def test_coming_and_going_at_a_page_of_the_car_is_logged_once() -> None:
    car = Attended()
    for who in (ANN, ANN | AK, ANN | AK, ANN | MR, ANN):
        await car.accepted(SEEN | who, "present")
    texts = [event["text"] for event in reversed(car.bus.past_events(car.name, change="duty"))]
    assert texts == [
        "A. K. is on duty as operator at Ann.",
        "A. K., operator, is not on duty at Ann any more.",
        "M. R. is on duty as safety driver at Ann.",
        "M. R., safety driver, is not on duty at Ann any more.",
    ]


async def test_a_request_for_control_is_in_the_summary_until_it_is_answered() -> None:
    car = Attended()
    for who in (ANN | AK, BEN):
        await car.accepted(SEEN | who, "present")
    await car.accepted(ANN | AK, "control", do="take")
    assert car.summary["requests"] == []
    await car.accepted(BEN, "control", do="request")
    assert car.summary["holder"] == "A. K. (Ann)"
    assert car.summary["requests"] == [{"page": "page-b", "name": "Ben", "left_s": 10.0}]
    await car.accepted(ANN | AK, "control", do="keep", to="page-b")
    assert car.summary["requests"] == []


async def test_shelved_and_acknowledged_alarms_are_lines_of_the_hand_over() -> None:
    shift = Shift()
    await shift.seen()
    car = shift.car
    car.faults = {Priority.WARNING, Priority.ADVISORY}
    car.tick(0.5)
    await car.accepted(ANN | AK, "acknowledge", alarm="test_warning", occurrence=1)
    await car.accepted(ANN | AK, "shelve", alarm="test_advisory", occurrence=1, minutes=5.0)
    await shift.begin()
    assert shift.state is not None
    warning, advisory = (line for line in shift.state["lines"] if line["kind"] in ("alarm", "shelved"))
    assert (warning["kind"], warning["title"]) == ("alarm", "Test warning")
    assert warning["text"].endswith("Acknowledged by A. K. (Ann).")
    assert (advisory["kind"], advisory["title"]) == ("shelved", "Shelved: Test advisory")
    assert advisory["text"].endswith("By A. K. (Ann).")
    assert advisory["until_ms"] == WALL_MS + 500 + 5 * 60_000


class Shift:
    """Ann is in control and offers it to Ben."""

    def __init__(self) -> None:
        self.car = Attended()

    async def begin(self) -> None:
        await self.seen()
        await self.car.accepted(ANN | AK, "control", do="take")
        await self.car.accepted(ANN | AK, "offer_control", to="page-b")

    async def seen(self) -> None:
        for who in (ANN | AK, BEN | MR):
            await self.car.accepted(SEEN | who, "present")

    @property
    def state(self) -> dict[str, Any] | None:
        found: dict[str, Any] | None = self.car.session.frame()["control"].get("handover")  # type: ignore[assignment]
        return found

    async def read_all(self) -> None:
        assert self.state is not None
        for line in self.state["lines"]:
            await self.car.accepted(BEN | MR, "read_back", line=line["key"])

    async def accept(self) -> dict[str, Any]:
        assert self.state is not None
        return await self.car.ask(BEN | MR, "accept_control", version=self.state["version"])


async def test_a_new_alarm_during_the_read_back_adds_a_line() -> None:
    shift = Shift()
    await shift.begin()
    assert shift.state is not None
    assert [line["kind"] for line in shift.state["lines"]] == ["alarm", "rides", "driving", "departure", "slow_down"]
    assert shift.state["lines"][0]["title"] == "No alarm is active"
    assert [line["title"] for line in shift.state["lines"][1:4]] == [
        "In the car: M. R., safety driver", "Who drives is not known", "No departure check was made",
    ]  # fmt: skip
    await shift.read_all()
    version = shift.state["version"]
    shift.car.faults = {Priority.CRITICAL}
    await shift.seen()
    shift.car.tick(0.5)
    assert [line["title"] for line in shift.state["lines"] if not line["read"]] == ["Test critical"]
    refused = await shift.car.ask(BEN | MR, "accept_control", version=version)
    assert refused["ok"] is False
    assert refused["reason"] == "One line is not read back yet: Test critical."
    assert refused["handover"]["left"] == 1
    assert shift.car.session.frame()["control"]["holder"] == "A. K. (Ann)"
    await shift.read_all()
    answer = await shift.accept()
    assert answer["ok"] is True
    assert answer["handed_over"] == {"device": "dev-a", "to": "M. R. (Ben)"}
    assert shift.car.session.frame()["control"]["holder"] == "M. R. (Ben)"
    assert shift.state is None
    steps = [event["step"] for event in reversed(shift.car.bus.past_events("ocelot", change="hand_over"))]
    assert steps == ["offered", "accepted"]


async def test_limits_that_differ_from_their_default_are_read_back() -> None:
    shift = Shift()
    await shift.begin()
    await shift.car.accepted(ANN | AK, "set", values={"speed_limit.max_mps": 9.0})
    assert shift.state is not None
    (limit,) = (line for line in shift.state["lines"] if line["kind"] == "limit")
    assert (limit["title"], limit["text"]) == ("Speed limit: 9 m/s", "Default: 11 m/s")
    await shift.read_all()
    await shift.car.accepted(ANN | AK, "set", values={"speed_limit.max_mps": 8.0})  # another limit is another line
    assert (await shift.accept())["reason"] == "One line is not read back yet: Speed limit: 8 m/s."


async def test_an_offer_answers_a_request_that_silence_would_grant() -> None:
    shift = Shift()
    await shift.seen()
    await shift.car.accepted(ANN | AK, "control", do="take")
    await shift.car.accepted(BEN | MR, "control", do="request")
    await shift.car.accepted(ANN | AK, "offer_control", to="page-b")
    for _ in range(12):
        await shift.seen()
        shift.car.tick(1.0)
    assert shift.car.session.frame()["control"]["holder"] == "A. K. (Ann)"
    assert shift.state is not None


async def test_taking_control_over_ends_the_hand_over() -> None:
    shift = Shift()
    await shift.begin()
    await shift.car.accepted(BEN | MR, "control", do="take_over")
    shift.car.tick(0.1)
    assert shift.state is None
    assert await shift.car.refused(BEN | MR, "read_back", line="alarms:none") == "Control is not offered to this page."


async def test_an_offer_is_declined_or_taken_back() -> None:
    for who, step in ((BEN | MR, "declined"), (ANN | AK, "withdrawn")):
        shift = Shift()
        await shift.begin()
        await shift.car.accepted(who, "end_offer")
        assert shift.state is None
        assert shift.car.bus.past_events("ocelot", change="hand_over")[0]["step"] == step


async def test_a_program_hands_nothing_over() -> None:
    car = Attended()
    assert "Only a page" in await car.refused(PROGRAM, "offer_control", to="page-b")


def changes(car: Attended) -> list[tuple[str, str, str | None, bool]]:
    """Alarm, change, by whom, announced: what a hand-over made of the alarms."""
    found = reversed(car.bus.past_events("ocelot", limit=200))
    kinds = ("handed_over", "unacknowledged")
    return [(one["alarm"], one["change"], one["by"], one["announces"]) for one in found if one["change"] in kinds]


async def handed_over(shift: Shift) -> None:
    await shift.begin()
    await shift.read_all()
    assert (await shift.accept())["ok"] is True


async def test_who_takes_over_owns_what_they_read_back() -> None:
    shift = Shift()
    await shift.seen()
    car = shift.car
    car.faults = {Priority.WARNING, Priority.ADVISORY}
    car.tick(0.5)
    await car.accepted(ANN | AK, "acknowledge", alarm="test_warning", occurrence=1)
    before = car.session.frame()["alarms"][0]
    await handed_over(shift)
    after = {one["id"]: one for one in car.session.frame()["alarms"]}
    assert (after["test_warning"]["state"], after["test_warning"]["acknowledged_by"]) == ("ACKED", "M. R. (Ben)")
    assert (after["test_warning"]["raised_ms"], after["test_warning"]["occurrence"]) == (before["raised_ms"], 1)
    assert after["test_advisory"]["state"] == "UNACKED", "reading back acknowledges nothing"
    assert changes(car) == [("test_warning", "handed_over", "M. R. (Ben)", False)]
    (event,) = car.bus.past_events("ocelot", change="handed_over")
    assert (event["person"], event["role"], event["state"]) == ("M. R.", "safety_driver", "ACKED")


async def test_what_the_taker_has_not_read_back_waits_for_them() -> None:
    """An alarm that is hidden by another one is no line of the list."""
    shift = Shift()
    await shift.seen()
    car = shift.car
    car.faults = {Priority.WARNING}
    car.tick(0.5)
    await car.accepted(ANN | AK, "acknowledge", alarm="test_warning", occurrence=1)
    alarms = car.session.judgement.monitor.alarms
    alarms["test_warning"] = replace(alarms["test_warning"], suppressed_by=("another",))
    await handed_over(shift)
    assert alarms["test_warning"].acknowledged is False
    assert changes(car) == [("test_warning", "unacknowledged", "M. R. (Ben)", False)]
    car.tick(0.5)  # nothing hides it any more
    (alarm,) = car.session.frame()["alarms"]
    assert (alarm["state"], alarm["occurrence"], alarm["acknowledged_by"]) == ("UNACKED", 2, None)
    assert "again meanwhile" in await car.refused(BEN | MR, "acknowledge", alarm="test_warning", occurrence=1)
    await car.accepted(BEN | MR, "acknowledge", alarm="test_warning", occurrence=2)


async def test_what_the_taker_had_acknowledged_stays_as_it_is() -> None:
    shift = Shift()
    await shift.seen()
    shift.car.faults = {Priority.WARNING}
    shift.car.tick(0.5)
    await shift.car.accepted(BEN | MR, "acknowledge", alarm="test_warning", occurrence=1)
    await handed_over(shift)
    assert changes(shift.car) == []


async def test_an_offer_that_is_declined_changes_no_owner() -> None:
    shift = Shift()
    await shift.seen()
    shift.car.faults = {Priority.WARNING}
    shift.car.tick(0.5)
    await shift.car.accepted(ANN | AK, "acknowledge", alarm="test_warning", occurrence=1)
    await shift.begin()
    await shift.read_all()
    await shift.car.accepted(BEN | MR, "end_offer")
    assert shift.car.session.frame()["alarms"][0]["acknowledged_by"] == "A. K. (Ann)"
    assert changes(shift.car) == []


async def test_the_owner_survives_a_restart() -> None:
    shift = Shift()
    await shift.seen()
    car = shift.car
    car.faults = {Priority.WARNING, Priority.ADVISORY}
    car.tick(0.5)
    for name in ("test_warning", "test_advisory"):
        await car.accepted(ANN | AK, "acknowledge", alarm=name, occurrence=1)
    alarms = car.session.judgement.monitor.alarms
    alarms["test_advisory"] = replace(alarms["test_advisory"], suppressed_by=("another",))
    await handed_over(shift)
    past = recall(car.bus, "ocelot", now_s=car.now_s, wall_ms=WALL_MS + round(car.now_s * 1000))
    found = restore({}, past.transitions)
    assert (found["test_warning"].state, found["test_warning"].acknowledged_by) == (AlarmState.ACKED, "M. R. (Ben)")
    assert (found["test_advisory"].acknowledged, found["test_advisory"].occurrence) == (False, 2)


async def test_an_alarm_that_is_one_of_many_in_a_line_was_not_seen_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(handover_lines, "MOST_ALARMS", 1)
    shift = Shift()
    await shift.seen()
    shift.car.faults = {Priority.WARNING, Priority.ADVISORY}
    shift.car.tick(0.5)
    for name in ("test_warning", "test_advisory"):
        await shift.car.accepted(ANN | AK, "acknowledge", alarm=name, occurrence=1)
    await handed_over(shift)
    assert changes(shift.car) == [
        ("test_warning", "handed_over", "M. R. (Ben)", False),
        ("test_advisory", "unacknowledged", "M. R. (Ben)", True),
    ]

"""A planned stop of a car: what it marks and silences, what it leaves alone, and what ends it."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.alarm import Alarm
from monitor.alarm_spec import AlarmSpec, Place, Priority, Sound
from monitor.catalog import CHECKS
from monitor.check import Scope
from monitor.motion import MOVES_ABOVE_MPS
from monitor.planned_stop import silent_checks
from monitor.values import Twist
from server.vehicle.car_summary import worst
from tests.server.vehicle.attended import ANN, BEN, SEEN, Attended

AK = {"person": {"name": "A. K.", "role": "operator", "device": "dev-a"}}


async def in_control() -> Attended:
    """Ann is in control of a car whose checks are about its link."""
    car = Attended(scope=Scope.LINK)
    for who in (ANN | AK, BEN):
        await car.accepted(SEEN | who, "present")
    await car.accepted(ANN | AK, "control", do="take")
    return car


async def stopped() -> Attended:
    car = await in_control()
    await car.accepted(ANN | AK, "planned_stop", reason="workshop")
    return car


def measured(car: Attended, mps: float) -> None:
    car.session._parts.judgement.state.receive("speed", Twist(speed_mps=mps), car.now_s)


def stop_of(car: Attended) -> dict[str, Any] | None:
    found: Any = car.session.frame()["session"].get("planned_stop")
    return None if found is None else dict(found)


def alarms(car: Attended) -> dict[str, tuple[str, bool | None, str]]:
    """Id → sound, mark, state."""
    return {one["id"]: (one["sound"], one.get("planned_stop"), one["state"]) for one in car.session.frame()["alarms"]}


def logged(car: Attended) -> list[dict[str, Any]]:
    found = car.bus.past_events(car.name, limit=100)
    return [one for one in reversed(found) if str(one["change"]).startswith("planned_stop")]


async def test_it_marks_alarms_and_hides_none() -> None:
    car = await stopped()
    car.faults = set(Priority)
    car.tick(1.0)
    assert alarms(car) == {
        "test_critical": ("medium", True, "UNACKED"),
        "test_warning": ("none", True, "UNACKED"),
        "test_advisory": ("none", True, "UNACKED"),
    }
    raised = [one for one in car.bus.past_events(car.name, limit=100) if one["change"] == "raised"]
    assert [one.get("planned_stop") for one in raised] == ["workshop"] * 3
    assert {one["announces"] for one in raised} == {True}
    assert car.session.frame()["alarm_load"]["in_10_min"] == 3, "they are counted"


async def test_a_critical_alarm_escalates_as_ever() -> None:
    car = await stopped()
    car.faults = {Priority.CRITICAL}
    car.tick(32.0, reporting=(ANN,))
    assert [one["act"] for one in car.log] == ["escalated"]
    assert car.summary["worst"]["sound"] == "medium"
    assert car.summary["planned_stop"] == "workshop"


async def test_a_warning_still_needs_a_person() -> None:
    car = await stopped()
    car.faults = {Priority.WARNING}
    car.tick(1.0, reporting=(ANN,))
    assert car.item is not None
    assert (car.summary["waiting"], car.summary["worst"]["sound"]) == (1, "none")


def test_of_two_alike_the_summary_has_the_one_that_sounds() -> None:
    """On pages of other cars only the worst sounds: one that is silent while the car stands must not hide another."""
    spec = AlarmSpec(title="", priority=Priority.WARNING, place=Place.LIST, sound=Sound.MEDIUM, needs_ack=False)
    sounding, silent = (
        Alarm(id=name, spec=spec, active=True, acknowledged=False, raised_s=at_s)
        for name, at_s in (("log_not_kept", 1.0), ("gps_drift", 2.0))
    )
    found = worst([silent, sounding], 3.0, 3000, {"gps_drift"})
    assert found is not None
    assert (found["id"], found["sound"]) == ("log_not_kept", "medium")
    usual = worst([silent, sounding], 3.0, 3000)
    assert usual is not None
    assert usual["id"] == "gps_drift", "without a planned stop the newest"


def test_what_is_silent_is_never_critical_and_never_of_the_server_itself() -> None:
    silent = silent_checks(CHECKS)
    for check in CHECKS:
        is_meant = check.alarm.priority is not Priority.CRITICAL and check.scope is not Scope.SERVER
        assert (check.id in silent) is is_meant, check.id
    assert {"gps_drift", "link_late", "signal_stale.speed"} <= silent
    assert not {"link_lost", "obstacle", "reach", "log_not_kept", "monitoring_impaired"} & silent


async def test_alarms_sound_again_when_it_ends() -> None:
    car = await stopped()
    car.faults = {Priority.WARNING}
    car.tick(1.0)
    await car.accepted(BEN, "end_planned_stop")  # who is not in control may end it
    assert stop_of(car) is None
    assert alarms(car) == {"test_warning": ("medium", False, "UNACKED")}
    assert [(one["change"], one["by"]) for one in logged(car)] == [
        ("planned_stop", "A. K. (Ann)"), ("planned_stop_ended", "Ben"),
    ]  # fmt: skip


async def test_what_stood_before_is_marked_and_its_age_goes_on() -> None:
    car = await in_control()
    car.faults = {Priority.WARNING}
    car.tick(3.0)
    before = car.session.frame()["alarms"][0]
    await car.accepted(ANN | AK, "planned_stop", reason="parked")
    after = car.session.frame()["alarms"][0]
    assert (before.get("planned_stop"), after.get("planned_stop")) == (False, True)
    assert (after["raised_ms"], after["occurrence"]) == (before["raised_ms"], before["occurrence"])


@pytest.mark.parametrize(
    ("mps", "is_ended"),
    [(0.0, False), (0.084, False), (MOVES_ABOVE_MPS, False), (MOVES_ABOVE_MPS + 0.01, True), (-0.5, True)],
)
async def test_it_ends_by_itself_when_the_car_moves(mps: float, is_ended: bool) -> None:
    car = await stopped()
    measured(car, mps)
    car.tick(0.05)
    assert (stop_of(car) is None) is is_ended
    ends = [one for one in logged(car) if one["change"] == "planned_stop_ended"]
    assert len(ends) == is_ended
    if is_ended:
        assert (ends[0]["by"], ends[0]["reason"]) == (None, "workshop")
        assert ends[0]["text"] == f"The planned stop ended: the car moves, {abs(mps):.1f} m/s."


async def test_a_speed_that_is_not_known_does_not_end_it_and_is_reported() -> None:
    car = await stopped()
    assert logged(car)[0]["text"] == (
        "Planned stop: in the workshop. The speed is not known: it does not end by itself until it is."
    )
    car.tick(0.5)
    assert stop_of(car) == {
        "reason": "workshop", "by": "A. K. (Ann)", "since_ms": 1_800_000_000_000, "is_speed_known": False,
    }  # fmt: skip
    measured(car, 0.0)
    assert stop_of(car)["is_speed_known"] is True  # type: ignore[index]
    car.tick(30.0)  # it is old now
    assert stop_of(car)["is_speed_known"] is False  # type: ignore[index]


async def test_who_may_begin_it_and_when() -> None:
    car = await in_control()
    assert "control" in await car.refused(BEN, "planned_stop", reason="parked")
    assert "reason" in await car.refused(ANN | AK, "planned_stop", reason="lunch")
    assert "meant for" in await car.refused(ANN | AK, "planned_stop", reason="parked", vehicle="puma")
    measured(car, 2.0)
    assert await car.refused(ANN | AK, "planned_stop", reason="parked") == (
        "The car moves, 2.0 m/s: a planned stop needs a car that stands."
    )
    assert logged(car) == []
    car.session.disconnect(by="Ann")
    assert "No car is monitored" in await car.refused(ANN | AK, "planned_stop", reason="parked")


async def test_another_reason_replaces_it_and_the_same_again_changes_nothing() -> None:
    car = await stopped()
    car.tick(5.0)
    for reason in ("workshop", "charging"):
        await car.accepted(ANN | AK, "planned_stop", reason=reason)
    assert [(one["reason"], one["person"]) for one in logged(car)] == [("workshop", "A. K."), ("charging", "A. K.")]


async def test_the_end_of_monitoring_ends_it() -> None:
    car = await stopped()
    car.session.disconnect(by="Ann")
    assert [one["change"] for one in logged(car)] == ["planned_stop", "planned_stop_ended"]
    assert stop_of(car) is None


async def test_it_is_read_back_at_a_hand_over() -> None:
    car = await stopped()
    await car.accepted(ANN | AK, "offer_control", to="page-b")
    handover = car.session.frame()["control"].get("handover")
    assert handover is not None
    (line,) = (one for one in handover["lines"] if one["kind"] == "planned_stop")
    assert (line["title"], line["since_ms"]) == ("Planned stop: in the workshop", 1_800_000_000_000)
    assert line["text"] == "Its alarms are marked; only critical ones sound. By A. K. (Ann)."

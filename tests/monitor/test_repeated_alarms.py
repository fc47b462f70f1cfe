"""What was announced is not announced again and again: it stands in the list, and a new cause is announced."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.alarm import Alarm, AlarmState, Transition
from monitor.alarm_life import advance
from monitor.alarm_spec import AlarmSpec, Place, Priority, Sound
from monitor.check import Finding, fault, ok
from monitor.checks.phone_missing import CHECKS as PHONE_MISSING
from monitor.phones import PhoneView
from monitor.restoring import restore
from monitor.values import GpsFix
from tests.monitor.checks.known import ask, known

pytestmark = pytest.mark.world(n=20)
SPEC = AlarmSpec(
    title="Test",
    priority=Priority.WARNING,
    place=Place.SNACKBAR,
    sound=Sound.LOW,
    needs_ack=True,
    off_delay_s=2.0,
    repeat_after_s=600.0,
)


def run(alarm: Alarm, findings: list[tuple[float, Finding]]) -> tuple[Alarm, list[Transition]]:
    happened: list[Transition] = []
    for at_s, finding in findings:
        alarm, more = advance(alarm, finding, at_s)
        happened += more
    return alarm, happened


def comes_and_goes(
    first_s: float, period_s: float, times: int, cause: str = "permission"
) -> list[tuple[float, Finding]]:
    return [
        (first_s + n * period_s + step * 0.1, fault("bad", causes=(cause,)) if step < period_s * 5 else ok("good"))
        for n in range(times)
        for step in range(round(period_s * 10))
    ]


def test_an_hour_of_coming_and_going_is_announced_once_in_ten_minutes() -> None:
    _, happened = run(Alarm(id="a", spec=SPEC), comes_and_goes(0.0, 20.0, 180))
    assert sum(one.change == "raised" for one in happened) == 180
    assert sum(one.announces for one in happened) == 6


def test_without_a_limit_each_is_announced() -> None:
    _, happened = run(Alarm(id="a", spec=replace(SPEC, repeat_after_s=0.0)), comes_and_goes(0.0, 20.0, 5))
    assert sum(one.announces for one in happened) == 5


def test_it_comes_back_as_it_was_left() -> None:
    alarm, _ = run(Alarm(id="a", spec=SPEC), [(0.0, fault("bad", causes=("x",)))])
    assert alarm.state is AlarmState.UNACKED
    gone = [(1.0, ok("good")), (4.0, ok("good"))]
    unseen, _ = run(alarm, [*gone, (5.0, fault("bad", causes=("x",)))])
    assert (unseen.state, unseen.occurrence) == (AlarmState.UNACKED, 1)
    seen, _ = run(replace(alarm, acknowledged=True), [*gone, (5.0, fault("bad", causes=("x",)))])
    assert (seen.state, seen.occurrence) == (AlarmState.ACKED, 1)


def test_a_new_cause_is_announced_and_an_old_one_is_not() -> None:
    def of(*causes: str) -> Finding:
        return fault("bad", causes=causes)

    _, happened = run(
        Alarm(id="a", spec=SPEC),
        [(0.0, of("denied")), (20.0, of("silent")), (40.0, of("denied")), (60.0, of("silent")), (700.0, of("denied"))],
    )
    assert [(one.change, one.announces) for one in happened] == [
        ("raised", True),
        ("recaused", True),
        ("recaused", True),  # ten minutes later
    ]


def test_a_restart_leaves_acknowledged_what_came_back_acknowledged() -> None:
    alarm, first = run(Alarm(id="a", spec=SPEC), [(0.0, fault("bad", causes=("x",)))])
    alarm = replace(alarm, acknowledged=True)
    _, more = run(alarm, [(1.0, ok("good")), (4.0, ok("good")), (5.0, fault("bad", causes=("x",)))])
    restored = restore({"a": Alarm(id="a", spec=SPEC)}, [*first, *more])["a"]
    assert restored.state is AlarmState.ACKED


def test_a_phone_that_never_had_a_position_and_leaves_is_no_loss() -> None:
    (check,) = PHONE_MISSING
    phone = PhoneView(phone="one", count=1, is_handheld=True, received_s=50.0, usable_s=40.0, why="denied")
    snapshot = known(100.0, position=GpsFix(lat_deg=32.23, lon_deg=-110.95, sigma_m=1.0))
    assert ask(check.id, replace(snapshot, phone=replace(phone, received_s=99.0))).verdict == "fault"
    assert ask(check.id, replace(snapshot, phone=phone)).text == "No phone is sharing its position"
    assert ask(check.id, replace(snapshot, phone=replace(phone, was_usable=True))).verdict == "fault"

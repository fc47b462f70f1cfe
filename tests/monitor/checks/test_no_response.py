"""Braking that is ordered and does not come: both sides of both limits, old and empty commands, the real drive."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from monitor.catalog import CHECKS
from monitor.check import Verdict
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts
from monitor.state import Reading, Snapshot, State
from monitor.values import MotionCommand, Twist
from tests.monitor.checks.known import ask, check_of, known
from tests.monitor.recorded import DRIVE, drive_speeds, rows

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
STOP = MotionCommand(speed_mps=0.0, tyre_angle_rad=None)


def driving(
    speed_mps: float, ordered_mps: float | None, slope_mps2: float | None = 0.0, *, age_s: float = 0.1
) -> Snapshot:
    snapshot = known(speed=Twist(speed_mps=speed_mps))
    command = Reading(
        value=MotionCommand(speed_mps=ordered_mps, tyre_angle_rad=None), received_s=100.0 - age_s, horizon_s=10.0
    )
    return replace(snapshot, readings={**snapshot.readings, "command": command}, speed_slope_mps2=slope_mps2)


@pytest.mark.parametrize(
    ("snapshot", "was_active", "verdict"),
    [
        pytest.param(driving(5.0, 5.0), False, OK, id="driven as ordered"),
        pytest.param(driving(5.0, 3.5), False, OK, id="at the margin"),
        pytest.param(driving(5.0, 3.4), False, FAULT, id="below it"),
        pytest.param(driving(5.0, 0.0), False, FAULT, id="ordered to stop"),
        pytest.param(driving(1.5, -4.0), False, OK, id="an order to reverse is one to stop"),
        pytest.param(driving(1.6, -4.0), False, FAULT, id="and is not followed"),
        pytest.param(driving(-5.0, 0.0), False, OK, id="reversing is not judged"),
        pytest.param(driving(5.0, 0.0, -0.3), False, OK, id="slows enough"),
        pytest.param(driving(5.0, 0.0, -0.29), False, FAULT, id="slows too little"),
        pytest.param(driving(5.0, 0.0, 2.0), False, FAULT, id="speeds up"),
        pytest.param(driving(5.0, 0.0, -0.33), True, FAULT, id="not yet cleared"),
        pytest.param(driving(5.0, 0.0, -0.37), True, OK, id="cleared"),
        pytest.param(driving(5.0, 0.0, age_s=1.0), False, FAULT, id="an order of a second ago"),
        pytest.param(driving(5.0, 0.0, age_s=1.1), False, UNKNOWN, id="an old order is none"),
        pytest.param(driving(5.0, None), False, UNKNOWN, id="null"),
        pytest.param(driving(5.0, math.nan), False, UNKNOWN, id="NaN"),
        pytest.param(driving(5.0, math.inf), False, UNKNOWN, id="+Inf"),
        pytest.param(driving(5.0, -math.inf), False, UNKNOWN, id="−Inf"),
        pytest.param(driving(math.nan, 0.0), False, UNKNOWN, id="speed NaN"),
        pytest.param(driving(math.inf, 0.0), False, UNKNOWN, id="speed infinite"),
        pytest.param(driving(5.0, 0.0, None), False, UNKNOWN, id="too few speeds"),
        pytest.param(known(speed=Twist(speed_mps=5.0)), False, UNKNOWN, id="no command"),
        pytest.param(known(command=STOP), False, UNKNOWN, id="no speed"),
        pytest.param(known(age_s=1.5, speed=Twist(speed_mps=5.0), command=STOP), False, UNKNOWN, id="stale"),
    ],
)
def test_verdict(snapshot: Snapshot, was_active: bool, verdict: Verdict) -> None:
    assert ask("no_response", snapshot, was_active=was_active).verdict is verdict


def test_both_limits_are_settings() -> None:
    assert ask("no_response", driving(5.0, 3.0), margin_mps=3.0).verdict is OK
    assert ask("no_response", driving(5.0, 0.0, -0.5), least_mps2=1.0).verdict is FAULT


def test_what_the_operator_reads_in_the_dialog() -> None:
    found = ask("no_response", driving(6.5, 0.0))
    assert found.text == "0.0 m/s ordered, 6.5 m/s driven: braking is commanded, the car does not slow down"
    spec = check_of("no_response").alarm
    assert (spec.place, spec.priority, spec.on_delay_s) == ("dialog", "critical", 1.0)


def raised_at(events: list[tuple[float, str, Twist | MotionCommand]]) -> list[float]:
    """When the whole judge announces it, over speeds and commands; ticks ten times a second."""
    monitor, state, tick_s, raised = Monitor(CHECKS), State(), 0.0, []
    state.link(LinkFacts(phase="monitoring", connected_s=0.0, published=frozenset({"speed", "command"})))
    for at_s, signal, value in sorted(events, key=lambda event: event[0]):
        while tick_s <= at_s:
            raised += [t.at_s for t in monitor.step(state.snapshot(tick_s)) if (t.alarm_id, t.change) == WANTED]
            tick_s += 0.1
        state.receive(signal, value, at_s)
        raised += [t.at_s for t in monitor.step(state.snapshot(at_s), {signal}) if (t.alarm_id, t.change) == WANTED]
    return raised


WANTED = ("no_response", "raised")


def order(speed_mps: float) -> MotionCommand:
    return MotionCommand(speed_mps=speed_mps, tyre_angle_rad=None)


@pytest.mark.parametrize(
    ("braking_mps2", "after_s", "raised"),
    [(0.0, 0.0, 1), (2.0, 0.5, 0), (2.0, 3.0, 1), (0.5, 0.2, 0)],
    ids=["never", "at once", "too late", "gently"],
)
def test_the_car_has_a_second_to_answer(braking_mps2: float, after_s: float, raised: int) -> None:
    """A stop is ordered at 10 s, at 5 m/s."""
    events: list[tuple[float, str, Twist | MotionCommand]] = []
    for n in range(300):
        at_s = 0.05 * n
        braked = max(0.0, at_s - 10.0 - after_s) * braking_mps2
        events.append((at_s, "speed", Twist(speed_mps=max(0.0, 5.0 - braked) + 0.002 * (n % 5))))
        events.append((at_s + 0.01, "command", order(5.0 if at_s < 10.0 else 0.0)))
    times = raised_at(events)
    assert len(times) == raised
    if raised:
        assert 11.0 <= times[0] <= 11.3


def real_drive(recordings: Path) -> list[tuple[float, str, Twist | MotionCommand]]:
    speeds = drive_speeds(recordings)
    start_s = speeds[0][0]
    events: list[tuple[float, str, Twist | MotionCommand]] = [
        (at_s - start_s, "speed", Twist(speed_mps=speed)) for at_s, speed in speeds
    ]
    for row in rows(recordings / DRIVE / "catvehicle-cmd_vel.csv"):
        events.append((float(row["Time"]) - start_s, "command", order(float(row["linear.x"]))))
    return events


def test_the_real_drive_answers_its_orders(recordings: Path) -> None:
    """Its brake comes 0.6 s after the command has fallen far below the speed: half of what is allowed."""
    assert raised_at(real_drive(recordings)) == []


def test_the_real_drive_would_have_alarmed_had_it_not(recordings: Path) -> None:
    ignoring = [
        (at_s, signal, order(0.0) if signal == "command" and 36.0 <= at_s < 40.0 else value)
        for at_s, signal, value in real_drive(recordings)
    ]
    (at_s,) = raised_at(ignoring)
    assert 37.0 <= at_s <= 38.5

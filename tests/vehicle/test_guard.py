"""What the guard on the car decides: who commands, when it slows the car, when it lets go."""

from __future__ import annotations

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from tests.vehicle.conftest import Command, Guard

DT = 0.05
DRIVING = Command(8.0, 0.1)


class Drive:
    """A guard with its clock; controller, heart and measured speed continue as long as they are set to."""

    def __init__(self, guard: Guard | None = None, speed_mps: float = 8.0) -> None:
        self.guard = guard or Guard()
        self.now_s = 100.0
        self.count = 0
        self.speed_mps = speed_mps
        self.out: list[tuple[float, Command]] = []

    def go(
        self, seconds: float, *, heart: bool = True, controller: bool = True, operator: Command | None = None
    ) -> None:
        for step in range(round(seconds / DT)):
            self.now_s += DT
            if heart and step % 4 == 0:
                self.count += 1
                self.guard.heartbeat(self.now_s, self.count)
            self.guard.speed(self.now_s, self.speed_mps)
            if controller:
                self.note(self.guard.controller(self.now_s, DRIVING.speed_mps, DRIVING.angle_rad))
            if operator is not None:
                self.note(self.guard.operator(self.now_s, operator.speed_mps, operator.angle_rad))
            self.note(self.guard.tick(self.now_s))

    def note(self, command: Command | None) -> None:
        if command is not None:
            self.out.append((self.now_s, command))
            self.speed_mps = command.speed_mps  # the car follows the command

    @property
    def state(self) -> str:
        return self.guard.state(self.now_s)


def test_without_an_operator_controllers_pass_and_nothing_is_guarded() -> None:
    drive = Drive()
    drive.go(5.0, heart=False)
    assert drive.state == "unguarded"
    assert {command for _, command in drive.out} == {DRIVING}


def test_with_a_heartbeat_controllers_pass_untouched() -> None:
    drive = Drive()
    drive.go(5.0)
    assert drive.state == "guarded"
    assert {command for _, command in drive.out} == {DRIVING}
    assert len(drive.out) == 100  # once each: a tick adds nothing


def test_when_the_heart_stops_the_car_is_slowed_by_the_ramp_and_held() -> None:
    drive = Drive()
    drive.go(3.0)
    beat_s = drive.now_s - 3 * DT
    drive.out.clear()
    drive.go(8.0, heart=False)
    began_s = next(at_s for at_s, command in drive.out if command.speed_mps < 8.0)
    assert 1.0 < began_s - beat_s <= 1.0 + 2 * DT + 1e-9
    stood_s = next(at_s for at_s, command in drive.out if command.speed_mps == 0.0)
    assert stood_s - began_s == pytest.approx(8.0 / 1.5, abs=2 * DT)
    assert {command.angle_rad for _, command in drive.out} == {0.1}  # zero would straighten the wheels
    assert drive.state == "holding"
    drive.go(60.0, heart=False)
    assert drive.out[-1][1] == Command(0.0, 0.1)


def test_a_heart_that_beats_again_releases_nothing() -> None:
    drive = Drive()
    drive.go(2.0)
    drive.go(2.0, heart=False)
    drive.go(3.0)
    assert drive.state == "slowing"
    assert drive.guard.report(drive.now_s)["why"] == "the operator's heartbeat stopped"
    assert drive.guard.release(drive.now_s, drive.guard.hold)
    assert drive.state == "guarded"
    drive.out.clear()
    drive.go(1.0)
    assert drive.out[-1][1] == DRIVING


@pytest.mark.parametrize("number", [0, 1, 3])
def test_a_release_of_another_hold_is_refused(number: int) -> None:
    drive = Drive()
    drive.go(1.0)
    drive.go(1.0, operator=Command(4.0, 0.0))
    assert drive.guard.release(drive.now_s, 1)
    drive.go(1.0, operator=Command(4.0, 0.0))
    assert drive.guard.hold == 2
    assert not drive.guard.release(drive.now_s, number)
    assert drive.state == "operator"


def test_a_release_without_a_heartbeat_is_refused() -> None:
    drive = Drive()
    drive.go(1.0)
    drive.go(2.0, heart=False)
    assert not drive.guard.release(drive.now_s, 1)
    assert drive.state == "slowing"


def test_nothing_is_held_so_nothing_is_released() -> None:
    drive = Drive()
    drive.go(1.0)
    assert not drive.guard.release(drive.now_s, 0)


def test_the_operator_goes_before_the_controllers() -> None:
    drive = Drive()
    drive.go(1.0)
    drive.go(DT, operator=Command(3.0, 0.05))
    drive.out.clear()
    drive.go(1.0, operator=Command(3.0, 0.05))
    assert drive.state == "operator"
    assert drive.out
    assert all(command.angle_rad == 0.05 and command.speed_mps <= 3.0 for _, command in drive.out)


def test_when_the_operators_commands_stop_the_guard_goes_on_down() -> None:
    drive = Drive()
    drive.go(1.0)
    drive.go(0.5, operator=Command(6.0, 0.05))
    drive.go(0.5, operator=None)
    assert drive.state == "slowing"
    drive.go(6.0)
    assert drive.state == "holding"
    assert drive.out[-1][1] == Command(0.0, 0.05)


def test_an_operators_command_never_speeds_the_car_up() -> None:
    drive = Drive()
    drive.go(1.0)
    drive.go(2.0, operator=Command(50.0, 0.0))
    assert drive.out[-1][1].speed_mps == pytest.approx(8.0 - 1.5 * 2.0, abs=0.2)


def test_farewell_ends_the_watch_but_no_hold() -> None:
    drive = Drive()
    drive.go(1.0)
    drive.guard.heartbeat(drive.now_s, 0)
    drive.go(5.0, heart=False)
    assert drive.state == "unguarded"
    assert drive.out[-1][1] == DRIVING
    drive.go(1.0)
    drive.go(2.0, heart=False)
    assert drive.state == "slowing"
    drive.guard.heartbeat(drive.now_s, 0)
    drive.go(1.0, heart=False)
    assert drive.state == "slowing"


def test_a_count_that_does_not_change_is_no_heart() -> None:
    drive = Drive()
    drive.go(1.0)
    for _ in range(40):
        drive.guard.heartbeat(drive.now_s, drive.count)
        drive.go(DT, heart=False)
    assert drive.state == "slowing"


def test_a_car_that_rolls_backwards_is_slowed_to_zero_too() -> None:
    drive = Drive(speed_mps=-3.0)
    drive.go(1.0, controller=False)
    drive.go(2.0, heart=False, controller=False)
    speeds = [command.speed_mps for _, command in drive.out]
    assert -3.0 <= speeds[0] < -2.8
    assert speeds == sorted(speeds)
    drive.go(3.0, heart=False, controller=False)
    assert drive.out[-1][1].speed_mps == 0.0


def test_where_no_speed_is_measured_the_ramp_begins_at_the_last_command() -> None:
    guard = Guard()
    guard.heartbeat(0.0, 1)
    assert guard.controller(0.1, 5.0, 0.2) == Command(5.0, 0.2)
    held = guard.tick(1.2)
    assert held == Command(5.0, 0.2)
    later = guard.tick(2.2)
    assert later is not None
    assert later.speed_mps == pytest.approx(3.5)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_commands_nothing(value: float) -> None:
    guard = Guard()
    assert guard.controller(0.0, value, 0.0) is None
    assert guard.operator(0.0, value, 0.0) is None
    guard.speed(0.0, value)
    assert guard.controller(0.1, 4.0, 0.3) == Command(4.0, 0.3)
    assert guard.controller(0.2, 4.0, value) == Command(4.0, 0.3)  # the last angle stays
    assert guard.state(0.2) == "unguarded"


@pytest.mark.parametrize("deceleration", [0.0, 0.05, 4.7, math.nan, -1.5])
def test_a_deceleration_that_is_none_is_refused(deceleration: float) -> None:
    with pytest.raises(ValueError, match="deceleration"):
        Guard(deceleration)


@pytest.mark.parametrize("seconds", [0.0, 0.3, 11.0, math.nan])
def test_a_time_that_guards_nothing_is_refused(seconds: float) -> None:
    with pytest.raises(ValueError, match="heartbeat"):
        Guard(heartbeat_s=seconds)


def test_the_clock_of_a_machine_that_slept_makes_no_leap_up() -> None:
    """After an hour in one step the car is held at zero, whatever is sent next."""
    drive = Drive()
    drive.go(1.0)
    drive.now_s += 3600.0
    drive.go(DT, heart=False)
    assert drive.state in ("slowing", "holding")
    drive.go(7.0, heart=False)
    assert drive.out[-1][1].speed_mps == 0.0


class Life(RuleBasedStateMachine):
    """Whatever the input, the speed of a held car never rises, no NaN is sent, and only a release ends the hold."""

    def __init__(self) -> None:
        super().__init__()
        self.guard = Guard()
        self.now_s = 0.0
        self.count = 1
        self.last_command: Command | None = None
        self.was_held = False
        self.limit_mps = math.inf
        self.released = False

    def hear(self, command: Command | None) -> None:
        if command is not None:
            self.last_command = command

    @rule(seconds=st.floats(0.0, 3.0))
    def time(self, seconds: float) -> None:
        self.now_s += seconds
        self.hear(self.guard.tick(self.now_s))

    @rule(speed=st.floats(-20, 20) | st.just(math.nan), angle=st.floats(-0.5, 0.5) | st.just(math.nan))
    def controller(self, speed: float, angle: float) -> None:
        held = self.held
        out = self.guard.controller(self.now_s, speed, angle)
        assert not (held and out)
        self.hear(out)

    @rule(speed=st.floats(-20, 20) | st.just(math.inf), angle=st.floats(-0.5, 0.5) | st.just(math.nan))
    def operator(self, speed: float, angle: float) -> None:
        self.hear(self.guard.operator(self.now_s, speed, angle))
        if math.isfinite(speed):
            assert self.held

    @rule(step=st.integers(0, 1))
    def heartbeat(self, step: int) -> None:
        self.count += step
        self.guard.heartbeat(self.now_s, self.count)

    @rule()
    def farewell(self) -> None:
        self.guard.heartbeat(self.now_s, 0)

    @rule(speed=st.floats(-20, 20) | st.just(math.nan))
    def measured(self, speed: float) -> None:
        self.guard.speed(self.now_s, speed)

    @precondition(lambda self: self.held)
    @rule(back=st.integers(0, 2))
    def release(self, back: int) -> None:
        if self.guard.release(self.now_s, self.guard.hold - back):
            assert back == 0
            self.released = True

    @property
    def held(self) -> bool:
        return self.guard.state(self.now_s) in ("operator", "slowing", "holding")

    @invariant()
    def never_faster_while_held_and_never_let_go_by_itself(self) -> None:
        if self.last_command is not None:
            assert math.isfinite(self.last_command.speed_mps)
            assert math.isfinite(self.last_command.angle_rad)
        held = self.held
        if self.was_held and not self.released:
            assert held
        if held:
            command = self.guard.tick(self.now_s)
            assert command is not None
            assert abs(command.speed_mps) <= self.limit_mps + 1e-9
            self.limit_mps = abs(command.speed_mps)
        else:
            self.limit_mps = math.inf
        self.was_held, self.released = held, False


TestLife = Life.TestCase
TestLife.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)

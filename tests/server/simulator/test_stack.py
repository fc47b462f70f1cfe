"""What reaches the wheels of the simulated car: the last command, the obstacle stopper, silence."""

from __future__ import annotations

import math
from typing import Any

import pytest

from server.simulator.car import SimulatedCar
from server.simulator.scenarios import planned
from server.simulator.vehicle import MotionCommand, Stack

COMMAND = MotionCommand(speed_mps=6.0, tyre_rad=0.1)
HALTED = MotionCommand(speed_mps=0.0, tyre_rad=0.1)
SLOWER = {"linear": {"x": 2.0}, "angular": {"z": 0.0}}


@pytest.mark.parametrize(
    ("age_s", "distance_m", "with_stopper"),
    [
        (0.0, math.inf, COMMAND),
        (0.19, math.inf, COMMAND),
        (0.21, math.inf, HALTED),  # its dead-man
        (1e6, math.inf, HALTED),
        (0.0, 5.01, COMMAND),
        (0.0, 5.0, HALTED),  # its standoff
        (0.0, 0.0, HALTED),
        (0.0, math.nan, COMMAND),  # an estimator that tells no number stops nobody: it is no safety function
    ],
)
def test_the_stopper_steps_in_and_without_one_the_last_command_stays(
    age_s: float, distance_m: float, with_stopper: MotionCommand
) -> None:
    for has_stopper, expected in ((True, with_stopper), (False, COMMAND)):
        stack = Stack(has_stopper=has_stopper)
        stack.receive(COMMAND, 100.0)
        stack.see(distance_m)
        assert stack.passed(100.0 + age_s) == expected


def test_before_any_command_the_car_stands() -> None:
    assert Stack().passed(0.0).speed_mps == 0.0
    assert Stack(has_stopper=False).passed(0.0).speed_mps == 0.0


class Drive:
    """A simulated car and its one stream of steps."""

    def __init__(self, **how: Any) -> None:
        self.car = SimulatedCar(**how)
        self._steps = self.car.steps()

    @property
    def speed_mps(self) -> float:
        return self.car.motion.speed_mps

    def until(self, until_s: float, message: dict[str, dict[str, float]] | None = None) -> list[float]:
        """Drives on and answers the accelerations [m/s²]; with a message, a client sends it 20 times a second, halfway
        between the driver's commands."""
        accelerations = []
        next_s = self.car.elapsed_s + 0.027
        while self.car.elapsed_s < until_s:
            if message is not None and self.car.elapsed_s >= next_s:
                self.car.follow(message)
                next_s += 0.05
            next(self._steps)
            accelerations.append(self.car.motion.acceleration_mps2)
        return accelerations


@pytest.mark.parametrize("has_stopper", [True, False])
def test_in_silence_the_stopper_brakes_and_the_bare_car_keeps_its_speed(has_stopper: bool) -> None:
    drive = Drive(plan=(planned("controller-silent@10+10"),), has_stopper=has_stopper)
    drive.until(10.0)
    before_mps = drive.speed_mps
    assert before_mps > 6.0
    drive.until(14.0)
    assert drive.speed_mps == (0.0 if has_stopper else pytest.approx(before_mps, abs=0.3))


def test_after_its_silence_the_driver_takes_the_wheel_from_the_speed_that_is() -> None:
    drive = Drive(plan=(planned("controller-silent@10+6"),))
    drive.until(15.9)
    assert drive.speed_mps == 0.0
    drive.until(16.5)
    assert 0.0 <= drive.speed_mps < 1.0
    drive.until(30.0)
    assert drive.speed_mps > 3.0


def test_a_controller_that_competes_undoes_half_of_what_is_ordered() -> None:
    polite, rival = Drive(), Drive(gives_way=False)
    for drive in (polite, rival):
        drive.until(10.0)
        drive.until(13.0, SLOWER)
    assert polite.speed_mps == pytest.approx(2.0, abs=0.2)
    assert rival.speed_mps > 3.0


def test_a_client_that_falls_silent_is_followed_by_the_stopper_and_then_by_the_driver() -> None:
    drive = Drive()
    drive.until(10.0)
    drive.until(12.0, {"linear": {"x": 6.0}, "angular": {"z": 0.0}})
    assert min(drive.until(12.45)) < -1.5  # 0.2 s after the last command
    drive.until(15.0)
    assert drive.speed_mps > 3.0

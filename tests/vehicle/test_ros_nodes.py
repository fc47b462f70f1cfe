"""The guard as a node on real ROS: Debian's rospy with a roscore, and rclpy from its wheels."""

from __future__ import annotations

import math
import runpy
import signal
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.vehicle import ros_nodes
from tests.vehicle.conftest import GUARD
from tests.vehicle.ros_nodes import Car

pytestmark = [pytest.mark.slow, pytest.mark.world(n=2), pytest.mark.timeout(120), pytest.mark.field]
FAST_MPS2 = 4.6  # so that the tests need not wait long for standstill
DRIVING = {"controller": [3.0, 0.1], "speed": "follows"}


@pytest.fixture(scope="module", params=[1, 2], ids=["ros1", "ros2"])
def ros(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[int, dict[str, str]]]:
    why = ros_nodes.missing(request.param)
    if why is not None:
        pytest.skip(why)
    make = {1: ros_nodes.ros1, 2: ros_nodes.ros2}[request.param]
    with make(tmp_path_factory.mktemp("ros")) as environment:
        yield request.param, environment


@pytest.fixture
def car(ros: tuple[int, dict[str, str]], tmp_path: Path) -> Iterator[Car]:
    made = Car(*ros, tmp_path)
    try:
        yield made
    finally:
        made.end()


def test_silence_of_the_operator_slows_the_car_and_only_a_release_lets_it_drive_again(car: Car) -> None:
    car.start(deceleration_mps2=3)  # a whole number is a number too
    car.publish(**DRIVING)
    car.until(lambda: len(car.commands_since(0.0)) > 5)
    assert car.state == "unguarded"  # no operator yet: controllers pass, nothing is guarded
    car.publish(heartbeat=True)
    car.until_state("guarded")
    assert {(v, a) for _, v, a in car.commands_since(0.0)} == {(3.0, 0.1)}

    car.publish(heartbeat=False)
    car.until(lambda: car.commands_since(0.0)[-1][1] < 3.0)
    slowing = car.states_since(0.0)[-1]
    car.until_state("holding")
    commands = car.commands_since(0.0)
    began_s = next(at_s for at_s, v, _ in commands if v < 3.0)
    stood_s = next(at_s for at_s, v, _ in commands if v == 0.0)
    assert slowing["heartbeat_age_s"] <= 1.3
    assert stood_s - began_s == pytest.approx(3.0 / 3.0, abs=0.3)
    assert {a for _, _, a in commands} == {0.1}  # zero would straighten the wheels
    speeds = [v for _, v, _ in commands]
    assert speeds == sorted(speeds, reverse=True)

    hold = car.states_since(0.0)[-1]["hold"]
    car.publish(release=hold)  # without a heartbeat
    held_s = car.commands_since(0.0)[-1][0]
    car.until(lambda: len(car.commands_since(held_s)) > 10)  # half a second, by the guard's own ticks
    car.publish(heartbeat=True)
    alive_s = car.until(lambda: (car.states_since(0.0)[-1]["heartbeat_age_s"] or 9.0) < 0.5)
    car.publish(release=hold + 1)  # another hold
    car.until(lambda: len(car.commands_since(alive_s)) > 10)
    assert car.state == "holding"
    assert {v for _, v, _ in car.commands_since(alive_s)} == {0.0}
    car.publish(release=hold)
    car.until_state("guarded")
    car.until(lambda: car.commands_since(alive_s)[-1][1:] == (3.0, 0.1))


def test_the_operators_command_goes_before_the_controllers_and_the_ramp_goes_on_without_it(car: Car) -> None:
    car.start(deceleration_mps2=FAST_MPS2)
    car.publish(heartbeat=True, **DRIVING)
    car.until_state("guarded")
    car.publish(operator=[2.0, 0.05])
    began_s = car.until(lambda: car.state == "operator" and car.commands_since(0.0)[-1][1] <= 2.0)
    car.until(lambda: len(car.commands_since(began_s)) > 10)
    ordered = car.commands_since(began_s)
    assert {a for _, _, a in ordered} == {0.05}
    assert max(v for _, v, _ in ordered) <= 2.0  # no controller's command among them
    car.publish(operator=None)
    car.until_state("holding")  # while the heart beats and the controller goes on
    assert car.commands_since(0.0)[-1][1:] == (0.0, 0.05)


def test_without_a_known_speed_the_ramp_begins_at_what_was_commanded_and_no_nan_passes(car: Car) -> None:
    car.start(deceleration_mps2=1.5)
    car.publish(heartbeat=True, controller=[2.0, 0.1], speed=math.nan)
    car.until_state("guarded")
    car.until(lambda: len(car.commands_since(0.0)) > 3)
    car.publish(controller=[2.0, math.nan])
    seen_s = car.until(lambda: len(car.commands_since(0.0)) > 10)
    car.publish(controller=[math.nan, 0.2])
    car.until(lambda: (car.states_since(seen_s) or [{"controller_age_s": 0}])[-1]["controller_age_s"] > 0.4)
    assert {(v, a) for _, v, a in car.commands_since(0.0)} == {(2.0, 0.1)}
    car.publish(heartbeat=False)
    car.until_state("slowing")
    car.until_state("holding")
    commands = [(v, a) for _, v, a in car.commands_since(0.0)]
    assert all(math.isfinite(v) and a == 0.1 for v, a in commands)
    first = next(v for v, _ in commands if v < 2.0)
    assert first > 1.7  # the ramp began at 2.0


def test_a_killed_node_starts_again_and_takes_no_command_from_before(car: Car) -> None:
    car.start(deceleration_mps2=FAST_MPS2)
    car.publish(heartbeat=True, **DRIVING)
    car.until_state("guarded")
    car.publish(operator=[2.0, 0.0])
    hold = car.until_state("operator")["hold"]
    car.publish(operator=None, release=hold)
    car.until_state("guarded")
    assert car.guard is not None
    car.guard.end(signal.SIGKILL)
    car.start(deceleration_mps2=FAST_MPS2)
    again_s = car.until(lambda: car.state == "guarded")
    car.until(lambda: len(car.commands_since(again_s)) > 10)
    assert {(v, a) for _, v, a in car.commands_since(again_s)} == {(3.0, 0.1)}
    assert car.states_since(again_s)[-1]["hold"] == 0  # the operator's command of before was not delivered again
    car.publish(heartbeat=False)
    car.until_state("slowing")


def test_the_node_ends_on_request_and_without_a_traceback(car: Car) -> None:
    for by in (signal.SIGTERM, signal.SIGINT):
        car.start()
        assert car.guard is not None
        assert car.guard.end(by) == 0, car.guard.lines
        assert not any("Traceback" in line for line in car.guard.lines), car.guard.lines


def test_a_simulated_clock_that_stands_still_does_not_stop_the_guard(car: Car) -> None:
    car.start(deceleration_mps2=FAST_MPS2, use_sim_time="true")
    car.publish(heartbeat=True, **DRIVING)
    car.until_state("guarded")
    car.publish(heartbeat=False)
    car.until_state("holding")


def test_the_launch_file_starts_the_guard_before_the_command_topic_of_the_car(
    car: Car, monkeypatch: pytest.MonkeyPatch
) -> None:
    if car.version == 1:
        command = ["roslaunch", "ocu_guard", "ocu_guard.launch", f"deceleration_mps2:={FAST_MPS2}"]
    else:
        node = launched(monkeypatch)
        assert (node["package"], node["executable"], node["name"]) == ("ocu_guard", "ocu_guard_node", "ocu_guard")
        assert node["respawn"]
        command = car.command(dict(node["remappings"]), {"deceleration_mps2": FAST_MPS2})
    car.run(command, "/catvehicle", "")
    car.publish(heartbeat=True, **DRIVING)
    car.until_state("guarded")
    car.until(lambda: len(car.commands_since(0.0)) > 5)
    if car.version == 1:  # roslaunch starts it again
        assert car.guard is not None
        (running,) = psutil.Process(car.guard.pid).children()
        running.kill()
        killed_s = car.until(lambda: not running.is_running())
        car.until(lambda: len(car.commands_since(killed_s + 0.5)) > 5, 30.0)
        car.until_state("guarded")
    car.publish(heartbeat=False)
    car.until_state("holding")


def launched(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The arguments of the one node that ocu_guard.launch.py starts. There is no wheel of ROS 2's launch."""
    names = ("launch", "launch_ros", "launch_ros.actions")
    launch, launch_ros, actions = (types.ModuleType(name) for name in names)
    vars(launch)["LaunchDescription"] = list
    vars(actions)["Node"] = dict
    for name, module in zip(names, (launch, launch_ros, actions), strict=True):
        monkeypatch.setitem(sys.modules, name, module)
    made = runpy.run_path(str(GUARD / "launch" / "ocu_guard.launch.py"))
    (node,) = made["generate_launch_description"]()
    return dict(node)

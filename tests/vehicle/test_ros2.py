"""The guard as a ROS 2 node. rclpy is not to be had here, so it is played by the part of it that the node touches."""

from __future__ import annotations

import importlib
import json
import sys
import types
from collections.abc import Callable, Iterator
from typing import Any

import pytest


class Twist:
    def __init__(self, speed_mps: float = 0.0, angle_rad: float = 0.0) -> None:
        self.linear = types.SimpleNamespace(x=speed_mps, y=0.0, z=0.0)
        self.angular = types.SimpleNamespace(x=0.0, y=0.0, z=angle_rad)


class Data:
    def __init__(self, data: Any = None) -> None:
        self.data = data


class String(Data): ...


class UInt32(Data): ...


class RosNode:
    """rclpy.node.Node, as far as the guard knows it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.parameters: dict[str, Any] = {}
        self.sent: dict[str, list[Any]] = {}
        self.types: dict[str, type] = {}
        self.ears: dict[str, Callable[[Any], None]] = {}
        self.timers_: list[tuple[float, Callable[[], None], Any]] = []

    def declare_parameter(self, name: str, value: Any) -> None:
        self.parameters[name] = value

    def get_parameter(self, name: str) -> Any:
        return types.SimpleNamespace(value=self.parameters[name])

    def create_publisher(self, kind: type, topic: str, qos: Any) -> Any:
        self.types[topic] = kind
        return types.SimpleNamespace(publish=self.sent.setdefault(topic, []).append)

    def create_subscription(self, kind: type, topic: str, hear: Callable[[Any], None], qos: Any) -> None:
        self.types[topic] = kind
        self.ears[topic] = hear

    def create_timer(self, period_s: float, call: Callable[[], None], *, clock: Any) -> None:
        self.timers_.append((period_s, call, clock))


def module(name: str, **content: Any) -> types.ModuleType:
    made = types.ModuleType(name)
    vars(made).update(content)
    return made


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    fakes = (
        module("rclpy"),
        module("rclpy.node", Node=RosNode),
        module(
            "rclpy.clock", Clock=lambda *, clock_type: clock_type, ClockType=types.SimpleNamespace(STEADY_TIME="steady")
        ),
        module(
            "rclpy.qos",
            QoSProfile=lambda **how: how,
            DurabilityPolicy=types.SimpleNamespace(TRANSIENT_LOCAL="transient local"),
        ),
        module("geometry_msgs"),
        module("geometry_msgs.msg", Twist=Twist),
        module("std_msgs"),
        module("std_msgs.msg", String=String, UInt32=UInt32),
    )
    for fake in fakes:
        monkeypatch.setitem(sys.modules, fake.__name__, fake)
    monkeypatch.delitem(sys.modules, "ocu_guard.ros2", raising=False)
    yield importlib.import_module("ocu_guard.ros2").Node()
    sys.modules.pop("ocu_guard.ros2", None)


def test_it_stands_between_the_controllers_and_the_car(node: Any) -> None:
    assert {topic: kind.__name__ for topic, kind in node.types.items()} == {
        "cmd_vel": "Twist",
        "cmd_vel_controller": "Twist",
        "vel": "Twist",
        "ocu_guard/cmd_vel": "Twist",
        "ocu_guard/heartbeat": "UInt32",
        "ocu_guard/release": "UInt32",
        "ocu_guard/state": "String",
    }
    assert set(node.ears) == set(node.types) - {"cmd_vel", "ocu_guard/state"}


def test_it_ticks_by_a_clock_that_no_simulation_stops(node: Any) -> None:
    ((period_s, _, clock),) = node.timers_
    assert (period_s, clock) == (pytest.approx(0.05), "steady")


def test_what_it_hears_and_ticks_goes_through_the_guard(node: Any) -> None:
    node.ears["ocu_guard/heartbeat"](UInt32(7))
    node.ears["vel"](Twist(4.0))
    node.ears["cmd_vel_controller"](Twist(5.0, 0.1))
    assert [(sent.linear.x, sent.angular.z) for sent in node.sent["cmd_vel"]] == [(5.0, 0.1)]
    node.ears["ocu_guard/cmd_vel"](Twist(2.0, 0.2))
    node.ears["cmd_vel_controller"](Twist(5.0, 0.1))
    (_, tick, _), *_ = node.timers_
    tick()
    ordered, ticked = node.sent["cmd_vel"][1:]
    assert (ordered.linear.x, ordered.angular.z) == (2.0, 0.2)
    assert 1.5 < ticked.linear.x <= 2.0  # a moment further down the ramp
    assert ticked.angular.z == 0.2
    said = json.loads(node.sent["ocu_guard/state"][-1].data)
    assert (said["state"], said["hold"]) == ("operator", 1)
    node.ears["ocu_guard/release"](UInt32(1))
    tick()
    assert json.loads(node.sent["ocu_guard/state"][-1].data)["state"] == "guarded"

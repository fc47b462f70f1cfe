"""The order, its ramp, its message and the way to the car, without a clock and without a car."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.alarm import Refused
from server.judge.topics import Source
from server.slowdown.command_target import CommandTarget, kind_of, target_of, twist_message
from server.slowdown.order import Car, Ramp, SlowDown

WAY = CommandTarget(topic="/cmd_vel", type="geometry_msgs/Twist", kind="Twist")
NO_WAY = CommandTarget(problem="No car is connected.")
DRIVES = Car(speed_mps=6.0, tyre_rad=0.1)


def begun(life: SlowDown, now_s: float = 10.0, **more: Any) -> None:
    life.arm(WAY, "Ann")
    how = {"by": "Ann", "why": "by hand", "deceleration_mps2": 1.5, "now_s": now_s, "pressed_s": None}
    life.begin(WAY, **how | more)


@given(
    speed=st.floats(-40, 40),
    deceleration=st.floats(0.01, 4.6),
    steps=st.lists(st.floats(0, 5), min_size=1, max_size=30),
)
def test_a_ramp_never_rises_and_ends_at_zero(speed: float, deceleration: float, steps: list[float]) -> None:
    ramp = Ramp(from_mps=speed, tyre_rad=0.0, deceleration_mps2=deceleration, began_s=100.0)
    now_s, before = 100.0, abs(speed)
    for step in steps:
        now_s += step
        ordered_mps = ramp.speed_mps(now_s)
        assert abs(ordered_mps) <= before
        assert ordered_mps == 0.0 or math.copysign(1, ordered_mps) == math.copysign(1, speed)
        before = abs(ordered_mps)
    assert ramp.speed_mps(100.0 + abs(speed) / deceleration + 0.001) == 0.0


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("from_mps", math.nan),
        ("from_mps", math.inf),
        ("tyre_rad", math.nan),
        ("deceleration_mps2", 0.0),
        ("deceleration_mps2", 4.61),
        ("deceleration_mps2", math.nan),
    ],
)
def test_a_ramp_of_nothing_is_refused(field: str, value: float) -> None:
    good = {"from_mps": 1.0, "tyre_rad": 0.0, "deceleration_mps2": 1.5, "began_s": 0.0}
    with pytest.raises(ValueError, match=r"A ramp|A deceleration"):
        Ramp(**good | {field: value})


@pytest.mark.parametrize(
    ("type", "kind"),
    [
        ("geometry_msgs/Twist", "Twist"),
        ("geometry_msgs/msg/Twist", "Twist"),
        ("geometry_msgs/TwistStamped", "TwistStamped"),
        ("geometry_msgs/msg/TwistStamped", "TwistStamped"),
        ("geometry_msgs/TwistWithCovariance", None),
        ("my_msgs/Twist", None),
        ("std_msgs/String", None),
        ("", None),
    ],
)
def test_only_twists_command_a_car(type: str, kind: str | None) -> None:
    assert kind_of(type) == kind


@pytest.mark.parametrize(
    ("ros_version", "stamp"),
    [(1, {"secs": 1_790_000_000, "nsecs": 5}), (2, {"sec": 1_790_000_000, "nanosec": 5})],
)
def test_a_stamped_command_carries_the_stamp_of_its_ros(ros_version: int, stamp: dict[str, int]) -> None:
    message = twist_message("TwistStamped", 2.0, -0.1, stamp_ns=1_790_000_000_000_000_005, ros_version=ros_version)
    assert message["header"]["stamp"] == stamp
    assert message["twist"] == twist_message("Twist", 2.0, -0.1, stamp_ns=0, ros_version=ros_version)
    assert (message["twist"]["linear"]["x"], message["twist"]["angular"]["z"]) == (2.0, -0.1)


def source(topic: str, type: str | None) -> Source:
    return Source(signal="command", topic=topic, type=type, decode=None, note=None)


@pytest.mark.parametrize(
    ("phase", "sources", "offered", "topic", "problem"),
    [
        ("idle", {}, None, "", "No car is connected."),
        ("connecting", {}, None, "", "No car is connected."),
        ("monitoring", {}, None, "", "the type is not confirmed"),
        ("monitoring", {}, {"/vel": "geometry_msgs/Twist"}, "", "no command topic"),
        (
            "monitoring",
            {"command": source("/c", "std_msgs/String")},
            {"/c": "std_msgs/String"},
            "/c",
            "is std_msgs/String",
        ),
        ("monitoring", {"command": source("/c", None)}, {}, "/c", "of unknown type"),
        ("monitoring", {"command": source("/c", "geometry_msgs/Twist")}, {"/c": "geometry_msgs/Twist"}, "/c", None),
        ("lost", {"command": source("/c", "geometry_msgs/Twist")}, {"/c": "geometry_msgs/Twist"}, "/c", None),
        (
            "monitoring",
            {"command": source("/c", "geometry_msgs/Twist")},
            {"/ocu_guard/state": "std_msgs/String", "/ocu_guard/cmd_vel": "geometry_msgs/Twist"},
            "/ocu_guard/cmd_vel",
            None,
        ),
    ],
)
def test_the_target_is_known_or_its_problem_is_reported(
    phase: str, sources: dict[str, Source], offered: dict[str, str] | None, topic: str, problem: str | None
) -> None:
    way = target_of(phase=phase, sources=sources, offered=offered)
    assert way.topic == topic
    assert (way.problem is None) == (problem is None)
    assert (problem or "") in (way.problem or "")
    assert (way.kind is not None) == (way.problem is None)


def test_it_is_not_armed_until_it_is_armed_and_armed_until_it_is_ordered() -> None:
    life = SlowDown()
    assert life.state(NO_WAY, 0.0) == "not_available"
    assert life.state(WAY, 0.0) == "not_armed"
    with pytest.raises(Refused, match="not armed"):
        life.begin(WAY, by="Ann", why="by hand", deceleration_mps2=1.5, now_s=0.0, pressed_s=None)
    with pytest.raises(Refused, match="No car"):
        life.arm(NO_WAY, "Ann")
    assert life.arm(WAY, "Ann")
    assert not life.arm(WAY, "Ben")
    assert (life.state(WAY, 0.0), life.armed_by) == ("armed", "Ann")
    begun(life)
    assert life.state(WAY, 10.0) == "ordered"
    assert life.state(NO_WAY, 10.0) == "ordered"  # an order stands, whatever became of the way
    with pytest.raises(Refused, match="release it first"):
        life.disarm()


def test_a_ramp_that_was_cut_begins_anew_at_the_measured_speed() -> None:
    life = SlowDown()
    begun(life)
    first = life.next(DRIVES, 10.0)
    assert first is not None
    assert (first.speed_mps, first.tyre_rad) == (6.0, 0.1)
    assert life.sent(first, 10.0)
    second = life.next(DRIVES, 11.0)
    assert second is not None
    assert second.speed_mps == pytest.approx(4.5)
    assert not life.sent(second, 11.0)
    assert life.cut()
    assert not life.cut()
    again = life.next(Car(speed_mps=5.5, tyre_rad=-0.2), 14.0)
    assert again is not None
    assert (again.speed_mps, again.tyre_rad) == (5.5, -0.2)


def test_without_a_tyre_angle_nothing_is_commanded() -> None:
    life = SlowDown()
    begun(life)
    assert life.next(Car(speed_mps=6.0, tyre_rad=None), 10.0) is None


@pytest.mark.parametrize(("was_sent", "begins_mps"), [(True, 6.0), (False, 0.0)])
def test_without_a_speed_it_begins_at_the_last_command_or_at_zero(was_sent: bool, begins_mps: float) -> None:
    life = SlowDown()
    begun(life)
    if was_sent:
        command = life.next(DRIVES, 10.0)
        assert command is not None
        life.sent(command, 10.0)
        life.cut()
    blind = life.next(Car(speed_mps=None, tyre_rad=None if was_sent else 0.1), 12.0)
    assert blind is not None
    assert (blind.speed_mps, blind.tyre_rad) == (begins_mps, 0.1)


def test_only_the_order_that_is_named_is_released() -> None:
    life = SlowDown(number=41)
    with pytest.raises(Refused, match="not being slowed"):
        life.release(41)
    begun(life)
    assert life.order is not None
    assert life.order.number == 42
    for wrong in (0, 41, 43):
        with pytest.raises(Refused, match="newer slow-down order"):
            life.release(wrong)
    assert life.release(42).number == 42
    assert life.state(WAY, 0.0) == "armed"


def test_it_ends_by_time_and_by_another_car() -> None:
    life = SlowDown()
    begun(life)
    assert not life.is_too_long(600.0, 609.9)
    assert life.is_too_long(600.0, 610.0)
    assert life.end("longest", 610.0) is not None
    assert (life.ended_at_longest_s, life.armed_by) == (610.0, "Ann")
    begun(life, 620.0)
    assert life.ended_at_longest_s is None
    life.end("disconnected", 630.0)
    assert (life.order, life.armed_by) == (None, None)

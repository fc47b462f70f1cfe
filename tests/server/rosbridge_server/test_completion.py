"""What clients publish, checked and completed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from server.rosbridge_server.completion import Completion, Unfit
from server.rosbridge_server.shape import stamp
from server.rosbridge_server.types import MessageTypes

ROS1, ROS2 = MessageTypes(1), MessageTypes(2)


def test_what_was_left_out_is_zero_and_the_header_is_now() -> None:
    made = ROS1.complete("nav_msgs/Odometry", {"header": {"frame_id": "odom"}, "child_frame_id": "base"}, 12.5)
    assert made["header"] == {"seq": 0, "stamp": {"secs": 12, "nsecs": 500_000_000}, "frame_id": "odom"}
    assert made["child_frame_id"] == "base"
    assert made["pose"]["pose"]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
    assert np.array_equal(made["pose"]["covariance"], np.zeros(36))


def test_a_given_stamp_stays() -> None:
    made = ROS2.complete("std_msgs/msg/Header", {"stamp": {"sec": 3, "nanosec": 4}}, 12.5)
    assert made == {"stamp": {"sec": 3, "nanosec": 4}, "frame_id": ""}
    assert ROS1.complete("std_msgs/Time", {"data": "now"}, 2.0) == {"data": {"secs": 2, "nsecs": 0}}


def test_ros_2_takes_the_names_of_ros_1_and_now() -> None:
    """roslibpy writes the header of ROS 1 in both versions."""
    notes: list[str] = []
    given = {"stamp": {"secs": 3, "nsecs": 4}, "frame_id": "a", "seq": 1}
    with pytest.raises(Unfit, match="does not have a field seq"):
        ROS2.complete("std_msgs/msg/Header", given, 12.5, notes)
    del given["seq"]
    assert ROS2.complete("std_msgs/msg/Header", given, 12.5, notes)["stamp"] == {"sec": 3, "nanosec": 4}
    assert ROS2.complete("std_msgs/msg/Header", {"stamp": "now"}, 12.5)["stamp"] == {"sec": 12, "nanosec": 500_000_000}
    assert notes == []


def test_ros_1_leaves_out_the_names_of_ros_2_and_says_so() -> None:
    """As rosbridge does, though without a note."""
    notes: list[str] = []
    point = {"header": {"stamp": {"sec": 3, "nanosec": 4}}}
    made = ROS1.complete("geometry_msgs/PointStamped", point, 12.5, notes)
    assert made["header"]["stamp"] == {"secs": 12, "nsecs": 500_000_000}
    for given in ({"sec": 3}, 5):
        assert ROS1.complete("std_msgs/Time", {"data": given}, 12.5, notes)["data"] == {"secs": 0, "nsecs": 0}
    assert notes == [
        "header.stamp has no secs and nsecs, as times of ROS 1 have: it is the time of the bridge",
        *["data has no secs and nsecs, as times of ROS 1 have: it is zero"] * 2,
    ]


def test_arrays_become_typed_and_bytes_come_as_base64_or_numbers() -> None:
    scan = ROS1.complete("sensor_msgs/LaserScan", {"ranges": [1, 2.5, math.nan]}, 0.0)
    assert scan["ranges"].dtype == np.float32
    for data in ("AP8=", [0, 255]):
        assert ROS1.complete("std_msgs/UInt8MultiArray", {"data": data}, 0.0)["data"] == b"\x00\xff"
    names = ROS1.complete("sensor_msgs/JointState", {"name": ["a", "b"]}, 0.0)
    assert names["name"] == ["a", "b"]


def test_empty_messages_and_unknown_types_pass() -> None:
    assert ROS1.complete("std_msgs/Empty", {}, 0.0) == {}
    assert ROS2.complete("std_msgs/msg/Empty", {}, 0.0) == {}
    assert ROS1.complete("my_msgs/Strange", {"anything": [None]}, 0.0) == {"anything": [None]}


@pytest.mark.parametrize(
    ("type", "message", "why"),
    [
        ("geometry_msgs/Twist", {"linear": {"x": None}}, "a float64 for field linear.x, but got a <class 'NoneType'>"),
        ("geometry_msgs/Twist", {"linear": {"x": "1"}}, "a float64 for field linear.x, but got a <class 'str'>"),
        ("geometry_msgs/Twist", {"linear": {"x": True}}, "a float64 for field linear.x, but got a <class 'bool'>"),
        ("geometry_msgs/Twist", {"linear": {"x": 10**400}}, "int too large to convert to float"),
        ("geometry_msgs/Twist", {"speed": 1}, "does not have a field speed"),
        ("geometry_msgs/Twist", {"linear": None}, "requires a geometry_msgs/Vector3 for field linear"),
        ("std_msgs/Bool", {"data": 1}, "a bool for field data"),
        ("std_msgs/String", {"data": 1}, "a string for field data"),
        ("std_msgs/Int8", {"data": 128}, "data does not fit into int8"),
        ("std_msgs/Int8", {"data": 1.0}, "a int8 for field data"),
        ("std_msgs/UInt64", {"data": -1}, "data does not fit into uint64"),
        ("std_msgs/UInt8MultiArray", {"data": [256]}, "0 <= number <= 255"),
        ("std_msgs/UInt8MultiArray", {"data": "abc"}, "padding"),
        ("sensor_msgs/NavSatFix", {"position_covariance": [0.0] * 8}, "9 values, not 8"),
        ("sensor_msgs/LaserScan", {"ranges": 5}, r"a float32\[\] for field ranges"),
        ("diagnostic_msgs/DiagnosticArray", {"status": [{"level": "x"}]}, "a byte for field status.level"),
    ],
)
def test_what_does_not_fit_is_named(type: str, message: dict[str, Any], why: str) -> None:
    with pytest.raises(Unfit, match=why):
        ROS1.complete(type, message, 0.0)


def test_a_definition_of_the_topic_s_own_counts() -> None:
    types = MessageTypes(1)
    types.learn(
        "tank_msgs/Fuel", "float64 volume\ntank_msgs/Cap cap\n" + "=" * 80 + "\nMSG: tank_msgs/Cap\nbool open\n"
    )
    assert types.complete("tank_msgs/Fuel", {"volume": 3}, 0.0) == {"volume": 3.0, "cap": {"open": False}}
    with pytest.raises(Unfit, match="does not have a field colour"):
        types.complete("tank_msgs/Fuel", {"colour": 3}, 0.0)


@pytest.mark.parametrize("definition", ["this is no definition", "tank_msgs/Fuel again\n", "\0"])
def test_a_bad_definition_does_no_harm(definition: str) -> None:
    types = MessageTypes(1)
    types.learn("tank_msgs/Fuel", definition)
    types.complete("tank_msgs/Fuel", {}, 0.0)


@pytest.mark.parametrize(
    ("at_s", "expected"), [(1464818234.25, (1464818234, 250_000_000)), (1.9999999999, (2, 0)), (0.0, (0, 0))]
)
def test_stamps_are_exact_and_carry(at_s: float, expected: tuple[int, int]) -> None:
    assert stamp(at_s, 1) == {"secs": expected[0], "nsecs": expected[1]}
    assert stamp(at_s, 2) == {"sec": expected[0], "nanosec": expected[1]}


def test_a_type_that_holds_itself_ends() -> None:
    definitions = dict(get_types_from_msg("Tree left\nTree right\nint8 leaf", "yard_msgs/msg/Tree"))
    tree = Completion("yard_msgs/msg/Tree", definitions, 2, 1.0)
    empty = {"left": {}, "right": {}, "leaf": 0}
    assert tree.message({"leaf": 1}) == {"left": empty, "right": empty, "leaf": 1}

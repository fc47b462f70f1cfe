"""Names as rosbridge takes them."""

from __future__ import annotations

import pytest

from server.judge.ros_names import BadName, canonical_name, canonical_type


@pytest.mark.parametrize(
    ("name", "full"), [("/chatter", "/chatter"), ("chatter", "/chatter"), ("/a/b_1/", "/a/b_1"), ("~x", "/~x")]
)
def test_a_topic_has_one_full_name(name: str, full: str) -> None:
    assert canonical_name(name) == full


@pytest.mark.parametrize("name", ["", "/", "a b", "tab\there", "x" * 300, "null\0"])
def test_what_no_graph_holds_is_refused(name: str) -> None:
    with pytest.raises(BadName, match="not a valid name"):
        canonical_name(name)


def test_ros_1_takes_only_its_own_spelling_of_types() -> None:
    assert canonical_type("geometry_msgs/Twist", 1) == "geometry_msgs/Twist"
    with pytest.raises(BadName, match="'geometry_msgs/msg/Twist' is not a valid type string in ROS 1"):
        canonical_type("geometry_msgs/msg/Twist", 1)


def test_ros_2_takes_both_spellings_of_types() -> None:
    assert canonical_type("geometry_msgs/Twist", 2) == "geometry_msgs/msg/Twist"
    assert canonical_type("geometry_msgs/msg/Twist", 2) == "geometry_msgs/msg/Twist"
    assert canonical_type("rosapi_msgs/Topics", 2, "srv") == "rosapi_msgs/srv/Topics"


@pytest.mark.parametrize("name", ["", "Twist", "a/b/c/d", "geometry_msgs/", "geo metry/Twist", "a/" + "b" * 300])
@pytest.mark.parametrize("version", [1, 2])
def test_what_is_no_type_is_refused(name: str, version: int) -> None:
    with pytest.raises(BadName, match="valid type string"):
        canonical_type(name, version)  # type: ignore[arg-type]

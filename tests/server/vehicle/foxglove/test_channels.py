"""What is offered, the answers that a session is given from it, and what is subscribed to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import orjson
import pytest

from server.rosbridge.live_source import CallFailed
from server.vehicle import discovery
from server.vehicle.foxglove import server_state
from server.vehicle.foxglove.protocol import Channel, GraphUpdate
from server.vehicle.foxglove.server_state import UNKNOWN_NODE, Offered, Subscribed

ODOM = Channel(id=1, topic="/odom", encoding="cdr", type="nav_msgs/msg/Odometry", schema="…", schema_encoding="ros2msg")
TEXT = Channel(
    id=2, topic="/a", encoding="ros1", type="std_msgs/String", schema="string data\n", schema_encoding="ros1msg"
)


def offered(*channels: Channel) -> Offered:
    found = Offered()
    found.advertised(channels)
    return found


def test_topics_are_answered() -> None:
    found = offered(ODOM, TEXT)
    assert found.answer("/rosapi/topics", {}) == {"topics": ["/odom", "/a"], "types": [ODOM.type, TEXT.type]}
    assert found.answer("/rosapi/topic_type", {"topic": "/a"}) == {"type": "std_msgs/String"}
    assert found.answer("/rosapi/topics_and_raw_types", {})["typedefs_full_text"] == ["…", "string data\n"]
    with pytest.raises(CallFailed):
        found.answer("/rosapi/topic_type", {"topic": "/b"})
    with pytest.raises(CallFailed):
        found.answer("/rosapi/message_details", {"type": "std_msgs/String"})


@pytest.mark.parametrize(
    "other",
    [
        {"schema_encoding": "ros2idl"},
        {"schema": "", "schema_encoding": ""},
        {"schema": "", "type": "my_msgs/msg/Level"},
        {"schema": "", "type": "std_msgs/msg/Empty"},
    ],
)
async def test_what_is_no_ros_text_is_no_definition(other: dict[str, str]) -> None:
    """The recorder would take it for one: a type without fields."""
    found = offered(replace(ODOM, **other))  # type: ignore[arg-type]

    class Source:
        async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
            return found.answer(service, arguments or {})

    texts = found.answer("/rosapi/topics_and_raw_types", {})["typedefs_full_text"]
    assert texts[0].startswith(discovery._FAILED)
    assert await discovery.fetch_definitions(Source(), {one.type for one in found.channels.values()}, 2) == {}


def test_publishers_without_a_graph_are_unknown_nodes() -> None:
    found = offered(ODOM)
    assert found.answer("/rosapi/publishers", {"topic": "/odom"}) == {"publishers": [UNKNOWN_NODE]}
    assert found.answer("/rosapi/publishers", {"topic": "/none"}) == {"publishers": []}
    with pytest.raises(CallFailed):
        found.answer("/rosapi/subscribers", {"topic": "/odom"})


def test_a_command_topic_that_only_we_made_has_no_known_publisher() -> None:
    """A bridge offers us what we publish ourselves, and another publisher of it would look the same."""
    found = offered(ODOM)
    for topic in ("/odom", "/cmd"):
        found.announced(topic)
    found.advertised([replace(ODOM, id=5, topic="/cmd", type="geometry_msgs/msg/Twist")])
    with pytest.raises(CallFailed):
        found.answer("/rosapi/publishers", {"topic": "/cmd"})
    assert found.answer("/rosapi/publishers", {"topic": "/odom"}) == {"publishers": [UNKNOWN_NODE]}  # it was before us
    found.withdrawn("/cmd")
    assert found.answer("/rosapi/publishers", {"topic": "/cmd"}) == {"publishers": [UNKNOWN_NODE]}


def test_a_table_that_is_full_takes_changes_and_shows_that_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_state, "MAX_OFFERED", 2)
    found = offered(ODOM, TEXT)
    assert not found.is_full
    newer = replace(ODOM, type="nav_msgs/Odometry", encoding="ros1")
    assert found.advertised([newer, ODOM, newer]) == [newer, ODOM, newer]
    assert found.of("/odom") == [newer]
    assert not found.is_full
    assert found.advertised([replace(TEXT, id=3, topic="/b")]) == []
    assert found.is_full


def test_nodes_are_those_of_the_graph() -> None:
    found = offered(ODOM)
    found.has_graph = True
    found.graph(GraphUpdate({"/odom": ("/ekf",), "/x": ("/n",)}, {"/odom": ("/plan",)}, ()))
    assert found.answer("/rosapi/publishers", {"topic": "/odom"}) == {"publishers": ["/ekf"]}
    assert found.answer("/rosapi/subscribers", {"topic": "/odom"}) == {"subscribers": ["/plan"]}
    found.graph(GraphUpdate({}, {}, ("/odom", "/x")))
    assert found.answer("/rosapi/publishers", {"topic": "/x"}) == {"publishers": []}
    assert found.answer("/rosapi/subscribers", {"topic": "/odom"}) == {"subscribers": []}


async def test_the_bridge_s_own_node_is_no_competing_publisher() -> None:
    class Graph:
        async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
            return {"publishers": ["/foxglove_bridge", "/teleop"]}

    assert await discovery.fetch_publishers(Graph(), "/cmd") == ("/teleop",)
    assert await discovery.fetch_publishers(Graph(), "/cmd", and_bridge=True) == ("/foxglove_bridge", "/teleop")


def test_the_type_of_a_topic_is_that_of_its_newest_channel() -> None:
    found = offered(ODOM, TEXT)
    newer = replace(ODOM, id=3, type="nav_msgs/Odometry", encoding="ros1")
    assert found.advertised([newer, TEXT]) == [newer]
    assert found.type_of("/odom") == "nav_msgs/Odometry"
    assert found.of("/odom") == [newer]
    assert found.unadvertised([3, 3, 9]) == [newer]
    assert found.of("/odom") == [ODOM]
    assert found.advertised([replace(TEXT, id=1)]) == [replace(TEXT, id=1)]  # another channel under a known number
    assert found.of("/odom") == []


def test_each_channel_is_subscribed_to_once_and_under_a_number_of_its_own() -> None:
    frames: list[dict[str, Any]] = []
    sent: list[tuple[str, int]] = []
    rows = Subscribed(lambda frame: frames.append(orjson.loads(frame)), lambda *row: sent.append(row))
    rows.begin("/odom", [ODOM])
    rows.begin("/odom", [ODOM])
    rows.begin("/a", [TEXT])
    assert sent == [("/odom", 1), ("/a", 2)]
    assert [frame["subscriptions"] for frame in frames] == [[{"id": 1, "channelId": 1}], [{"id": 2, "channelId": 2}]]
    assert rows.end("/odom") == [1]
    assert rows.end("/odom") == []
    assert frames[2:] == [{"op": "unsubscribe", "subscriptionIds": [1]}]
    assert rows.gone(TEXT) == [2]
    rows.begin("/a", [replace(TEXT, id=7)])
    assert rows.channels == {3: replace(TEXT, id=7)}


def test_channels_of_another_type_end_with_the_first_of_a_new_one() -> None:
    frames: list[dict[str, Any]] = []
    rows = Subscribed(lambda frame: frames.append(orjson.loads(frame)), lambda *row: None)
    rows.begin("/a", [TEXT])
    rows.begin("/odom", [ODOM, replace(ODOM, id=4)])
    newer = replace(ODOM, id=3, type="nav_msgs/Odometry", encoding="ros1")
    assert rows.begin("/odom", []) == [2, 3]  # the new one cannot be read yet
    assert rows.begin("/odom", [newer]) == []
    assert frames[2:] == [
        {"op": "unsubscribe", "subscriptionIds": [2, 3]},
        {"op": "subscribe", "subscriptions": [{"id": 4, "channelId": 3}]},
    ]
    assert rows.channels == {1: TEXT, 4: newer}

"""A bridge without rosapi: each signal has one topic, chosen from those with messages, or by the operator."""

from __future__ import annotations

from typing import Any

import pytest

from server.judge.shapes import FIELDS, type_of
from server.judge.signals import TOPICS
from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import twist
from tests.server.vehicle.test_compared_cars import fix
from tests.server.vehicle.test_sources import car, odometry, of_laser
from tests.server.viewer import viewer

ODOM, TWIST, SCAN, FIX = "nav_msgs/Odometry", "geometry_msgs/Twist", "sensor_msgs/LaserScan", "sensor_msgs/NavSatFix"
ROSAPI, MODE = "/rosapi", "/catvehicle/control_mode"


def shown(state: dict[str, Any]) -> dict[str, str]:
    return {name: one["topic"] for name, one in state["signals"].items() if one["topic"] is not None}


class Without:
    """Ends rosapi with the first messages of a car."""

    def __init__(self, publish: Any) -> None:
        self._publish = publish

    def __call__(self, bridge: RosBridge, at_s: float) -> None:
        bridge.end_node(ROSAPI)
        self._publish(bridge, at_s)


@pytest.mark.virtual_time
async def test_two_lasers_do_not_mix_and_are_a_question() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/odom", odometry(2.0 * at_s, 2.0))
        bridge.publish("/scan", of_laser("rear", 20.0))
        bridge.publish("/front/scan", of_laser("front", 3.0))

    topics = {"/odom": ODOM, "/scan": SCAN, "/front/scan": SCAN}
    async with car(topics, Without(publish)) as (_, base), viewer(base) as one, http_client() as http:
        state = await one.state(lambda s: bool(s["questions"]))
        assert [one["words"] for one in state["questions"]] == ["Two lasers: which one faces forward?"]
        assert {option["value"] for option in state["questions"][0]["options"]} == {"/scan", "/front/scan"}
        assert (state["signals"]["scan"]["topic"], state["signals"]["scan"]["value"]) == (None, None)
        assert (await http.get(f"{base}/api/checks/obstacle")).json()["verdict"] == "unknown"
        offers = (await http.get(f"{base}/api/signals")).json()["candidates"]["scan"]
        assert {offer["topic"]: offer["frame"] for offer in offers} == {"/scan": "rear", "/front/scan": "front"}
        await one.ask(kind="set", topics={"scan": "/front/scan"})
        state = await one.state(lambda s: any(alarm["id"] == "obstacle" for alarm in s["alarms"]))
        assert state["questions"] == []
        for _ in range(20):
            state = await one.state(lambda s: True)
            assert state["signals"]["scan"]["frame"] == "front"
            assert any(alarm["id"] == "obstacle" for alarm in state["alarms"])


@pytest.mark.virtual_time
async def test_a_speed_and_a_position_come_from_one_topic_each() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/vel", twist(0.0))
        bridge.publish("/odom", odometry(4.0 * at_s, 4.0))
        bridge.publish("/speed", {"data": 4.0})
        bridge.publish("/fix", fix(4.0 * at_s, at_s))
        bridge.publish("/gps/fix", fix(4.0 * at_s + 1.0, at_s))

    topics = {"/vel": TWIST, "/odom": ODOM, "/speed": "std_msgs/Float64", "/fix": FIX, "/gps/fix": FIX}
    async with car(topics, Without(publish)) as (_, base), viewer(base) as one:
        state = await one.state(lambda s: s["signals"]["speed"]["topic"] == "/speed")
        assert state["signals"]["speed"]["note"] is not None
        state = await one.state(lambda s: s["signals"]["speed"]["value"]["speed_mps"] == 4.0)
        assert shown(state) == {"speed": "/speed", "odometry": "/odom", "position": "/fix"}
        assert state["signals"]["position"]["note"] == "subscribed by name: the bridge has no rosapi"


@pytest.mark.virtual_time
async def test_what_comes_later_is_a_candidate_and_swaps_nothing() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/odom", odometry(0.0, 0.0))
        bridge.publish("/front/scan", of_laser("front", 3.0))
        if at_s > 8.0:
            bridge.publish("/scan", of_laser("rear", 20.0))

    topics = {"/odom": ODOM, "/scan": SCAN, "/front/scan": SCAN}
    async with car(topics, Without(publish)) as (_, base), viewer(base) as one, http_client() as http:
        state = await one.state(lambda s: s["signals"]["scan"]["freshness"] == "fresh")
        assert state["signals"]["scan"]["topic"] == "/front/scan"

        async def offered() -> int:
            return len((await http.get(f"{base}/api/signals")).json()["candidates"]["scan"])

        while await offered() < 2:
            await one.state(lambda s: True)
        state = await one.state(lambda s: True)
        assert state["signals"]["scan"]["topic"] == "/front/scan"


@pytest.mark.virtual_time
async def test_what_came_once_before_the_topics_are_chosen_is_not_lost() -> None:
    """A mode of operation that its publisher sent once: the bridge gives it to each subscription."""

    def publish(bridge: RosBridge, at_s: float) -> None:
        if at_s < 0.01:
            bridge.end_node(ROSAPI)
            bridge.advertise(MODE, "std_msgs/String", latch=True)
            bridge.publish(MODE, {"data": "auto"})
        bridge.publish("/vel", twist(3.0))

    async with car({"/vel": TWIST, MODE: "std_msgs/String"}, publish) as (_, base), viewer(base) as one:
        state = await one.state(lambda s: s["signals"]["speed"]["value"] is not None)
        if state["signals"]["mode"]["value"] is None:
            state = await one.state(lambda s: s["signals"]["mode"]["value"] is not None, within_s=5.0)
        assert state["signals"]["mode"]["topic"] == MODE


@pytest.mark.virtual_time
async def test_a_pick_is_used_at_once_and_the_names_are_used_again_without_it() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/vel", twist(3.0))
        bridge.publish("/my/vel", twist(5.0))
        bridge.publish("/fix", fix(5.0 * at_s, at_s))

    topics = {"/vel": TWIST, "/my/vel": TWIST, "/fix": FIX}
    async with car(topics, Without(publish)) as (_, base), viewer(base) as one:
        await one.state(lambda s: s["signals"]["speed"]["topic"] == "/vel")
        assert (await one.ask(kind="set", topics={"speed": "/my/vel"}))["ok"]
        state = await one.state(lambda s: (s["signals"]["speed"]["value"] or {}).get("speed_mps") == 5.0, within_s=1.0)
        assert shown(state) == {"speed": "/my/vel", "position": "/fix"}
        assert (await one.ask(kind="set", topics={"speed": None}))["ok"]
        await one.state(lambda s: (s["signals"]["speed"]["value"] or {}).get("speed_mps") == 3.0, within_s=1.0)


MESSAGES: list[tuple[str, Any, str]] = [
    ("/vel", twist(1.0), TWIST),
    ("/vel", {"header": {}, "twist": twist(1.0)}, "geometry_msgs/TwistStamped"),
    ("/vel", odometry(0.0, 1.0), ODOM),
    ("/vehicle/speed", {"data": 3.0}, "std_msgs/Float32"),
    ("/vehicle/speed", {"data": None}, "std_msgs/Float32"),
    ("/scan", of_laser("front", 3.0), SCAN),
    ("/fix", fix(0.0, 1.0), FIX),
    ("/battery_state", {"header": {}, "percentage": 0.5, "voltage": 12.0}, "sensor_msgs/BatteryState"),
    ("/catvehicle/control_mode", {"data": True}, "std_msgs/Bool"),
    ("/catvehicle/control_mode", {"data": "auto"}, "std_msgs/String"),
    ("/catvehicle/control_mode", {"data": 1}, "std_msgs/UInt8"),
    ("/vel", {"data": "fast"}, TWIST),  # of none: of the usual type, by which it is refused with the reason
    ("/vel", None, TWIST),
    ("/unknown", {"data": 1}, ""),
]


@pytest.mark.parametrize(("topic", "message", "kind"), MESSAGES)
def test_the_fields_show_the_type(topic: str, message: Any, kind: str) -> None:
    assert type_of(message, topic) == kind


def test_a_topic_that_was_picked_has_a_type_of_its_signal() -> None:
    assert type_of({"data": 3.0}, "/wheels", "speed") == "std_msgs/Float32"


def test_every_type_of_a_signal_has_fields() -> None:
    plain = {"std_msgs/Float32", "std_msgs/Float64", "std_msgs/UInt8", "std_msgs/Bool", "std_msgs/String"}
    older = {"autoware_auto_vehicle_msgs/ControlModeReport"}
    assert {kind for row in TOPICS for kind in row.types} == set(FIELDS) | plain | older

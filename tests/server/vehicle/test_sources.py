"""Topics that compete for a signal on a live car: compared, put as a question, and not swapped without an answer."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.cars import ZERO, scan, twist
from tests.server.conftest import serving
from tests.server.viewer import viewer

FRONT, REAR = "/front_lidar/scan", "/rear_lidar/scan"
ODOM, STAMPED, TF = "nav_msgs/Odometry", "geometry_msgs/TwistStamped", "tf2_msgs/TFMessage"
Publish = Callable[[RosBridge, float], None]


@contextlib.asynccontextmanager
async def car(
    topics: dict[str, str], publish: Publish, hz: float = 20.0, data: Path | None = None
) -> AsyncIterator[tuple[RosBridge, str]]:
    """A car that publishes on these topics and a server that watches it and records into `data`."""
    bridge = RosBridge(ros_version=1, now=time.time)
    port = await bridge.start("127.0.0.1", 0)
    for topic, kind in topics.items():
        bridge.advertise(topic, kind)

    async def drive() -> None:
        began_s = time.monotonic()
        while True:
            publish(bridge, time.monotonic() - began_s)
            await asyncio.sleep(1 / hz)

    task = asyncio.create_task(drive())
    try:
        async with serving(
            Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=data)
        ) as base:
            yield bridge, base
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        await bridge.stop()


def odometry(way_m: float, mps: float) -> dict[str, Any]:
    pose = {"position": {"x": way_m, "y": 0.0, "z": 0.0}, "orientation": {**ZERO, "w": 1.0}}
    return {
        "header": {"seq": 1, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": "odom"},
        "child_frame_id": "base_link",
        "pose": {"pose": pose, "covariance": [0.0] * 36},
        "twist": {"twist": twist(mps), "covariance": [0.0] * 36},
    }


def of_laser(frame: str, range_m: float) -> dict[str, Any]:
    found = scan(np.full(181, range_m))
    return found | {"header": found["header"] | {"frame_id": frame}}


def two_lasers(bridge: RosBridge, at_s: float) -> None:
    bridge.publish("/odom", odometry(2.0 * at_s, 2.0))
    bridge.publish(FRONT, of_laser("front", 3.0))
    bridge.publish(REAR, of_laser("rear", 20.0))


@pytest.mark.virtual_time
async def test_two_lasers_are_a_question_and_the_answer_makes_the_obstacle_alarm() -> None:
    topics = {"/odom": ODOM, FRONT: "sensor_msgs/LaserScan", REAR: "sensor_msgs/LaserScan"}
    async with car(topics, two_lasers) as (_, base), viewer(base) as one, http_client() as http:
        state = await one.state(lambda s: bool(s["questions"]))
        (question,) = state["questions"]
        assert question["words"] == "Two lasers: which one faces forward?"
        assert [option["value"] for option in question["options"]] == [FRONT, REAR]
        laser = state["signals"]["scan"]
        assert (laser["topic"], laser["value"], laser["note"]) == (None, None, "two lasers, none chosen")
        found = (await http.get(f"{base}/api/checks/obstacle")).json()
        assert (found["verdict"], found["text"]) == ("unknown", "Laser: two lasers, none chosen")
        assert not any(alarm["id"] in ("obstacle", "no_message") for alarm in state["alarms"])
        offers = (await http.get(f"{base}/api/signals")).json()["candidates"]["scan"]
        assert {offer["topic"]: offer["frame"] for offer in offers} == {FRONT: "front", REAR: "rear"}
        assert [len(offer["ranges_m"]) for offer in offers] == [72, 72]
        assert {offer["topic"]: offer["ranges_m"][36] for offer in offers} == {FRONT: 3.0, REAR: 20.0}

        await one.ask(kind="set", topics={"scan": FRONT})
        state = await one.state(lambda s: any(alarm["id"] == "obstacle" for alarm in s["alarms"]))
        assert state["questions"] == []
        laser = state["signals"]["scan"]
        assert (laser["topic"], laser["why"], laser["frame"]) == (FRONT, "chosen by the operator", "front")


def static_tf(frame: str, yaw_rad: float) -> dict[str, Any]:
    rotation = {"x": 0.0, "y": 0.0, "z": math.sin(yaw_rad / 2), "w": math.cos(yaw_rad / 2)}
    header = {"seq": 0, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": "base_link"}
    transform = {"translation": dict(ZERO), "rotation": rotation}
    return {"header": header, "child_frame_id": frame, "transform": transform}


@pytest.mark.virtual_time
@pytest.mark.parametrize(("front_rad", "ahead"), [(0.0, FRONT), (math.pi, REAR)])
async def test_the_laser_that_looks_ahead_by_the_transforms_is_taken(front_rad: float, ahead: str) -> None:
    tf = {"transforms": [static_tf("front", front_rad), static_tf("rear", front_rad + math.pi)]}
    topics = {"/odom": ODOM, FRONT: "sensor_msgs/LaserScan", REAR: "sensor_msgs/LaserScan", "/tf_static": TF}

    def publish(bridge: RosBridge, at_s: float) -> None:
        two_lasers(bridge, at_s)
        bridge.publish("/tf_static", tf)

    async with car(topics, publish) as (_, base), viewer(base) as one:
        state = await one.state(lambda s: s["signals"]["scan"]["freshness"] == "fresh")
        assert (state["signals"]["scan"]["topic"], state["signals"]["scan"]["why"]) == (ahead, "faces forward by TF")
        assert state["questions"] == []


@pytest.mark.virtual_time
async def test_an_odometry_that_moves_without_a_twist_loses_its_speed() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/lio/odom", odometry(max(0.0, at_s - 4.0), 0.0))

    async with car({"/lio/odom": ODOM}, publish) as (_, base), viewer(base) as one, http_client() as http:
        state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        assert state["signals"]["speed"]["topic"] == "/lio/odom"
        state = await one.state(
            lambda s: s["signals"]["speed"]["topic"] is None and s["session"]["phase"] == "monitoring"
        )
        assert state["signals"]["speed"]["note"] == "/lio/odom has no speed: its twist is zero while its pose moves"
        assert state["questions"] == []
        assert (state["signals"]["speed"]["value"], state["signals"]["speed"]["freshness"]) == (None, "not_published")
        found = (await http.get(f"{base}/api/checks/speed_limit")).json()
        assert (found["verdict"], found["text"]) == (
            "unknown",
            "Speed: /lio/odom has no speed: its twist is zero while its pose moves",
        )


@pytest.mark.virtual_time
async def test_a_velocity_in_east_and_north_gives_way_to_the_wheels() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/odom", odometry(5.0 * at_s, 5.0))
        header = {"seq": 1, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": "gps"}
        bridge.publish("/vel", {"header": header, "twist": twist(-5.0)})

    async with car({"/odom": ODOM, "/vel": STAMPED}, publish) as (_, base), viewer(base) as one:
        values = []

        def is_by_the_wheels(state: dict[str, Any]) -> bool:
            speed = state["signals"]["speed"]
            if speed["value"]:
                values.append(speed["value"]["speed_mps"])
            return speed["topic"] == "/odom" and len(values) > 5

        state = await one.state(is_by_the_wheels)
        assert state["signals"]["speed"]["why"] == "the only speed along the car"
        assert set(values) == {5.0}


@pytest.mark.virtual_time
async def test_two_cars_on_one_bridge_are_not_mixed() -> None:
    topics = {"/agv1/odom": ODOM, "/agv2/odom": ODOM, "/agv2/scan": "sensor_msgs/LaserScan"}

    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/agv1/odom", odometry(0.0, 0.0))
        bridge.publish("/agv2/odom", odometry(at_s, 1.0))
        bridge.publish("/agv2/scan", of_laser("laser", 9.0))

    async with car(topics, publish) as (_, base), viewer(base) as one:
        state = await one.state(lambda s: bool(s["questions"]))
        assert [question["words"] for question in state["questions"]] == ["Two cars: /agv1 and /agv2: which is this?"]
        assert {signal["topic"] for signal in state["signals"].values()} == {None}
        await one.ask(kind="set", topics={"speed": "/agv1/odom"})
        state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        assert state["signals"]["scan"]["topic"] is None
        assert state["questions"] == []


@pytest.mark.virtual_time
async def test_a_source_that_dies_is_not_swapped_for_another_that_lives() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        if at_s < 4.0:
            bridge.publish("/odom", odometry(2.0 * at_s, 2.0))
        bridge.publish("/visual/odom", odometry(2.0 * at_s, 2.0))
        bridge.publish("/scan", of_laser("laser", 20.0))  # the car is not silent

    topics = {"/odom": ODOM, "/visual/odom": ODOM, "/scan": "sensor_msgs/LaserScan"}
    async with car(topics, publish) as (_, base), viewer(base) as one:
        state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        assert state["signals"]["speed"]["topic"] == "/odom"
        state = await one.state(lambda s: any(alarm["id"] == "signal_stale.speed" for alarm in s["alarms"]))
        assert state["signals"]["speed"]["topic"] == "/odom"
        assert state["signals"]["speed"]["freshness"] != "fresh"


@pytest.mark.virtual_time
async def test_a_topic_of_which_messages_come_keeps_its_type_beside_a_node_with_another() -> None:
    """rosapi names one type of a topic, which may be that of the other node."""

    def publish(bridge: RosBridge, at_s: float) -> None:
        if at_s < 30.0:
            bridge.publish("/vel", twist(2.0))
            return
        bridge.advertise("/vel", STAMPED)  # the car's node is another version from now on
        header = {"seq": 1, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": "base_link"}
        bridge.publish("/vel", {"header": header, "twist": twist(3.0)})

    async with car({"/vel": "geometry_msgs/Twist"}, publish) as (bridge, base), viewer(base) as one:
        await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        bridge.add_service("/rosapi/topics", "rosapi/Topics", lambda _: {"topics": ["/vel"], "types": [STAMPED]})
        await asyncio.sleep(12.0)
        state = await one.state(lambda s: True)
        assert (state["signals"]["speed"]["type"], state["signals"]["speed"]["freshness"]) == (
            "geometry_msgs/Twist",
            "fresh",
        )
        await one.state(lambda s: (s["signals"]["speed"]["value"] or {}).get("speed_mps") == 3.0, within_s=60.0)

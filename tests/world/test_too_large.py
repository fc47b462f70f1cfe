"""A topic with messages that are too large to be read: found out, left after the second one, named."""

from __future__ import annotations

import asyncio
from pathlib import Path

import cbor2
import orjson
import pytest

from server.app.config import Config
from server.rosbridge.raw_frame import ENDS_BYTES, topic_of
from server.rosbridge.websocket import MAX_MESSAGE_BYTES
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.rosbridge_server.conftest import bridging
from tests.server.viewer import viewer

pytestmark = pytest.mark.world(n=10)
BIG = "x" * 5000


@pytest.mark.parametrize(
    ("frame", "is_binary", "topic"),
    [
        (orjson.dumps({"op": "publish", "topic": "/camera", "msg": {"data": BIG}}), False, "/camera"),
        (b'{"op": "publish", "topic": "\\/camera\\/left", "msg": {"topic": "/no", "d": "'
         + BIG.encode(), False, "/camera/left"),
        (orjson.dumps({"msg": {"topic": "/no", "data": BIG}, "op": "publish", "topic": "/camera"}), False, "/camera"),
        (orjson.dumps({"op": "publish", "msg": {"topic": "/no", "data": BIG}}), False, None),
        (cbor2.dumps({"op": "publish", "topic": "/camera", "msg": {"data": BIG.encode()}}), True, "/camera"),
        (cbor2.dumps({"op": "publish", "topic": f"/{'n' * 300}", "msg": BIG}), True, f"/{'n' * 300}"),
        (cbor2.dumps({"msg": BIG, "op": "publish", "topic": "/camera"}), True, "/camera"),
        (cbor2.dumps({"op": "publish", "topic": 7, "msg": BIG}), True, None),
        (BIG.encode(), False, None),
        (BIG.encode(), True, None),
        (b'{"op":"publish","topic":"/cut', False, None),
        (b"\xa3\x65topic\x7a\xff", True, None),
    ],
)  # fmt: skip
def test_the_topic_stands_at_one_of_its_ends(frame: bytes, is_binary: bool, topic: str | None) -> None:
    assert topic_of(frame[:ENDS_BYTES], frame[-ENDS_BYTES:], is_binary=is_binary) == topic


@pytest.mark.virtual_time
async def test_the_second_such_message_ends_its_subscription_and_names_the_topic(tmp_path: Path) -> None:
    picture = {"format": "jpeg", "data": b"\0" * MAX_MESSAGE_BYTES}

    async def shoot(bridge: RosBridge) -> None:
        while True:
            bridge.publish("/camera", picture)
            await asyncio.sleep(1.0)

    async with bridging() as (bridge, port):
        bridge.advertise("/catvehicle/vel", "geometry_msgs/Twist")
        bridge.advertise("/camera", "car_msgs/Picture")
        config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=tmp_path)
        async with serving(config) as base, driving(bridge), viewer(base) as one:
            camera = asyncio.create_task(shoot(bridge))
            try:
                state = await one.state(lambda s: bool(s["recording"]["too_large"]), within_s=30)
                assert state["recording"]["too_large"] == [{"topic": "/camera", "mb": 21.3}]
                assert "/camera" in state["recording"]["left_out"]
                text = "/camera is no longer received: its messages have 21 MB, and 16 MB is the limit."
                note = await one.until(lambda: next((e for e in one.events if e["text"] == text), None))
                assert note["change"] == "not_received"
                topic = bridge.graph.find("/camera")
                async with asyncio.timeout(10):
                    while topic is not None and topic.subscribers:
                        await asyncio.sleep(0.05)
            finally:
                camera.cancel()


@pytest.mark.virtual_time
async def test_a_bridge_of_ros_2_sends_them_in_fragments_and_it_is_the_same(tmp_path: Path) -> None:
    """As JSON it comes in pieces of 10 MB."""
    cloud = {"data": b"\0" * MAX_MESSAGE_BYTES}

    async def scan(bridge: RosBridge) -> None:
        while True:
            bridge.publish("/cloud", cloud)
            await asyncio.sleep(1.0)

    async with bridging(ros_version=2) as (bridge, port):
        bridge.advertise("/catvehicle/vel", "geometry_msgs/msg/Twist")
        bridge.advertise("/cloud", "car_msgs/msg/Cloud", f"uint8[{MAX_MESSAGE_BYTES}] data\n")  # not fit for CBOR
        config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=tmp_path)
        async with serving(config) as base, driving(bridge), viewer(base) as one:
            clouds = asyncio.create_task(scan(bridge))
            try:
                state = await one.state(lambda s: bool(s["recording"]["too_large"]), within_s=30)
                assert state["recording"]["too_large"] == [{"topic": "/cloud", "mb": 21.3}]
                topic = bridge.graph.find("/cloud")
                async with asyncio.timeout(10):
                    while topic is not None and topic.subscribers:
                        await asyncio.sleep(0.05)
            finally:
                clouds.cancel()

"""Arming makes the bridge a publisher of the topic where the car is commanded: nothing is missing there."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from server.app.config import Config
from server.vehicle import delivery
from server.vehicle.vehicle import Vehicle
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import probing
from tests.server.viewer import viewer

pytestmark = [pytest.mark.world(n=9), pytest.mark.virtual_time]
COMMAND = "/catvehicle/cmd_vel"
SOON_S = 30.0


async def test_where_only_we_may_command_nothing_is_reported_as_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in (("RECORDED_AFTER_S", 1.0), ("RENEW_AFTER_S", 1.5), ("SILENT_AGAIN_S", 2.0)):
        monkeypatch.setattr(delivery, name, value)
    monkeypatch.setattr(delivery, "RECORDED_AGAIN_S", (2.0,))
    async with bridging(ros_version=1) as (bridge, port), probing(port) as listener:
        bridge.advertise("/catvehicle/vel", "geometry_msgs/Twist")
        await listener.subscribe(COMMAND, type="geometry_msgs/Twist")
        config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=tmp_path)
        async with driving(bridge, steers=True), serving(config) as base, viewer(base, name="Ann") as one:
            await one.state(lambda s: s["decelerate"]["state"] == "not_armed", SOON_S)
            reply = await one.ask(kind="arm")
            assert reply["ok"], reply
            await one.state(lambda s: s["decelerate"]["state"] == "armed", SOON_S)
            async with asyncio.timeout(SOON_S):
                while not ((topic := bridge.graph.find(COMMAND)) and topic.publishers):
                    await asyncio.sleep(0.05)
            bridge.advertise("/idle", "std_msgs/Float64")  # from here on it is as silent as the command topic
            state = await one.state(lambda s: "/idle" in s["recording"]["not_received"], SOON_S)
            armed_s = state["session"]["connected_for_s"]
            state = await one.state(lambda s: s["session"]["connected_for_s"] > armed_s + 5.0, SOON_S)
            assert state["recording"]["not_received"] == ["/idle"]
            assert state["decelerate"]["state"] == "armed"
            assert not any(COMMAND in event["text"] for event in one.events if event["change"] == "not_received")

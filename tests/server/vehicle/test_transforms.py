"""Transforms of a live car: latched or sent again and again, before and after the scans; recorded with each part."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from server.analysis.rehearse import rehearse
from server.app.config import Config
from server.recording.read.read import open_recording
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.server import scan_frames
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.judge.mounted_lasers import Laser, row
from tests.server.viewer import viewer

TF = "tf2_msgs/TFMessage"
BACKWARDS = Laser(x_m=0.5, yaw_rad=math.pi)
POST = [(3.8, 0.6, 0.3)]  # ahead, to the left


@contextlib.asynccontextmanager
async def scanning(bridge: RosBridge, laser: Laser = BACKWARDS) -> AsyncIterator[None]:
    async def scan() -> None:
        while True:
            bridge.publish("/scan", laser.scan(POST))
            await asyncio.sleep(0.1)

    task = asyncio.create_task(scan())
    try:
        async with driving(bridge):
            yield
    finally:
        task.cancel()


def tf(*rows: dict[str, Any]) -> dict[str, Any]:
    return {"transforms": list(rows)}


def is_alarmed(state: dict[str, Any]) -> bool:
    return any(one["id"] == "obstacle" and one["active"] for one in state["alarms"])


def note_of(state: dict[str, Any]) -> str:
    return state["signals"]["scan"]["note"] or ""


@pytest.mark.virtual_time
async def test_a_latched_transform_turns_the_laser(bridge: RosBridge, server: str) -> None:
    bridge.advertise("/tf_static", TF, latch=True)
    bridge.publish("/tf_static", tf(BACKWARDS.transform()))
    async with scanning(bridge), viewer(server) as one:
        await one.send({"kind": "watch", "scan": True})
        state = await one.state(is_alarmed)
        (alarm,) = (alarm for alarm in state["alarms"] if alarm["id"] == "obstacle")
        assert alarm["trip_text"].startswith("Obstacle 3.0 m ahead, 11° left")  # the nearer of two beams
        assert "by the car's transforms turned by 180°, 0.50 m ahead of base_link" in note_of(state)
        assert "gap from the laser: no bumper set" in note_of(state)
        assert state["signals"]["scan"]["value"]["mounting"] == "gap from the laser: no bumper set"
        assert alarm["trip_text"].endswith(
            "gap from the laser: no bumper set; steering unknown, checked straight ahead"
        )
        await one.until(lambda: one.scans)
        frame = scan_frames.read(one.scans[-1])
        assert frame.gap_m == pytest.approx(3.0, abs=0.05)
        bearing = frame.angle_min_rad + frame.beam * frame.angle_increment_rad
        assert math.remainder(bearing, math.tau) == pytest.approx(math.atan2(0.6, 3.3), abs=0.1)
        place = state["signals"]["scan"]["value"]
        assert (place["laser_ahead_m"], place["laser_left_m"]) == (0.5, 0.0)


@pytest.mark.virtual_time
async def test_transforms_that_come_later_count_from_then_on(bridge: RosBridge, server: str) -> None:
    """Sent again and again on /tf, among others that move, as ROS 1 does without tf2."""
    async with scanning(bridge), viewer(server) as one:
        state = await one.state(lambda s: "assumed to look ahead" in note_of(s))
        assert not is_alarmed(state)
        assert state["signals"]["scan"]["value"]["mounting"] == (
            "laser assumed to look ahead · gap from the laser: no bumper set"
        )
        bridge.advertise("/tf", TF)
        async with asyncio.timeout(60):
            while not is_alarmed(one.states[-1]):
                bridge.publish("/tf", tf(row("odom", "base_link", float(len(one.states)))))
                await asyncio.sleep(0.02)
                bridge.publish("/tf", tf(BACKWARDS.transform()))
                await asyncio.sleep(0.02)
        assert "by the car's transforms" in note_of(one.states[-1])
        # The operator's setting comes before them.
        assert (await one.ask(kind="set", values={"mounting.by_settings": 1.0}))["ok"]
        state = await one.state(lambda s: "mounted by the settings" in note_of(s))
        await one.state(lambda s: not is_alarmed(s))


@pytest.mark.virtual_time
async def test_transforms_that_contradict_each_other_are_a_sentence(bridge: RosBridge, server: str) -> None:
    bridge.advertise("/tf_static", TF, latch=True)
    async with scanning(bridge), viewer(server) as one:
        await one.state(lambda s: "assumed" in note_of(s))
        async with asyncio.timeout(60):
            while "not known" not in note_of(one.states[-1]):
                bridge.publish("/tf_static", tf(BACKWARDS.transform(), row("rear_link", "laser")))
                await asyncio.sleep(0.1)
        state = await one.state(lambda s: any("also below rear_link" in tile["text"] for tile in s["checks"]))
        assert not is_alarmed(state)


@pytest.mark.virtual_time
@pytest.mark.parametrize("all_topics", [1.0, 0.0], ids=["all topics", "only signals"])
async def test_each_recording_holds_the_transforms_that_were_sent_once(
    bridge: RosBridge, tmp_path: Path, all_topics: float
) -> None:
    bridge.advertise("/tf_static", TF, latch=True)
    bridge.publish("/tf_static", tf(BACKWARDS.transform()))
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    async with serving(config) as base, scanning(bridge), viewer(base) as one:
        await one.state(is_alarmed)
        assert (await one.ask(kind="set", values={"recording.all_topics": all_topics}))["ok"]
        for _ in range(2):  # a second one begins long after they were sent
            assert (await one.ask(kind="record", on=False))["ok"]
            await one.state(lambda s: s["recording"]["state"] != "recording")
            assert (await one.ask(kind="record", on=True))["ok"]
            await one.state(lambda s: s["recording"]["state"] == "recording" and s["recording"]["messages"] > 40)
        assert (await one.ask(kind="disconnect"))["ok"]
        await one.state(lambda s: s["recording"]["state"] == "off")
    made = sorted((tmp_path / "recordings").rglob("*.mcap"))
    assert len(made) == 3
    for path in made:
        with open_recording([path]) as recording:
            assert recording.topics["/tf_static"].count >= 1
            run = rehearse(recording)
            assert "obstacle" in {episode.alarm_id for episode in run.episodes}
            assert run.snapshot.need("scan").mounting.origin == "transforms"  # type: ignore[union-attr]


@pytest.mark.virtual_time
async def test_a_part_that_begins_after_an_outage_holds_them_too(bridge: RosBridge, tmp_path: Path) -> None:
    """The bridge sends again what it kept: no new sample, but this part does not have it yet."""
    bridge.advertise("/tf_static", TF, latch=True)
    bridge.publish("/tf_static", tf(BACKWARDS.transform()))
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    async with serving(config) as base, scanning(bridge), viewer(base) as one:
        assert (await one.ask(kind="set", values={"recording.hold_s": 0.0}))["ok"]
        await one.state(is_alarmed)
        await bridge.kill()
        await one.state(lambda s: s["session"]["phase"] == "lost")
        await bridge.revive()
        await one.state(lambda s: s["session"]["phase"] == "monitoring")
        await one.state(lambda s: s["recording"]["state"] == "recording" and s["recording"]["messages"] > 40)
        assert (await one.ask(kind="disconnect"))["ok"]
        await one.state(lambda s: s["recording"]["state"] == "off")
    made = sorted((tmp_path / "recordings").rglob("*.mcap"))
    assert len(made) == 2
    for path in made:
        with open_recording([path]) as recording:
            assert recording.topics["/tf_static"].count == 1


JOINTS = [[row("base_link", f"joint_{10 * group + n}") for n in range(10)] for group in range(30)]


@pytest.mark.virtual_time
@pytest.mark.parametrize("all_topics", [1.0, 0.0], ids=["all topics", "only signals"])
async def test_a_laser_that_is_placed_once_a_second_among_hundreds_of_joints_is_placed_soon(
    bridge: RosBridge, tmp_path: Path, all_topics: float
) -> None:
    bridge.advertise("/tf", TF)
    now = asyncio.get_running_loop().time

    async def joints() -> None:
        while True:
            for group in JOINTS:
                bridge.publish("/tf", tf(*group))
                await asyncio.sleep(0.005)

    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    async with serving(config) as base, scanning(bridge), viewer(base) as one:
        task = asyncio.create_task(joints())
        try:
            assert (await one.ask(kind="set", values={"recording.all_topics": all_topics}))["ok"]
            await asyncio.sleep(6.0)  # until the topics of the car are looked at again
            assert "assumed" in note_of(one.states[-1])
            for yaw_rad in (math.pi, 0.5, -0.7):  # it is placed, and then it turns
                began_s = now()
                while f"turned by {round(abs(math.degrees(yaw_rad)))}°" not in note_of(one.states[-1]):
                    assert now() - began_s <= 3.0
                    bridge.publish("/tf", tf(Laser(x_m=0.5, yaw_rad=yaw_rad).transform()))
                    await asyncio.sleep(1.0)
        finally:
            task.cancel()

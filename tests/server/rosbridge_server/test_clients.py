"""Unmodified clients of others, each in a process of its own, work against the bridge."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import math
import shutil
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.judge.message import Json, RosVersion
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import probing, until

HERE = Path(__file__).parent
PROJECT = HERE.parents[2]
SCAN = {
    "header": {"seq": 1, "stamp": {"secs": 3, "nsecs": 4}, "frame_id": "laser"},
    "angle_min": -1.5,
    "ranges": np.array([1.5, math.nan, math.inf, -math.inf], dtype=np.float32),
    "intensities": np.array([], dtype=np.float32),
}


@pytest.fixture
async def car(bridge: RosBridge) -> AsyncIterator[RosBridge]:
    """A simulated car that publishes until the test ends, and echoes the commands that it receives."""
    commands: list[tuple[str, Json]] = []
    bridge.advertise("/vel", "geometry_msgs/Twist")
    for topic in ("/scan", "/points"):
        bridge.advertise(topic, "sensor_msgs/LaserScan")
    bridge.advertise("/echo", "std_msgs/String")
    bridge.on_publish.append(lambda topic, _, message: commands.append((topic, message)))
    bridge.add_service("/add", "demo/Add", lambda args: {"sum": args["a"] + args["b"]})
    bridge.commands = commands  # type: ignore[attr-defined]

    async def drive() -> None:
        for number in itertools.count():
            bridge.publish(
                "/vel", {"linear": {"x": float(number), "y": 0.0, "z": 0.0}, "angular": {"x": 0, "y": 0, "z": 0}}
            )
            for topic in ("/scan", "/points"):
                bridge.publish(topic, SCAN)
            for topic, message in commands:
                bridge.publish("/echo", {"data": f"{topic} {message['linear']['x']}"})
            await asyncio.sleep(0.01)

    driving = asyncio.create_task(drive())
    yield bridge
    driving.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await driving


async def run(*command: str) -> dict[str, Any]:
    process = await asyncio.create_subprocess_exec(
        *command, cwd=PROJECT, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    try:
        out, err = await asyncio.wait_for(process.communicate(), 40)
    except TimeoutError:
        process.kill()
        raise
    assert process.returncode == 0, err.decode()
    return json.loads(out)


def assert_driven(found: dict[str, Any]) -> None:
    first = found["velocities"][0]
    assert found["velocities"][:20] == [first + n for n in range(20)]  # every one, in order
    assert found["scan"]["ranges"] == [1.5, None, None, None]
    assert found["scan"]["header"]["stamp"] == {"secs": 3, "nsecs": 4}
    assert found["echo"] == {"data": "/cmd_vel 1.5"}
    assert found["topics"] == ["/cmd_vel", "/echo", "/points", "/scan", "/vel"]
    assert found["type"] == "sensor_msgs/LaserScan"
    assert found["nodes"] == ["/car", "/rosapi", "/rosbridge_websocket"]
    assert found["services"] is True
    assert found["sum"] == 5


@pytest.mark.parametrize("transport", ["asyncio", "twisted"])
async def test_roslibpy(car: RosBridge, port: int, transport: str) -> None:
    found = await run(sys.executable, str(HERE / "roslibpy_client.py"), transport, str(port))
    assert_driven(found)
    assert abs(found["time"] - car.now()) < 20
    assert found["details"] == ["linear", "angular"]
    assert found["failures"] == ["Service /rosapi/not_there does not exist"]
    assert found["complaints"] == []


async def test_roslibjs(car: RosBridge, port: int) -> None:
    node = shutil.which("node")
    if node is None or not (PROJECT / "node_modules" / "roslib").is_dir():
        pytest.skip("no Node with roslib here")
    found = await run(node, str(HERE / "roslibjs_client.mjs"), str(port))
    assert_driven(found)
    assert found["points"] == [1.5, "NaN", "Infinity", "-Infinity"]
    assert found["pointsKind"] == "Float32Array"
    assert found["details"]["linear"] == {"x": "float64", "y": "float64", "z": "float64"}
    assert "does not exist" in found["failure"]
    assert found["statuses"] == ["subscribe: /vel has the type geometry_msgs/Twist, not std_msgs/Float64"]


@pytest.mark.parametrize("version", [1, 2])
async def test_roslibpy_offers_a_service_and_stamps_its_messages(version: RosVersion) -> None:
    async with bridging(ros_version=version) as (bridge, port), probing(port) as probe:
        await probe.subscribe("/point", type="geometry_msgs/PointStamped")
        command = (sys.executable, str(HERE / "roslibpy_provider.py"), str(port), str(version))
        process = await asyncio.create_subprocess_exec(*command, cwd=PROJECT, stderr=asyncio.subprocess.DEVNULL)
        try:
            stamped = (await probe.hear(40))["msg"]
            await until(lambda: bridge.services.find("/lamp") is not None)
            answer = await probe.call("/lamp", {"data": True})
        finally:
            process.kill()
            await process.wait()
        names = ("secs", "nsecs") if version == 1 else ("sec", "nanosec")
        assert stamped["header"]["stamp"] == dict(zip(names, (3, 4), strict=True))
        assert (answer["result"], answer["values"]) == (True, {"success": True, "message": "lamp"})
        await until(lambda: bridge.services.find("/lamp") is None)

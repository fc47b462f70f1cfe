"""`catgraph doctor` as a command: a car, a car with little, a dead port, something that is no rosbridge."""

from __future__ import annotations

import asyncio
import sys

import pytest

from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.server.vehicle.foxglove.peer import peer


async def doctor(address: str) -> tuple[int, str, str]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server", "doctor", address, "--seconds", "1.5"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    out, err = await asyncio.wait_for(process.communicate(), 40)
    assert process.returncode is not None
    return process.returncode, out.decode(), err.decode()


@pytest.mark.world(n=17)
async def test_a_car_is_told_signal_by_signal(bridge: RosBridge) -> None:
    bridge.advertise("/catvehicle/distanceEstimator/dist", "std_msgs/Float64")
    bridge.advertise("/chatter", "std_msgs/String")
    async with driving(bridge, scans=True):
        code, out, err = await doctor(bridge.address)  # type: ignore[attr-defined]
    assert (code, err) == (1, "")
    lines = {line.split()[0]: line for line in out.splitlines() if line.split()}
    assert "/catvehicle/vel" in lines["speed"]
    assert "Hz" in lines["speed"]
    assert "silent" in lines["distance"]
    assert "Float64, expected Float32" in out
    assert "not published" in lines["fuel"]
    assert "/chatter" in out
    assert "Missing or silent: brake" in out
    assert "Missing and optional: " in out
    assert "fuel" in out.split("Missing and optional: ")[1].splitlines()[0]
    assert "Every signal of the page" not in out
    assert "ROS 1" in out


async def test_what_cannot_be_examined_is_one_sentence_and_exit_2() -> None:
    async def http(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readline()
        writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
        writer.close()

    async with await asyncio.start_server(http, "127.0.0.1", 0) as page:
        port = page.sockets[0].getsockname()[1]
        for address, reason in (
            (f"127.0.0.1:{port}", "not a rosbridge"),
            ("127.0.0.1:1", "nothing listens"),
            ("http://127.0.0.1:11311", "ROS master"),
        ):
            code, out, err = await doctor(address)
            assert (code, out) == (2, "")
            assert reason in err
            assert len(err.splitlines()) == 1


async def test_a_car_with_a_foxglove_server_is_listed_too() -> None:
    with peer() as car:
        car.offer("/odom", "nav_msgs/msg/Odometry", "cdr")
        car.offer("/fix", "foxglove.LocationFix", "json")
        code, out, err = await doctor(car.address)
    assert (code, err) == (1, "")
    assert f"Foxglove's server on 127.0.0.1:{car.port}: answers, ROS 2" in out
    assert "ROS behind it" not in out
    assert "Foxglove's server has no login" in out
    assert "/odom" in out

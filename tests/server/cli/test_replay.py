"""catgraph replay as a person runs it."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import itertools
import json
import os
import re
import signal
import sys
import time
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import orjson
import pytest
from websockets import ConnectionClosed

from server.cli.replay import Report, add_arguments, run
from server.recording.read.read import open_recording
from server.rosbridge_server.server import RosBridge
from tests.server.recording.bags import Drive, write_ros1, write_ros2
from tests.server.recording.read.test_bag2 import split
from tests.server.rosbridge_server.probe import Probe, probing

PROJECT = Path(__file__).resolve().parents[3]
CATVEHICLE = "catvehicle_2016-06-01.bag"


class Replay:
    """A running replay."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.lines: list[str] = []

    async def port(self) -> int:
        """Reads what it prints until its address is in it."""
        assert self.process.stdout is not None
        while True:
            line = (await asyncio.wait_for(self.process.stdout.readline(), 20)).decode()
            assert line, "it ended without an address"
            self.lines.append(line)
            found = re.search(r"rosbridge at ws://\S+:(\d+)", line)
            if found:
                return int(found[1])

    async def end(self, within_s: float = 30.0) -> tuple[int, str, str]:
        """Its exit code, all it printed, and its complaints."""
        out, err = await asyncio.wait_for(self.process.communicate(), within_s)
        assert self.process.returncode is not None
        return self.process.returncode, "".join(self.lines) + out.decode(), err.decode()


@contextlib.asynccontextmanager
async def replaying(*arguments: str | Path) -> AsyncIterator[Replay]:
    command = [sys.executable, "-m", "server", "replay", *map(str, arguments)]
    process = await asyncio.create_subprocess_exec(
        *command, cwd=PROJECT, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    try:
        yield Replay(process)
    finally:
        if process.returncode is None:
            process.kill()
            await process.communicate()


async def ending(*arguments: str | Path) -> tuple[int, str, str]:
    async with replaying(*arguments) as replay:
        return await replay.end()


async def hear_all(probe: Probe) -> list[dict[str, Any]]:
    """All messages until the bridge closes the connection."""
    messages = []
    with contextlib.suppress(ConnectionClosed):
        while True:
            messages.append(await probe.hear(10))
    return messages


def as_sent(message: Any) -> Any:
    """A recorded message as JSON carries it."""
    return orjson.loads(orjson.dumps(message, option=orjson.OPT_SERIALIZE_NUMPY))


REAL_DRIVES = {CATVEHICLE: 14_228, "catvehicle_2016-06-01_mcap": 14_228, "lidar/scan_tools_hokuyo_demo.bag": 360}


@pytest.mark.field
async def test_real_drives_arrive_whole_and_equal(recordings: Path) -> None:
    async with asyncio.TaskGroup() as together:
        for file, count in REAL_DRIVES.items():
            together.create_task(replay_whole(recordings / file, count))


async def replay_whole(file: Path, count: int) -> None:
    """Plays a drive at ten times its speed to a client that takes every message and compares it with the file."""
    with open_recording([file]) as recording:
        expected = [(message.topic, as_sent(message.message)) for message in recording.messages()]
        types = {topic: info.type for topic, info in recording.topics.items()}
        log = "rosgraph_msgs/Log" if recording.ros_version == 1 else "rcl_interfaces/msg/Log"
    listed = {"/rosout": log} | types
    async with replaying(file, "--port", "0", "--rate", "10", "--wait") as replay:
        async with probing(await replay.port()) as probe:
            assert (await probe.call("/rosapi/topics"))["values"] == {
                "topics": sorted(listed),
                "types": [listed[topic] for topic in sorted(listed)],
            }
            for topic, type in types.items():
                await probe.send(op="subscribe", topic=topic, type=type, queue_length=0)
            messages = await hear_all(probe)
        code, out, err = await replay.end()
    assert (code, err) == (0, "")
    assert [(message["topic"], message["msg"]) for message in messages] == expected
    assert len(messages) == count
    shown = f"{count:,}".replace(",", " ")
    assert f"Played {shown} messages" in out
    assert f"{shown} sent to clients, 0 dropped" in out


@pytest.mark.field
async def test_spacing_is_that_of_the_drive(recordings: Path) -> None:
    with open_recording([recordings / CATVEHICLE]) as recording:
        recorded = [message.at_s for message in recording.messages(start_s=20.0)]
    async with (
        replaying(recordings / CATVEHICLE, "--port", "0", "--start", "20", "--wait") as replay,
        probing(await replay.port()) as probe,
    ):
        for topic in (
            "accelerator",
            "brake",
            "steering",
            "vel",
            "cmd_vel",
            "distanceEstimator/dist",
            "distanceEstimator/angle",
        ):
            await probe.send(op="subscribe", topic=f"/catvehicle/{topic}")
        for topic in ("/gps_fix", "/gps_odom"):
            await probe.send(op="subscribe", topic=topic)
        times = []
        for _ in range(1_000):
            await probe.hear(5)
            times.append(time.monotonic())
    late = [t - r for t, r in zip(times, recorded, strict=False)]
    off = sorted(abs(one - median(late)) for one in late)  # from the median: the first one may itself be late
    assert off[500] < 0.005
    assert off[900] < 0.05  # the machine is busy with other tests
    assert recorded[999] - recorded[0] > 3.5


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """A ROS 1 bag of half a second: /n counts to 50, /text publishes once."""
    messages = [(n * 0.01, "/n", "std_msgs/msg/Int32", {"data": n}) for n in range(50)]
    return write_ros1(
        tmp_path / "short.bag", Drive(messages=[*messages, (0.2, "/text", "std_msgs/msg/String", {"data": "hi"})])
    )


async def test_topics_can_be_renamed(drive: Path) -> None:
    async with replaying(drive, "--port", "0", "--wait", "--remap", "/n:=/count", "--remap", "text:=note") as replay:
        async with probing(await replay.port()) as probe:
            await probe.subscribe("/count")
            await probe.subscribe("/note")
            messages = await hear_all(probe)
        code, out, _ = await replay.end()
    assert code == 0
    assert {message["topic"] for message in messages} == {"/count", "/note"}
    assert len(messages) == 51
    assert "/count (was /n)" in out


async def test_it_loops_until_interrupted_without_a_trace(drive: Path) -> None:
    async with replaying(drive, "--port", "0", "--loop", "--rate", "5") as replay:
        async with probing(await replay.port()) as probe:
            await probe.send(op="subscribe", topic="/n")
            numbers = [(await probe.hear(5))["msg"]["data"] for _ in range(150)]
            replay.process.send_signal(signal.SIGINT)
            code, out, err = await replay.end()
    rounds = [i for i, number in enumerate(numbers) if number == 0]
    assert [b - a for a, b in itertools.pairwise(rounds)] == [50] * (len(rounds) - 1)
    assert len(rounds) >= 2
    assert (code, err) == (130, "")
    assert "Played" in out


async def test_a_terminated_replay_ends_as_quietly(drive: Path) -> None:
    async with replaying(drive, "--port", "0", "--wait") as replay:
        await replay.port()
        replay.process.terminate()
        code, _, err = await replay.end()
    assert (code, err) == (143, "")


async def test_without_waiting_it_plays_to_nobody_and_ends(drive: Path) -> None:
    code, out, err = await ending(drive, "--port", "0")
    assert (code, err) == (0, "")
    assert "Played 51 messages in" in out
    assert "0 sent to clients" in out


@pytest.mark.field
async def test_it_can_stay_after_the_end(drive: Path) -> None:
    async with replaying(drive, "--port", "0", "--stay", "--rate", "100") as replay:
        port = await replay.port()
        await asyncio.sleep(0.5)
        async with probing(port) as probe:
            assert (await probe.call("/rosapi/get_time"))["result"] is True
        replay.process.send_signal(signal.SIGINT)
        code, out, _ = await replay.end()
    assert code == 130
    assert "runs until interrupted" in out


@pytest.mark.field
async def test_a_latched_topic_reaches_latecomers(tmp_path: Path) -> None:
    messages = [
        (0.0, "/map", "std_msgs/msg/String", {"data": "the map"}),
        (5.0, "/end", "std_msgs/msg/String", {"data": ""}),
    ]
    file = write_ros1(tmp_path / "latched.bag", Drive(messages=messages, latched={"/map"}))
    async with replaying(file, "--port", "0") as replay, probing(await replay.port()) as probe:
        await asyncio.sleep(0.1)
        await probe.send(op="subscribe", topic="/map")
        assert (await probe.hear())["msg"] == {"data": "the map"}


async def test_a_ros_2_recording_makes_a_ros_2_bridge(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "bag", Drive(messages=[(0.0, "/n", "std_msgs/msg/Int32", {"data": 1})]))
    async with replaying(bag, "--port", "0", "--wait") as replay, probing(await replay.port()) as probe:
        assert (await probe.call("/rosapi/topic_type", {"topic": "/n"}))["values"] == {"type": "std_msgs/msg/Int32"}
        assert "sec" in (await probe.call("/rosapi/get_time"))["values"]["time"]


def write_foreign(folder: Path) -> dict[str, Sequence[str | Path]]:
    (folder / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    (folder / "notes.txt").write_text("not a bag at all\n")
    (folder / "empty.bag").write_bytes(b"")
    (folder / "archive.mcap").write_bytes(b"PK\x03\x04" + bytes(100))
    (folder / "folder").mkdir()
    return {
        "is a PNG picture": ["picture.png"],
        "is a text file": ["notes.txt"],
        "is empty: it has 0 bytes": ["empty.bag"],
        "is a ZIP archive": ["archive.mcap"],
        "is a directory without a recording in it": ["folder"],
        "does not exist": ["nowhere.bag"],
    }


def complaint(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    """What it prints, in this process, when it ends with exit code 2."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    try:
        code = run(parser.parse_args([*map(str, arguments), "--port=0"]))
    except SystemExit as exit:
        code = int(exit.code or 0)
    assert code == 2
    return capsys.readouterr().err


def test_what_is_no_recording_gets_one_sentence_and_exit_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for why, names in write_foreign(tmp_path).items():
        printed = complaint(capsys, *(tmp_path / name for name in names))
        assert re.fullmatch(rf"catgraph replay: \S+ [^\n]*{why}[^\n]*\n", printed), printed


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--rate", "0"], "must be between"),
        (["--rate", "nan"], "is not a number"),
        (["--rate", "fast"], "is not a number"),
        (["--start", "-1"], "must be 0 or more"),
        (["--start", "60"], "--start 60 is after the end: the recording has 0.5 s"),
        (["--remap", "/a"], "is not of the form A:=B"),
        (["--remap", "/nothing:=/b"], "there is no topic /nothing in the recording"),
        (["--remap", "/n:=/text"], "two topics of different types would both be /text"),
        (["--host", "203.0.113.9"], "203.0.113.9 is not an address of this machine"),
    ],
)
def test_what_makes_no_sense_is_reported_with_exit_2(
    drive: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], why: str
) -> None:
    assert why in complaint(capsys, drive, *arguments)


async def test_the_command_says_it_without_a_trace(tmp_path: Path) -> None:
    assert await ending(tmp_path / "nowhere.bag") == (
        2,
        "",
        f"catgraph replay: {tmp_path}/nowhere.bag does not exist\n",
    )


async def test_a_port_in_use_is_said(drive: Path) -> None:
    async with replaying(drive, "--port", "0", "--wait") as first:
        port = await first.port()
        code, _, err = await ending(drive, "--port", str(port))
    assert (code, err) == (2, f"catgraph replay: port {port} on 127.0.0.1 is already in use by another program\n")


async def test_damage_in_the_middle_is_said_after_what_was_good(tmp_path: Path) -> None:
    messages = [(n * 0.001, "/text", "std_msgs/msg/String", {"data": os.urandom(500).hex()}) for n in range(2_000)]
    file = write_ros1(tmp_path / "hurt.bag", Drive(messages=messages, compression="bz2", chunk_bytes=100_000))
    content = bytearray(file.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 20_000] = bytes(20_000)
    file.write_bytes(content)
    code, out, err = await ending(file, "--port", "0", "--rate", "100")
    assert code == 2
    assert err == "catgraph replay: hurt.bag is damaged: a part of it cannot be unpacked\n"
    assert json.loads(re.sub(" ", "", re.search(r"Played ([\d ]+) messages", out)[1])) > 100  # type: ignore[index]


def test_what_is_damaged_is_reported_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = split(tmp_path, "mcap")
    (folder / "drive_1.mcap").unlink()
    with open_recording([folder]) as recording:
        Report(recording, RosBridge(ros_version=2)).close()
    assert capsys.readouterr().out.count("drive_1.mcap is missing") == 1


async def test_topics_that_no_bridge_could_carry_are_noted(tmp_path: Path) -> None:
    messages = [(0.0, "/a topic", "std_msgs/msg/String", {"data": "x"}), (0.1, "/n", "std_msgs/msg/Int32", {"data": 1})]
    code, out, err = await ending(write_ros1(tmp_path / "a.bag", Drive(messages=messages)), "--port", "0")
    assert (code, err) == (0, "")
    assert "Note: '/a topic' (1 messages) is left out: '/a topic' is not a valid name" in out
    assert "Played 1 message in" in out

"""A real drive, replayed through a rosbridge at true speed, and what the server then knows of it."""

from __future__ import annotations

import asyncio
import contextlib
import re
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from server.analysis.rehearse import rehearse
from server.app.config import Config
from server.judge.pipeline import TICK_S
from server.recording.read.read import open_recording
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server import scan_frames
from tests.server.conftest import serving
from tests.server.viewer import Viewer, viewer

pytestmark = pytest.mark.field

MESSAGES = {
    "speed": 1120,
    "brake": 1117,
    "accelerator": 1118,
    "steering": 1117,
    "distance": 4190,
    "bearing": 4183,
    "position": 560,
    "odometry": 560,
    "command": 263,
}


FILES = {1: "catvehicle_2016-06-01.bag", 2: "catvehicle_2016-06-01_mcap"}  # by the version of ROS
JITTER_S = 0.05  # of a bridge and a server on a machine that is busy with tests
LOOKS_BACK_MS = 11_000.0  # the check that the car moves looks back ten seconds
AFTER_MS = 500.0  # what was played late arrives after the moment


@contextlib.asynccontextmanager
async def replaying(path: Path, *options: str) -> AsyncIterator[str]:
    """`catgraph replay` as a process; its ws address."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server", "replay", str(path), "--port", "0", "--wait", "--stay", *options),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )
    assert process.stdout is not None
    try:
        async with asyncio.timeout(30):
            while True:
                line = (await process.stdout.readline()).decode()
                assert line, "replay ended before it printed its address"
                found = re.search(r"ws://[\d.]+:\d+", line)
                if found:
                    break
        yield found.group()
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


@pytest.mark.slow
@pytest.mark.timeout(180)
async def test_the_real_drive_of_2016_06_01_both_ways(recordings: Path) -> None:
    """The ROS 1 bag and the ROS 2 MCAP at once, two vehicles of one server: every message, the drive's figures."""
    async with (
        replaying(recordings / "catvehicle_2016-06-01.bag") as bag,
        replaying(recordings / "catvehicle_2016-06-01_mcap") as mcap,
        serving(Config(vehicles=(Vehicle(name="bag", address=bag), Vehicle(name="mcap", address=mcap)))) as server,
        viewer(server, vehicle="bag") as of_bag,
        viewer(server, vehicle="mcap") as of_mcap,
        http_client() as client,
    ):
        for one in (of_bag, of_mcap):
            await one.until(lambda one=one: one.states and one.states[-1]["session"]["received"] >= 14228, within_s=100)
        await asyncio.sleep(0.5)  # no message more than there are
        for one, version in ((of_bag, 1), (of_mcap, 2)):
            state = (await client.get(f"{server}/api/state", params={"vehicle": one.states[-1]["vehicle"]})).json()
            assert state["session"]["ros_version"] == version
            assert state["session"]["received"] == 14228
            assert state["session"]["rejected"] == 0
            signals = state["signals"]
            assert {name: signals[name]["count"] for name in MESSAGES} == MESSAGES
            assert all(signal["rejected"] == 0 for signal in signals.values())
            assert signals["speed"]["highest"] == pytest.approx(4.23, abs=0.005)
            assert signals["brake"]["highest"] == pytest.approx(22.35, abs=0.005)
            assert (signals["accelerator"]["lowest"], signals["accelerator"]["highest"]) == (0, 0)
            assert signals["steering"]["lowest"] == pytest.approx(-4.33, abs=0.005)
            assert signals["steering"]["highest"] == pytest.approx(1.70, abs=0.005)
            assert signals["distance"]["lowest"] == pytest.approx(4.10, abs=0.005)
            assert signals["distance"]["highest"] == pytest.approx(14.55, abs=0.005)
            assert state["session"]["track_m"] == pytest.approx(76, abs=1.0)
            assert signals["command"]["value"]["tyre_angle_rad"] is None
            assert "angular.z is null" in signals["command"]["note"]
            _assert_seen_on_the_socket(one)
            log = (await client.get(f"{server}/api/log", params={"vehicle": one.states[-1]["vehicle"]})).json()
            _assert_as_rehearsed(recordings / FILES[version], log["events"], one)


def _assert_seen_on_the_socket(one: Viewer) -> None:
    """The page's own frames show the drive as it went, at true speed."""
    last = one.states[-1]
    assert last["signals"]["speed"]["highest"] == pytest.approx(4.23, abs=0.005)
    speeds = [
        state["signals"]["speed"]["value"]["speed_mps"] for state in one.states if state["signals"]["speed"]["value"]
    ]
    assert max(speeds) > 4.1
    received = [index for index, state in enumerate(one.states) if state["session"]["received"] > 0]
    done = next(index for index, state in enumerate(one.states) if state["session"]["received"] >= 14228)
    assert one.got_s[done] - one.got_s[received[0]] == pytest.approx(55.9, abs=1.0)
    assert done - received[0] > 400  # some ten a second


def _assert_as_rehearsed(file: Path, events: list[dict[str, Any]], one: Viewer) -> None:
    """`catgraph check` of the file has the same events as the log of the live drive, at the same times to a tick.

    A moment of the live drive is identified by the newest speed message then: a busy machine plays a drive more slowly
    at times. The delay in the seconds before is measured and allowed for.
    """
    with open_recording([file]) as recording:
        run = rehearse(recording)
        topic = run.sources["speed"].topic
        speed_s = [message.at_s - recording.start_s for message in recording.messages(0.0, {topic})
                   if message.topic == topic]  # fmt: skip
    received = [
        (state["server"]["time_ms"] - 1000 * (speed["age_s"] - speed["delay_s"]), speed["count"])
        for state in one.states
        if (speed := state["signals"]["speed"])["count"]
    ]

    def in_file_s(at_ms: float) -> float:
        heard_ms, count = max((row for row in received if row[0] <= at_ms), default=received[0])
        return speed_s[count - 1] + (at_ms - heard_ms) / 1000

    def slip_s(at_ms: float) -> float:
        """How unevenly the drive was played in the seconds that an alarm may look back."""
        late = [
            heard_ms / 1000 - speed_s[count - 1]
            for heard_ms, count in received
            if at_ms - LOOKS_BACK_MS <= heard_ms <= at_ms + AFTER_MS
        ]
        return max(late) - min(late)

    at_ms = {
        (event["alarm"], event["change"], event["occurrence"]): event["at_ms"]
        for event in events
        if event["alarm"] is not None
    }
    live = {name: in_file_s(one_ms) for name, one_ms in at_ms.items()}
    rehearsed = {(row.alarm_id, row.change, row.occurrence): row.at_s for row in run.transitions}
    during = {
        name for name, at_s in live.items() if at_s <= run.to_s
    }  # then the replay falls silent, which raises an alarm
    assert rehearsed
    during = {one for one in during if one[0] != "reach"}  # nobody listens here, which no recording shows
    assert during == set(rehearsed)
    for name, at_s in rehearsed.items():
        assert live[name] == pytest.approx(at_s, abs=TICK_S + JITTER_S + slip_s(at_ms[name])), name


async def test_the_real_laser(recordings: Path) -> None:
    """681 beams; what is nearer than range_min is no return, on the wire as in the state."""
    path = recordings / "lidar" / "scan_tools_hokuyo_demo.bag"
    async with (
        replaying(path, "--loop") as bag,
        serving(Config(vehicles=(Vehicle(name="car", address=bag),))) as server,
        viewer(server) as one,
    ):
        await one.send({"kind": "watch", "scan": True})
        await one.until(lambda: len(one.scans) >= 30, within_s=30)
        state = await one.state(lambda s: s["signals"]["scan"]["value"])
        scan = state["signals"]["scan"]
        assert scan["rejected"] == 0
        assert scan["value"]["beams"] == 681
        assert scan["value"]["nearest_m"] >= scan["value"]["range_min_m"]
        for frame in one.scans:
            sent = scan_frames.read(frame)
            assert sent.codes.size == 681
            drawn = sent.codes[(sent.codes > 0) & (sent.codes < 65533)] * sent.scale_m
            assert drawn.min() >= scan["value"]["range_min_m"] - sent.scale_m
        assert sum((scan_frames.read(frame).codes == 65535).sum() for frame in one.scans) > 0

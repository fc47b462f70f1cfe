"""A drive replayed, recorded over the real link, exported to a bag: it equals the original, message for message.

What is compared: for every topic all messages in their order, with their type and every field, NaN included, stamps in
headers to the nanosecond; and the order of all topics together, but for messages that the replay sends within
REORDERED_WITHIN_S: a subscription with a queue requests a throttle of 1 ms (docs/decisions.md), and a bridge sends what
it throttled after what came in that time on other topics. Not compared is when a message was received: the
original has the time of recording in the car, ours of reception. A bridge sends NaN and ±Inf as null in JSON, so
where the original has ±Inf a recording made over JSON has NaN.
"""

from __future__ import annotations

import asyncio
import math
import os
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.app.config import Config
from server.recording.export.formats.bag import write_bag
from server.recording.read.read import Message, Recording, open_recording
from server.vehicle.vehicle import Vehicle
from tests.server.conftest import serving
from tests.server.recording.bags import Drive, Row, write_ros1, write_ros2
from tests.tree import PROJECT

BAG, MCAP = "catvehicle_2016-06-01.bag", "catvehicle_2016-06-01_mcap"
QUICKER = 2  # times true speed: the bridge keeps a burst of 0.13 s of it
REORDERED_WITHIN_S = 0.005


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(180)
@pytest.mark.parametrize("name", [BAG, MCAP])
async def test_a_replayed_drive_is_recorded_and_exported_as_it_was(recordings: Path, tmp_path: Path, name: str) -> None:
    source = recordings / name
    ours = await recorded(source, tmp_path / "data")
    with open_recording([ours]) as recording:
        assert recording.ros_version == (1 if name == BAG else 2)
        outcome = write_bag(recording, tmp_path / "out.bag", with_own=False)
    assert outcome.notes == []
    with open_recording([source]) as before, open_recording([tmp_path / "out.bag"]) as after:
        assert {t: (i.type.replace("/msg/", "/"), i.count) for t, i in before.topics.items()} == {
            t: (i.type, i.count) for t, i in after.topics.items()
        }
        count, not_a_number = 0, 0
        assert_same_order(list(before.messages()), list(after.messages()))
        of_each = [sorted(one.messages(), key=lambda message: message.topic) for one in (before, after)]
        for old, new in zip(*of_each, strict=True):
            count += 1
            for where, one, other in leaves(old.message, new.message, old.topic):
                not_a_number += is_nan(one)
                assert same(one, other), (where, one, other)
        assert count == after.count == 14228
        assert not_a_number == 263  # the tyre angle in every command of this drive


def assert_same_order(before: list[Message], after: list[Message]) -> None:
    """Every message stands after those that the replay sent REORDERED_WITHIN_S and more before it."""
    nth: Counter[str] = Counter()
    sent_s: dict[tuple[str, int], float] = {}
    for message in before:
        nth[message.topic] += 1
        sent_s[message.topic, nth[message.topic]] = (message.at_s - before[0].at_s) / QUICKER
    nth.clear()
    newest_s = 0.0
    for message in after:
        nth[message.topic] += 1
        at_s = sent_s[message.topic, nth[message.topic]]
        assert at_s > newest_s - REORDERED_WITHIN_S, (message.topic, nth[message.topic])
        newest_s = max(newest_s, at_s)


ODD = [math.nan, math.inf, -math.inf, -0.0, 1e-45, 3.0, 81.0]


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.parametrize("version", [1, 2])
async def test_infinities_and_nan_of_scans_stay_apart(tmp_path: Path, version: int) -> None:
    """Scans come as CBOR, which keeps them; the bridge leaves out what comes while a scan is on its way."""
    scans: list[Row] = [
        (
            0.1 * n,
            "/scan",
            "sensor_msgs/msg/LaserScan",
            {"header": {"stamp": {"sec": n, "nanosec": 7}, "frame_id": "laser"}, "range_max": 80.0, "ranges": ODD},
        )
        for n in range(1, 61)
    ]
    write = write_ros1 if version == 1 else write_ros2
    source = write(tmp_path / ("in.bag" if version == 1 else "in"), Drive(messages=scans))
    ours = await recorded(source, tmp_path / "data", quicker=2)
    with open_recording([ours]) as recording:
        assert write_bag(recording, tmp_path / "out.bag").notes == []
    with open_recording([source]) as before, open_recording([tmp_path / "out.bag"]) as after:
        sent = {message.message["header"]["stamp"][SECONDS[version]]: message.message for message in before.messages()}
        received = [message.message for message in after.messages() if message.topic == "/scan"]
    assert len(received) > 40
    for message in received:
        original = sent[message["header"]["stamp"]["secs"]]
        assert [where for where, a, b in leaves(original, message, "scan") if not same(a, b)] == []
        assert np.signbit(message["ranges"][3])


SECONDS = {1: "secs", 2: "sec"}


async def recorded(source: Path, data: Path, quicker: int = QUICKER) -> Path:
    """What our server keeps of a drive that our bridge plays."""
    bridge = await asyncio.create_subprocess_exec(
        *(sys.executable, "-u", "-m", "server", "replay", str(source), "--port", "0", "--wait"),
        *("--rate", str(quicker)),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        env=os.environ | {"PYTHONPATH": str(PROJECT)},
    )
    assert bridge.stdout is not None
    try:
        address = ""
        async with asyncio.timeout(30):
            while not address:
                parts = (await bridge.stdout.readline()).decode().split()
                address = next((part for part in parts if part.startswith("ws://")), "").rstrip(".,")
        async with serving(Config(vehicles=(Vehicle(name="car", address=address),), data=data)):
            async with asyncio.timeout(120):
                await bridge.stdout.read()
                assert await bridge.wait() == 0
            await asyncio.sleep(1.0)  # the link is found lost, the part is closed
    finally:
        if bridge.returncode is None:
            bridge.kill()
            await bridge.communicate()
    (made,) = (data / "recordings" / "car").glob("*.mcap")
    return made


def leaves(one: Any, other: Any, where: str) -> Iterator[tuple[str, Any, Any]]:
    """The values of a message beside those of another, field by field, whatever the ROS version names its times."""
    if isinstance(one, dict):
        renamed = {"sec": "secs", "nanosec": "nsecs"}
        named = {renamed.get(name, name): value for name, value in one.items()}
        added = {"seq"} if "seq" not in named and "frame_id" in named else set()  # of a header; ROS 2 has none
        assert named.keys() == other.keys() - added, where
        for name, value in named.items():
            yield from leaves(value, other[name], f"{where}.{name}")
    elif isinstance(one, list):
        assert len(one) == len(other), where
        for index, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from leaves(a, b, f"{where}[{index}]")
    else:
        yield where, one, other


def same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(one, other, equal_nan=one.dtype.kind == "f")) and one.dtype == other.dtype
    return type(one) is type(other) and (one == other or (is_nan(one) and is_nan(other)))


def is_nan(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)


def test_the_comparison_finds_what_differs(recordings: Path) -> None:
    """Otherwise it proves nothing."""

    def first(recording: Recording, topic: str) -> Any:
        return next(message.message for message in recording.messages() if message.topic == topic)

    with open_recording([recordings / BAG]) as bag:
        one = first(bag, "/gps_fix")
    other = {**one, "latitude": math.nextafter(one["latitude"], 90.0)}
    found = [where for where, a, b in leaves(one, other, "fix") if not same(a, b)]
    assert found == ["fix.latitude"]

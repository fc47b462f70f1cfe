"""Exported bags before ROS itself: Debian's own `rosbag info` and `rosbag play` (apt install python3-rosbag
python3-rosmaster; `.ci/run` does so where it can)."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal
from xmlrpc.client import ServerProxy

import pytest
from rosbags.rosbag1 import Reader

from server.recording.export.formats.bag import write_bag
from server.recording.read.read import open_recording
from tests.ports import free_port
from tests.server.recording.export.ours import Own, as_ours, event

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (shutil.which("rosbag") and shutil.which("rosmaster")),
        reason="ROS's own rosbag is not installed: apt install python3-rosbag python3-rosmaster",
    ),
]
BAG, MCAP = "catvehicle_2016-06-01.bag", "catvehicle_2016-06-01_mcap"
BEGAN_NS = 1_464_818_234_304_184_000
RECORDER = "/usr/lib/rosbag/record"  # what `rosbag record` starts; it tells nobody of its end
QUICKER = 10  # times true speed


def exported(source: Path, folder: Path, compression: Literal["none", "bz2", "lz4"]) -> Path:
    events: list[Own] = [(BEGAN_NS + 10**9, "/catgraph/alarms", event(1, BEGAN_NS // 10**6 + 1000, "raised"))]
    ours = as_ours(source, folder / "ours.mcap", events)
    with open_recording([ours]) as recording:
        write_bag(recording, folder / "out.bag", compression=compression)
    return folder / "out.bag"


def environment(folder: Path, port: int = 1) -> dict[str, str]:
    """Of a program of ROS: nothing of ours."""
    return {
        "PATH": os.environ["PATH"],
        "HOME": str(folder),
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "TZ": "UTC",
    }


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
@pytest.mark.parametrize("name", [BAG, MCAP])
def test_rosbag_info_understands_it(
    recordings: Path, tmp_path: Path, name: str, compression: Literal["none", "bz2", "lz4"]
) -> None:
    bag = exported(recordings / name, tmp_path, compression)
    info = subprocess.run(
        ["rosbag", "info", str(bag)], env=environment(tmp_path), capture_output=True, text=True, timeout=60, check=True
    )
    assert info.stderr == ""
    text = info.stdout
    assert re.search(r"messages: +14229\n", text)
    assert re.search(r"duration: +55\.9s\n", text)
    assert re.search(rf"compression: +{compression}", text)
    assert re.search(r"/catvehicle/distanceEstimator/dist +4190 msgs +: std_msgs/Float32", text)
    assert re.search(r"/catgraph/alarms +1 msg +: std_msgs/String", text)
    assert re.search(r"sensor_msgs/NavSatFix +\[2d3a8cd499b9b4a0249fb98fd05cfa48\]", text)


@pytest.mark.field
@pytest.mark.timeout(180)
@pytest.mark.parametrize(("name", "compression"), [(BAG, "none"), (BAG, "bz2"), (MCAP, "lz4")])
def test_rosbag_play_plays_every_message_as_it_is(
    recordings: Path, tmp_path: Path, name: str, compression: Literal["none", "bz2", "lz4"]
) -> None:
    """Received by ROS's own recorder: every topic's messages, byte for byte and in order."""
    bag = exported(recordings / name, tmp_path, compression)
    sent = messages(bag)
    received = tmp_path / "received.bag"
    with master(tmp_path) as port, recorder(tmp_path, port, received, list(sent)):
        played = subprocess.run(
            ["rosbag", "play", "--quiet", "-r", str(QUICKER), "-d", "3", "--queue=20000", str(bag)],
            env=environment(tmp_path, port),
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert (played.returncode, played.stderr) == (0, "")
        time.sleep(1.0)  # what the recorder has received and not yet written: nothing shows when
    assert messages(received) == sent


def messages(path: Path) -> dict[str, list[bytes]]:
    found: dict[str, list[bytes]] = {}
    with Reader(path) as bag:
        for connection, _, raw in bag.messages():
            found.setdefault(connection.topic, []).append(bytes(raw))
    return found


@contextmanager
def master(folder: Path) -> Iterator[int]:
    port = free_port()
    process = subprocess.Popen(
        ["rosmaster", "--core", "-p", str(port)], env=environment(folder, port), stdout=subprocess.DEVNULL, cwd=folder
    )
    try:
        wait_for(lambda: is_open(port))
        yield port
    finally:
        process.terminate()
        process.wait(10)


@contextmanager
def recorder(folder: Path, port: int, out: Path, topics: list[str]) -> Iterator[None]:
    log = folder / "record.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [RECORDER, "--buffsize=0", "-O", str(out), *topics],
            env=environment(folder, port),
            stdout=output,
            stderr=output,
            cwd=folder,
        )
        try:
            wait_for(lambda: set(topics) <= subscribed(port))
            yield
        finally:
            process.send_signal(signal.SIGINT)  # it then closes its bag
            process.wait(20)


def subscribed(port: int) -> set[str]:
    """The topics that somebody listens to, as the master has it."""
    with ServerProxy(f"http://127.0.0.1:{port}") as proxy:
        answer: Any = proxy.getSystemState("/test")
    _, _, (_, subscribers, _) = answer
    return {topic for topic, _ in subscribers}


def is_open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def wait_for(what: object, limit_s: float = 30.0) -> None:
    assert callable(what)
    until_s = time.monotonic() + limit_s
    while not what():
        assert time.monotonic() < until_s, "it did not come"
        time.sleep(0.05)

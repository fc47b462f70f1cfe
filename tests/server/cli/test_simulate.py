"""`catgraph simulate` as a process."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue

import pytest

from tests.server.simulator.conftest import PATIENCE_S, bridge_client

PROJECT = Path(__file__).resolve().parents[3]
COMMAND = [sys.executable, "-m", "server", "simulate"]
START_S = 30.0  # a busy machine takes its time to load everything


class Simulator:
    """A running `catgraph simulate`, its lines read as they come."""

    def __init__(self, *options: str) -> None:
        self.process = subprocess.Popen(
            [*COMMAND, "--port", "0", *options],
            cwd=PROJECT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._lines: Queue[str] = Queue()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()
        found = re.search(r"ws://127\.0\.0\.1:(\d+) ", self.line("ws://", START_S))
        assert found is not None
        self.port = int(found[1])

    def type(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def line(self, part: str, within_s: float = PATIENCE_S) -> str:
        """The next line that holds this text."""
        until_s = time.monotonic() + within_s
        while True:
            try:
                line = self._lines.get(timeout=max(0.01, until_s - time.monotonic()))
            except Empty:
                pytest.fail(f"no line with {part!r}")
            if part in line:
                return line

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)


@contextmanager
def simulator(*options: str) -> Iterator[Simulator]:
    running = Simulator(*options)
    try:
        yield running
    finally:
        running.process.kill()
        running.reader.join()  # before the pipe that it reads is closed
        running.process.communicate()


def refused(*options: str) -> str:
    """What the command prints when it does not start."""
    ended = subprocess.run([*COMMAND, *options], cwd=PROJECT, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2
    assert ended.stdout == ""
    return ended.stderr


def test_interrupted_it_ends_quietly_with_130() -> None:
    with simulator() as running:
        running.process.send_signal(signal.SIGINT)
        assert running.process.wait(PATIENCE_S) == 130
        assert running.process.stderr is not None
        assert running.process.stderr.read() == ""


def test_a_taken_port_is_one_sentence_and_exit_2() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        printed = refused("--port", str(port))
    assert printed == f"catgraph: Port {port} on 127.0.0.1 is already in use by another program.\n"


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (("--scenario", "nope"), "There is no scenario “nope”."),
        (("--scenario", "speeding@soon"), "“speeding@soon” is not NAME, NAME@SECONDS"),
        (("--scan-beams", "3"), "16 to 20000 beams"),
        (("--rate", "0"), "The rate must be above 0"),
        (("--seed", "-1"), "The seed must be 0 or more."),
    ],
    ids=lambda value: str(value)[:30],
)
def test_what_cannot_be_is_one_sentence_and_exit_2(options: tuple[str, ...], part: str) -> None:
    printed = refused("--port", "0", *options)
    assert printed.startswith("catgraph: ")
    assert part in printed
    assert printed.count("\n") == 1


def test_the_help_lists_every_scenario() -> None:
    ran = subprocess.run([*COMMAND, "--help"], cwd=PROJECT, capture_output=True, text=True, timeout=60, check=True)
    for name in ("speeding", "bridge-killed", "--scan-beams", "--scenario"):
        assert name in ran.stdout


def test_without_any_input_it_drives_on() -> None:
    """As a service manager or `catgraph simulate <&-` starts it."""
    with subprocess.Popen(
        ["/bin/sh", "-c", 'exec "$@" <&-', "sh", *COMMAND, "--port", "0"],
        cwd=PROJECT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert "ws://" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, errors) == (130, "")


@pytest.mark.field
async def test_typing_a_name_starts_a_scenario() -> None:
    with simulator("--ros", "2") as running:
        async with bridge_client(running.port) as client:
            await client.subscribe("/catvehicle/brake")
            running.type("pedal-conflict")
            running.line("pedal-conflict started.")
            await client.next("/catvehicle/brake", lambda message: message["force"]["x"] > 10)
            types = (await client.call("/rosapi/topics"))["values"]["types"]
            assert "geometry_msgs/msg/Wrench" in types


@pytest.mark.field
async def test_after_being_stopped_it_goes_on_from_now_without_a_flood() -> None:
    """As when the bridge's process is stopped and let go on: old messages are not made up for."""
    with simulator() as running:
        async with bridge_client(running.port) as client:
            await client.subscribe("/gps_fix")
            await client.next("/gps_fix")
            os.kill(running.process.pid, signal.SIGSTOP)
            time.sleep(2.0)  # noqa: ASYNC251  nothing else has to run meanwhile
            os.kill(running.process.pid, signal.SIGCONT)
            await client.next("/gps_fix", lambda message: age_s(message) < 0.5)
            began_s = time.monotonic()
            fixes = 0
            while time.monotonic() < began_s + 1.0:
                assert age_s(await client.next("/gps_fix")) < 0.5
                fixes += 1
            assert fixes <= 13


def age_s(message: dict[str, dict[str, dict[str, int]]]) -> float:
    stamp = message["header"]["stamp"]
    return time.time() - stamp["secs"] - stamp["nsecs"] * 1e-9


async def test_a_plan_on_the_command_line_and_a_dense_scan() -> None:
    with simulator("--scenario", "blind-laser@0+100", "--scan-beams", "720", "--seed", "5") as running:
        async with bridge_client(running.port) as client:
            await client.subscribe("/catvehicle/front_laser_points")
            scan = await client.next("/catvehicle/front_laser_points")
            assert scan["ranges"] == [None] * 720
            assert json.dumps(scan["header"]["frame_id"]) == '"laser"'

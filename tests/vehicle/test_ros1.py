"""The guard as a ROS 1 node, with Debian's rosmaster and rospy (`apt install python3-rospy python3-rosmaster
python3-geometry-msgs`; `.ci/run` does so where it can)."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.environment import users_own
from tests.tree import PROJECT
from tests.vehicle.conftest import GUARD

ROS_PYTHON = "/usr/bin/python3"
PROBE = PROJECT / "tests" / "vehicle" / "ros1_probe.py"


def has_ros() -> bool:
    if shutil.which("rosmaster") is None or not Path(ROS_PYTHON).exists():
        return False
    tried = subprocess.run(
        [ROS_PYTHON, "-c", "import rospy, geometry_msgs.msg, std_msgs.msg"], capture_output=True, check=False
    )
    return tried.returncode == 0


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not has_ros(),
        reason="ROS 1 is not installed: apt install python3-rospy python3-rosmaster python3-geometry-msgs",
    ),
]


@contextmanager
def running(*command: str, environment: dict[str, str], folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        command, env=environment, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[dict[str, str]]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    home = tmp_path / "ros"
    home.mkdir()
    environment = users_own() | {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(home),
        "ROS_LOG_DIR": str(home),
        "PYTHONPATH": os.pathsep.join([str(GUARD), "/usr/lib/python3/dist-packages"]),
    }
    with running("rosmaster", "--core", "-p", str(port), environment=environment, folder=tmp_path):
        deadline_s = time.monotonic() + 20
        while True:
            with socket.socket() as tried:
                if tried.connect_ex(("127.0.0.1", port)) == 0:
                    break
            assert time.monotonic() < deadline_s
            time.sleep(0.05)
        yield environment


@pytest.mark.timeout(90)
def test_the_node_slows_the_car_when_the_operator_falls_silent(ros: dict[str, str], tmp_path: Path) -> None:
    node = (
        ROS_PYTHON,
        str(GUARD / "scripts" / "ocu_guard_node"),
        "cmd_vel:=/catvehicle/cmd_vel",
        "cmd_vel_controller:=/catvehicle/cmd_vel_controller",
        "vel:=/catvehicle/vel",
    )
    with running(*node, environment=ros, folder=tmp_path):
        probe = subprocess.run(
            [ROS_PYTHON, str(PROBE)], env=ros, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
        )
    assert probe.returncode == 0, probe.stderr
    found = json.loads(probe.stdout)
    assert (found["guarded"], found["held"], found["released"]) == ("guarded", "holding", "guarded")
    told = found["told"]
    assert {angle_rad for _, _, angle_rad in told} == {0.1}
    assert {speed_mps for at_s, speed_mps, _ in told if at_s < 0.7} == {3.0}
    slowed_s = next(at_s for at_s, speed_mps, _ in told if speed_mps < 3.0)
    stood_s = next(at_s for at_s, speed_mps, _ in told if speed_mps == 0.0)
    assert 0.7 < slowed_s < 1.4
    assert stood_s - slowed_s == pytest.approx(3.0 / 1.5, abs=0.3)
    assert told[-1][1] == 3.0  # released

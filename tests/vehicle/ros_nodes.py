"""The guard's node in a process of its own, on a real ROS 1 or ROS 2, and the driver around it."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from tests.ports import free_port
from tests.tree import PROJECT
from tests.vehicle import ros2_environment
from tests.vehicle.conftest import GUARD

DRIVER = PROJECT / "tests" / "vehicle" / "ros_driver.py"
ROS1_PYTHON = "/usr/bin/python3"
ROS1_PACKAGES = "python3-rospy python3-roslaunch python3-geometry-msgs python3-std-msgs"
ENDS_WITHIN_S = 10.0
STARTS_WITHIN_S = 30.0


@cache
def missing(version: int) -> str | None:
    """Why this ROS cannot be had here; None where it is installed."""
    if version == 2:
        return ros2_environment.missing()
    tried = [ROS1_PYTHON, "-c", "import rospy, geometry_msgs.msg, std_msgs.msg"]
    if (
        shutil.which("roscore") is None
        or not Path(ROS1_PYTHON).exists()
        or subprocess.run(tried, capture_output=True, check=False).returncode
    ):
        return f"ROS 1 is not installed: apt install {ROS1_PACKAGES}"
    return None


class Process:
    """A node. Its output is read by a thread of its own."""

    def __init__(self, command: list[str], environment: dict[str, str], folder: Path) -> None:
        self._process = subprocess.Popen(
            command,
            env=environment,
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    def _read(self) -> None:
        assert self._process.stdout is not None
        self.lines.extend(iter(self._process.stdout.readline, ""))

    def write(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def end(self, by: signal.Signals = signal.SIGTERM) -> int:
        """Its exit status."""
        with contextlib.suppress(ProcessLookupError):
            self._process.send_signal(by)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(ENDS_WITHIN_S)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)  # and its children, which hold its output open
        self._process.wait(ENDS_WITHIN_S)
        self._reader.join(ENDS_WITHIN_S)
        assert not self._reader.is_alive()  # closing what is still being read would wait for ever
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        self._process.stdout.close()
        return self._process.returncode


class Car:
    """A guard, its driver, and everything that the guard published: commands as (moment, m/s, rad), states as
    (moment, JSON). Moments are of this machine's monotonic clock."""

    def __init__(self, version: int, environment: dict[str, str], folder: Path) -> None:
        self.version = version
        self.namespace = f"/t{uuid.uuid4().hex[:8]}"
        self.guard: Process | None = None
        self._environment = environment
        self._folder = folder
        self._driver: Process | None = None

    @property
    def python(self) -> str:
        return ROS1_PYTHON if self.version == 1 else str(ros2_environment.PYTHON)

    def start(self, **parameters: object) -> None:
        """Starts the guard as a node in the namespace, and its driver."""
        self.run(self.command({"__ns": self.namespace}, parameters), self.namespace, self.namespace)

    def command(self, remappings: dict[str, str], parameters: dict[str, object]) -> list[str]:
        """How the guard's node is started by hand."""
        renamed = [f"{old}:={new}" for old, new in remappings.items()]
        if self.version == 1:
            given = [f"_{name}:={value}" for name, value in parameters.items()]
            return [ROS1_PYTHON, str(GUARD / "scripts" / "ocu_guard_node"), *renamed, *given]
        given = [f"{name}:={value}" for name, value in parameters.items()]
        start = [str(ros2_environment.PYTHON), "-c", "from ocu_guard.ros2 import main; main()", "--ros-args"]
        return [*start, *(part for one in renamed for part in ("-r", one)), *(w for one in given for w in ("-p", one))]

    def run(self, command: list[str], vehicle: str, guard: str) -> None:
        """Starts the guard by that command; returns when the driver's topics reach it. `vehicle`, `guard`: the
        namespaces in which its topics then are."""
        if self._driver is None:
            driver = [self.python, str(DRIVER), str(self.version), vehicle, guard]
            self._driver = Process(driver, environment=self._environment, folder=self._folder)
        self.guard = Process(command, environment=self._environment, folder=self._folder)
        began_s = time.monotonic()
        self.until(lambda: bool(self.states_since(began_s)) and self._is_matched(), STARTS_WITHIN_S)

    def publish(self, **what: object) -> None:
        """What the driver publishes from now on; see its docstring."""
        assert self._driver is not None
        self._driver.write(json.dumps(what))

    def until(self, is_so: Callable[[], bool], within_s: float = 10.0) -> float:
        """Waits; answers the moment."""
        ends_s = time.monotonic() + within_s
        while not is_so():
            assert time.monotonic() < ends_s, [one.lines[-9:] for one in (self._driver, self.guard) if one is not None]
            time.sleep(0.01)
        return time.monotonic()

    def until_state(self, state: str, within_s: float = 10.0) -> dict[str, Any]:
        self.until(lambda: self.state == state, within_s)
        return self._lines("state")[-1][1]

    @property
    def state(self) -> str:
        """The newest."""
        states = self._lines("state")
        return str(states[-1][1]["state"]) if states else ""

    def states_since(self, moment_s: float) -> list[dict[str, Any]]:
        return [state for at_s, state in self._lines("state") if at_s >= moment_s]

    def commands_since(self, moment_s: float) -> list[tuple[float, float, float]]:
        return [(at_s, *command) for at_s, command in self._lines("command") if at_s >= moment_s]

    def end(self) -> None:
        if self._driver is not None:
            self._driver.end(signal.SIGKILL)
        if self.guard is not None:
            self.guard.end()

    def _is_matched(self) -> bool:
        found = self._lines("matched")
        return bool(found) and found[-1][1]

    def _lines(self, kind: str) -> list[tuple[float, Any]]:
        lines = self._driver.lines if self._driver is not None else []
        read = [json.loads(line) for line in lines if line.startswith("{")]
        return [(line["at_s"], line[kind]) for line in read if kind in line]


@contextlib.contextmanager
def ros1(folder: Path) -> Iterator[dict[str, str]]:
    """A roscore on a port of its own; the environment of its nodes."""
    port = free_port()
    environment = os.environ | {
        "PATH": "/usr/bin:/bin:/usr/sbin:/sbin",  # nodes are found by `env python3`, which is Debian's own here
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(folder),
        "ROS_LOG_DIR": str(folder),
        "ROS_PACKAGE_PATH": os.pathsep.join([str(GUARD.parent), "/usr/share"]),
        "PYTHONPATH": os.pathsep.join([str(GUARD), "/usr/lib/python3/dist-packages"]),
        "PYTHONUNBUFFERED": "1",
    }
    core = Process(["roscore", "-p", str(port)], environment=environment, folder=folder)
    try:
        ends_s = time.monotonic() + STARTS_WITHIN_S
        while not any("started core service" in line for line in tuple(core.lines)):
            assert time.monotonic() < ends_s, core.lines
            time.sleep(0.05)
        yield environment
    finally:
        core.end()


@contextlib.contextmanager
def ros2(folder: Path) -> Iterator[dict[str, str]]:
    """The environment of ROS 2 nodes that see this machine's only. Topics are apart by the namespace."""
    yield os.environ | {
        "ROS_DOMAIN_ID": str(os.getpid() % 100 + 1),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_HOME": str(folder),
        "ROS_LOG_DIR": str(folder),
        "PYTHONPATH": str(GUARD),
        "PYTHONUNBUFFERED": "1",
    }

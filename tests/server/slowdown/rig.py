"""A slow-down without a car, without a server and on a clock of its own."""

from __future__ import annotations

import errno
from collections.abc import Callable, Mapping
from typing import Any

from monitor.shell_facts import SlowingFacts
from monitor.state import Snapshot, State
from monitor.values import Steering, Twist
from server.protocol import commands
from server.slowdown.command_target import CommandTarget
from server.slowdown.controller import SlowDownController
from server.slowdown.sender import PERIOD_S

WAY = CommandTarget(topic="/cmd_vel", type="geometry_msgs/Twist", kind="Twist")
STRAIGHT = Steering(percent=0.0, tyre_rad=0.0)


class Link:
    """An open link that keeps what is sent."""

    is_open = True
    unanswered = 0

    def __init__(self) -> None:
        self.speeds: list[float] = []
        self.angles: list[float] = []
        self.heard_s = 0.0

    def send_now(self, message: Mapping[str, Any]) -> None:
        if message["op"] == "publish":
            self.speeds.append(message["msg"]["linear"]["x"])
            self.angles.append(message["msg"]["angular"]["z"])

    def ping(self) -> None:
        pass

    def abort(self) -> None:
        self.is_open = False


class Rig:
    """A slow-down without a car, on a clock of its own; what is named in `fails` raises."""

    def __init__(self, *, steering: Steering | None = STRAIGHT) -> None:
        self.fails: set[str] = set()
        self.now_s = 50.0
        self.clock: Callable[[], float] = lambda: self.now_s
        self.notes: list[str] = []
        self.link = Link()
        self.steering = steering  # as it comes with each speed
        self.state = State()
        self.slowing = SlowDownController(
            self._note,
            now=lambda: self.clock(),
            wall_ms=lambda: 1_700_000_000_000,
            snapshot=self._snapshot,
            record=self._record,
            number=0,
        )
        self.slowing.car.is_steering_known = True
        self.slowing.link_opened(self.link)
        self.pass_time(1.0)

    def _note(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None:
        self._fail("log", OSError(errno.ENOSPC, "No space left on device"))
        self.notes.append(f"{change}: {text}")

    def _record(self, message: Mapping[str, Any]) -> None:
        self._fail("recording", OSError(errno.EMFILE, "Too many open files"))

    def _snapshot(self) -> Snapshot:
        self._fail("snapshot", RuntimeError("no state"))
        return self.state.snapshot(self.now_s)

    def _fail(self, part: str, error: Exception) -> None:
        if part in self.fails:
            raise error

    def tick(self) -> SlowingFacts:
        return self.slowing.tick(WAY, {}, ros_version=1, is_paused=False)

    def pass_time(self, seconds: float) -> None:
        """The car drives on at 6 m/s; a tick each period, and a command where an order stands."""
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            self.link.heard_s = self.now_s
            self.state.receive("speed", Twist(speed_mps=6.0, yaw_rate_radps=None), self.now_s)
            if self.steering is not None:
                self.state.receive("steering", self.steering, self.now_s)
            try:
                self.state.slow(self.tick())
            except RuntimeError:
                assert "snapshot" in self.fails
            self.slowing.sender.send_safely()

    def execute(self, kind: str) -> None:
        self.slowing.execute(commands.read({"kind": kind}), by="Ann")  # type: ignore[arg-type]

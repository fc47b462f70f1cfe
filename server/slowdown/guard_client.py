"""The guard on the car, where there is one: its state, the heartbeat that keeps it calm, and its release."""

from __future__ import annotations

import json
from typing import Any, get_args

from server.protocol.slow_down_state import GuardPhase, GuardState
from server.rosbridge.live_source import LinkDown
from server.rosbridge.outgoing import NotAllowed
from server.slowdown.command_target import GUARD_HEARTBEAT, GUARD_RELEASE, GUARD_STATE
from server.slowdown.publisher import CommandPublisher

UINT32 = "std_msgs/UInt32"
END_OF_MONITORING = 0  # instead of a count
SILENT_S = 1.0  # the guard publishes 5 times a second
SICK_S = 0.25  # after a tick later than this no heartbeat is sent: it would confirm a server that is not well
STATES: tuple[GuardPhase, ...] = get_args(GuardPhase)
LONGEST_WHY = 120


class GuardClient:
    """The client of one vehicle's guard: its state as last received, and the heartbeats to it."""

    PERIOD_S = 0.2

    def __init__(self, publisher: CommandPublisher) -> None:
        self._publisher = publisher
        self._is_there = False
        self._count = 0
        self._ticked_s: float | None = None
        self._state: GuardPhase | None = None
        self._why = ""
        self._hold = 0
        self._received_s: float | None = None
        self._has_sent = False

    def tick(self, is_there: bool, now_s: float) -> None:
        """The session has judged: it is healthy at this moment."""
        self._is_there = is_there
        self._ticked_s = now_s

    def receive(self, topic: str, message: Any, now_s: float) -> bool:
        """A message of the guard's own topic; whether it was one."""
        if topic != GUARD_STATE:
            return False
        report = _report(message)
        if report is not None and report.get("state") in STATES:
            self._state = report["state"]
            self._why = str(report.get("why") or "")[:LONGEST_WHY]
            hold = report.get("hold")
            self._hold = hold if type(hold) is int and 0 <= hold < 2**32 else 0
            self._received_s = now_s
        return True

    def send_heartbeat(self, now_s: float) -> None:
        """One heartbeat, if the session has judged lately."""
        if not self._is_there or self._ticked_s is None or now_s - self._ticked_s > SICK_S:
            return
        self._count = self._count % (2**32 - 1) + 1
        self._has_sent = self._publish(GUARD_HEARTBEAT, self._count) or self._has_sent

    def end(self) -> bool:
        """Inform the guard of an intended end of monitoring, so that it does not slow the car. Return if sent."""
        is_sent = self._has_sent and self._publish(GUARD_HEARTBEAT, END_OF_MONITORING)
        self._is_there, self._has_sent, self._state, self._received_s = False, False, None, None
        return is_sent

    def release(self, hold: int | None = None) -> None:
        """Release the car to its controllers; None: release the current hold."""
        if self._is_there:
            self._publish(GUARD_RELEASE, self._hold if hold is None else hold)

    @property
    def holds(self) -> bool:
        return self._state in ("operator", "slowing", "holding")

    def frame(self, now_s: float) -> GuardState | None:
        """The `guard` of `decelerate`; None: there is none, or it is silent."""
        if not self._is_there or self._state is None or self._received_s is None or now_s - self._received_s > SILENT_S:
            return None
        return {
            "state": self._state,
            "why": self._why,
            "hold": self._hold,
            "age_s": round(max(0.0, now_s - self._received_s), 2),
        }

    def _publish(self, topic: str, number: int) -> bool:
        try:
            self._publisher.publish(topic, UINT32, {"data": number})
        except (LinkDown, NotAllowed):
            return False
        return True


def _report(message: Any) -> dict[str, Any] | None:
    """The state of the guard: JSON in a std_msgs/String."""
    try:
        found = json.loads(message["data"])
    except (TypeError, ValueError, KeyError):
        return None
    return found if isinstance(found, dict) else None

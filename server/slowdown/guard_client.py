"""The guard on the car, where there is one: heard, kept alive by a heartbeat, released when the operator releases."""

from __future__ import annotations

import json
from typing import Any

from server.protocol import serialize
from server.rosbridge.link import LinkDown
from server.rosbridge.outgoing import NotAllowed
from server.slowdown.command_target import GUARD_HEARTBEAT, GUARD_RELEASE, GUARD_STATE
from server.slowdown.publisher import Mouth

UINT32 = "std_msgs/UInt32"
FAREWELL = 0
SILENT_S = 1.0  # the guard speaks 5 times a second
SICK_S = 0.25  # a tick later than this, and the heart skips: a heartbeat from a sick server is a lie
STATES = ("unguarded", "guarded", "operator", "slowing", "holding")
LONGEST_WHY = 120


class GuardWatch:
    """One vehicle's guard, as this server knows it."""

    PERIOD_S = 0.2

    def __init__(self, mouth: Mouth) -> None:
        self._mouth = mouth
        self._is_there = False
        self._count = 0
        self._ticked_s: float | None = None
        self._state: str | None = None
        self._why = ""
        self._hold = 0
        self._heard_s: float | None = None
        self._has_beaten = False

    def tick(self, is_there: bool, now_s: float) -> None:
        """The session has judged: it is healthy at this moment."""
        self._is_there = is_there
        self._ticked_s = now_s

    def heard(self, topic: str, said: Any, now_s: float) -> bool:
        """A message of the guard's own topic; whether it was one."""
        if topic != GUARD_STATE:
            return False
        report = _report(said)
        if report is not None and report.get("state") in STATES:
            self._state = report["state"]
            self._why = str(report.get("why") or "")[:LONGEST_WHY]
            hold = report.get("hold")
            self._hold = hold if type(hold) is int and 0 <= hold < 2**32 else 0
            self._heard_s = now_s
        return True

    def beat(self, now_s: float) -> None:
        """One beat, if the judge has judged lately."""
        if not self._is_there or self._ticked_s is None or now_s - self._ticked_s > SICK_S:
            return
        self._count = self._count % (2**32 - 1) + 1
        self._has_beaten = self._say(GUARD_HEARTBEAT, self._count) or self._has_beaten

    def farewell(self) -> bool:
        """Monitoring ends on purpose: the guard is not to slow the car for it. Whether there was somebody to tell."""
        said = self._has_beaten and self._say(GUARD_HEARTBEAT, FAREWELL)
        self._is_there, self._has_beaten, self._state, self._heard_s = False, False, None, None
        return said

    def release(self, hold: int | None = None) -> None:
        """The operator lets the controllers drive again; None: of the hold that stands."""
        if self._is_there:
            self._say(GUARD_RELEASE, self._hold if hold is None else hold)

    @property
    def holds(self) -> bool:
        return self._state in ("operator", "slowing", "holding")

    def frame(self, now_s: float) -> dict[str, Any] | None:
        """The `guard` of `decelerate`; None: there is none, or it is silent."""
        if not self._is_there or self._heard_s is None or now_s - self._heard_s > SILENT_S:
            return None
        return {
            "state": self._state,
            "why": self._why,
            "hold": self._hold,
            "age_s": serialize.plain(max(0.0, now_s - self._heard_s), 2),
        }

    def _say(self, topic: str, number: int) -> bool:
        try:
            self._mouth.publish(topic, UINT32, {"data": number})
        except (LinkDown, NotAllowed):
            return False
        return True


def _report(said: Any) -> dict[str, Any] | None:
    """What the guard says of itself: JSON in a std_msgs/String."""
    try:
        found = json.loads(said["data"])
    except (TypeError, ValueError, KeyError):
        return None
    return found if isinstance(found, dict) else None

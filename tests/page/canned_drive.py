"""A drive of eight and a half minutes and on, for the page's chart: with alarms, a lost link and a silent signal."""

from __future__ import annotations

import math
import time
from typing import Any

from monitor.alarm import AlarmMark
from monitor.alarm_spec import Priority
from monitor.catalog import AllLimits, changed
from monitor.drive_trends import DriveTrends
from server.protocol.drive_trends import DriveFacts, DriveTrendsAnswer, Wanted, answer

BEFORE_S = 512.0
LOST_S = (260.0, 275.0)  # the link
SILENT_S = (410.0, 420.0)  # the distance
ALARMS = (
    (190.0, "Gps quality unknown", Priority.WARNING),
    (262.0, "Connection lost", Priority.CRITICAL),
    (380.0, "Car not moving", Priority.ADVISORY),
    (455.0, "Scan slower than expected", Priority.WARNING),
    (488.0, "Speed above limit", Priority.CRITICAL),
)


def numbers(at_s: float) -> dict[str, float]:
    noise = math.sin(7.1 * at_s) * 0.6 + math.sin(3.3 * at_s) * 0.4
    return {
        "speed": 5.0 + 1.6 * math.sin(at_s / 60) + 0.12 * noise,
        "acceleration": 0.3 + 0.25 * noise,
        "brake": max(0.0, 20 * math.sin(at_s / 50 + 2) - 8),
        "accelerator": max(0.0, 14 + 9 * math.sin(at_s / 16)),
        "steering": 20 * math.sin(at_s / 40) + 3 * noise,
        "distance": 9.5 + 3.2 * math.sin(at_s / 47) + 0.2 * noise,
        "bearing": 0.1 * math.sin(at_s / 30),
        "heading": (87 + at_s / 5) % 360,
        "position": 748.3 + 2 * math.sin(at_s / 200),
    }


class CannedDrive:
    """It began `BEFORE_S` before it was made."""

    def __init__(self, length_s: float | None = None) -> None:
        """`length_s`: of a recording, which does not go on."""
        self._began_s = time.monotonic() - BEFORE_S
        self._length_s = length_s
        self._trends = DriveTrends(0.0)
        self._trends.set_limits(changed(AllLimits(), {"obstacle.standoff_m": 5.0}), 0.0)
        self._steps = 0

    def answer(self, query: dict[str, Any]) -> DriveTrendsAnswer:
        now_s = time.monotonic() - self._began_s if self._length_s is None else self._length_s
        while self._steps < now_s * 5:
            self._note(self._steps / 5)
            self._steps += 1
        marks = [
            AlarmMark(at_s=at_s, alarm=f"alarm{i}", title=title, priority=priority)
            for i, (at_s, title, priority) in enumerate(ALARMS)
        ]
        facts = DriveFacts(now_s=now_s, start_ms=round((time.time() - now_s) * 1000), length_s=now_s, marks=marks)
        to_s = query.get("to_s")
        wanted = Wanted(
            signals=tuple(query.get("signals", "speed").split(",")),
            from_s=float(query.get("from_s", 0)),
            to_s=math.inf if to_s is None else float(to_s),
            buckets=int(query.get("buckets", 300)),
        )
        return answer(self._trends, wanted, facts)

    def _note(self, at_s: float) -> None:
        if LOST_S[0] <= at_s < LOST_S[1]:
            return
        if at_s - self._trends._received_s > 1.0:
            self._trends._blind.add(self._trends._received_s, at_s)
        self._trends._received_s = at_s
        for name, number in numbers(at_s).items():
            if name != "distance" or not SILENT_S[0] <= at_s < SILENT_S[1]:
                self._trends._lines[name].note(number, at_s, 1.0)

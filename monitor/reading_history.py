"""The recent values of a signal, for the closing speed of an object."""

from __future__ import annotations

from collections import deque
from typing import Any

from monitor.reading import Reading

BEFORE_S = 0.4  # long enough to distinguish a walking person from noise, short enough for a braking car
AT_MOST_S = 1.2


class ReadingHistory:
    """The last second of one signal's readings; bounded by time and number."""

    __slots__ = ("_readings", "before")

    def __init__(self) -> None:
        self._readings: deque[Reading[Any]] = deque(maxlen=256)
        # The newest reading at least 0.4 s older than the latest one; None where there is none within 1.2 s.
        self.before: Reading[Any] | None = None

    def add(self, reading: Reading[Any]) -> None:
        readings, at_s = self._readings, reading.received_s
        if readings and at_s < readings[-1].received_s:
            readings.clear()  # the clock went back
        readings.append(reading)
        # The oldest that is kept is the one to compare with: drop it when the next is old enough too.
        while len(readings) > 1 and at_s - readings[1].received_s >= BEFORE_S:
            readings.popleft()
        oldest = readings[0]
        self.before = oldest if BEFORE_S <= at_s - oldest.received_s <= AT_MOST_S else None

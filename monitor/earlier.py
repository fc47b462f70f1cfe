"""What a signal said a moment ago, so that a check can tell at which speed something comes nearer."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from monitor.state import Reading

BEFORE_S = 0.4  # long enough to tell a walking person from noise, short enough for a car that brakes
AT_MOST_S = 1.2


class Earlier:
    """The last second of one signal's readings; bounded by time and number."""

    def __init__(self) -> None:
        self._readings: deque[Reading[Any]] = deque(maxlen=256)

    def add(self, reading: Reading[Any]) -> None:
        readings = self._readings
        if readings and reading.received_s < readings[-1].received_s:
            readings.clear()  # the clock went back
        readings.append(reading)
        # The oldest that is kept is the one to compare with: drop it when the next is old enough too.
        while len(readings) > 1 and reading.received_s - readings[1].received_s >= BEFORE_S:
            readings.popleft()

    @property
    def before(self) -> Reading[Any] | None:
        """The newest reading at least 0.4 s older than the latest one; None where there is none within 1.2 s."""
        if len(self._readings) < 2:
            return None
        age_s = self._readings[-1].received_s - self._readings[0].received_s
        return self._readings[0] if BEFORE_S <= age_s <= AT_MOST_S else None

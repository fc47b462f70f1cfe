"""The clock of a recording: the time of day at its beginning, and from then on the time that passes.

The server's clock may be set while a recording is written. Its messages and entries go on as before, whatever the time
of day is then, and entries that carry a time of day are corrected.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

STEP_MS = 1000  # a smaller difference is not corrected: clocks are slewed
NEAR_MS = 86_400_000  # times of day in an entry are of about now


class RecordingClock:
    """Of one vehicle. `now` is a monotonic clock [s], `wall_ms` the time of day [ms since 1970]."""

    def __init__(self, now: Callable[[], float], wall_ms: Callable[[], int]) -> None:
        self._now = now
        self._wall_ms = wall_ms
        self._anchor = (0.0, 0)  # a moment of `now`, and the time of day then [ns]

    def start(self) -> None:
        """A recording begins."""
        self._anchor = self._now(), self._wall_ms() * 1_000_000

    def ns(self, now_s: float) -> int:
        """The time of a moment of `now`, since 1970."""
        since_s, since_ns = self._anchor
        return since_ns + round((now_s - since_s) * 1e9)

    def ms(self) -> int:
        """The time now, since 1970."""
        return self.ns(self._now()) // 1_000_000

    def shift_ms(self) -> int:
        """What is added to a time of day to make it a time of the recording."""
        by_ms = self.ms() - self._wall_ms()
        return by_ms if abs(by_ms) > STEP_MS else 0

    def moment_ms(self, at_ms: float) -> float:
        """The time of the recording for a time of day of about now; others are of before the clock was set."""
        return at_ms + self.shift_ms() if abs(at_ms - self._wall_ms()) < NEAR_MS else at_ms

    def entry(self, said: Mapping[str, Any]) -> Mapping[str, Any]:
        """An entry with the times of day in it (`…_ms`) as times of the recording."""
        return self._corrected(said) if self.shift_ms() else said

    def _corrected(self, said: Mapping[str, Any]) -> dict[str, Any]:
        found = dict(said)
        for name, value in said.items():
            if isinstance(value, Mapping):
                found[name] = self._corrected(value)
            elif name.endswith("_ms") and isinstance(value, int | float) and not isinstance(value, bool):
                found[name] = self.moment_ms(value)
        return found

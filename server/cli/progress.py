"""A line on a terminal that tells how far a long job has come."""

from __future__ import annotations

import sys
import time
from typing import TextIO

FIRST_AFTER_S = 0.5  # a short job ends before anybody wonders
EVERY_S = 0.1
_WIDTH = 30


class Progress:
    """Writes only to a terminal, and wipes its line in the end."""

    def __init__(
        self, begin_s: float, end_s: float, what: str, stream: TextIO | None = None, *, in_seconds: bool = True
    ) -> None:
        """From which to which second of the recording the job goes, or of what else it counts."""
        self._in_seconds = in_seconds
        self._begin_s, self._end_s, self._what = begin_s, end_s, what
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream is not None and self._stream.isatty()  # None: it was closed
        self._started_s = time.monotonic()
        self._next_s = self._started_s + FIRST_AFTER_S
        self._shown = False

    def __call__(self, at_s: float) -> None:
        """The job has come to this second."""
        if not self._is_terminal or time.monotonic() < self._next_s:
            return
        now_s = time.monotonic()
        self._next_s = now_s + EVERY_S
        self._shown = True
        part = min(1.0, max(0.0, (at_s - self._begin_s) / max(self._end_s - self._begin_s, 1e-9)))
        done = round(part * _WIDTH)
        speed = (at_s - self._begin_s) / max(now_s - self._started_s, 1e-9)
        pace = f"  {at_s:.0f} s, {speed:.0f} × real time" if self._in_seconds else ""
        bar = "█" * done + "·" * (_WIDTH - done)
        self._stream.write(f"\r{self._what} {bar} {part * 100:3.0f} %{pace}\x1b[K")
        self._stream.flush()

    def close(self) -> None:
        if self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()

"""A line on a terminal that shows the progress of a long job."""

from __future__ import annotations

import sys
import time

FIRST_AFTER_S = 0.5  # a short job shows nothing
EVERY_S = 0.1
_WIDTH = 30


class Progress:
    """Writes only to a terminal, and wipes its line in the end."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._stream = sys.stderr  # None: it was closed
        self._is_terminal = self._stream is not None and self._stream.isatty()
        self._started_s = time.monotonic()
        self._next_s = self._started_s + FIRST_AFTER_S
        self._shown = False

    def __call__(self, part: float, judged_s: float | None = None) -> None:
        """Show which part of the job is done, from 0 to 1, and how many seconds of recordings were judged."""
        if not self._is_terminal or time.monotonic() < self._next_s:
            return
        now_s = time.monotonic()
        self._next_s = now_s + EVERY_S
        self._shown = True
        part = min(1.0, max(0.0, part))
        done = round(part * _WIDTH)
        pace = ""
        if judged_s is not None:
            pace = f"  {judged_s:.0f} s, {judged_s / max(now_s - self._started_s, 1e-9):.0f} × real time"
        bar = "█" * done + "·" * (_WIDTH - done)
        self._stream.write(f"\r{self._what} {bar} {part * 100:3.0f} %{pace}\x1b[K")
        self._stream.flush()

    def close(self) -> None:
        if self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()

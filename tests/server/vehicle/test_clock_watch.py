"""The server's clock is set during a drive: one event reports it."""

from __future__ import annotations

from typing import Any

import pytest

from server.vehicle.tick_parts import ClockWatch


class Log:
    def __init__(self) -> None:
        self.notes: list[tuple[str, str]] = []

    def note(self, change: str, text: str, **_: Any) -> None:
        self.notes.append((change, text))


@pytest.mark.parametrize(
    ("by_ms", "how"),
    [(230 * 86_400_000, "ahead by 230 days, or it was suspended"), (-5000, "back by 5 s"), (400, None)],
)
def test_a_step_is_noted_once(by_ms: int, how: str | None) -> None:
    log, wall_ms = Log(), [1_790_000_000_000]
    watch = ClockWatch(log, wall_ms=lambda: wall_ms[0])  # type: ignore[arg-type]
    for number in range(20):
        wall_ms[0] += 50 + (by_ms if number == 10 else 0)
        watch.tick(5.0 + number * 0.05)
    notes = [] if how is None else [("clock_set", f"The server's clock was set {how}: ages are not changed by it.")]
    assert log.notes == notes

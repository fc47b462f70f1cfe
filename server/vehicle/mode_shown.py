"""The mode of a state where only one moment is known, as in a replay."""

from __future__ import annotations

from typing import Any

from monitor.driving_mode import meaning
from monitor.reading import Reading
from monitor.values import DriveMode, Mode
from server.judge.topics import Source
from server.protocol.driving_state import ModeState, WhyUnknown


def mode_shown(reading: Reading[DriveMode] | None, source: Source | None, limits: Any, now_s: float) -> ModeState:
    """`limits`: those of the group `driving`; times on the clock of the reading."""
    mode: Mode = "unknown"
    why: WhyUnknown | None = "no_source" if source is None else "silent"
    if reading is not None and (reading.is_fresh(now_s) or 0.0 <= now_s - reading.received_s <= limits.holds_s):
        mode = meaning(reading.value, limits)
        why = "unclear" if mode == "unknown" else None
    return {
        "mode": mode,
        "why": why,
        "since_ms": None,
        "way_m": None,
        "source": source.topic if source is not None else "",
        "open": [],
    }

"""A drive of eight hours, from its file to the chart: the sketch at once, every part in time, small, with its gap."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import orjson
import pytest

from server.recording.catalog.survey import survey
from server.recording.read.read import open_recording
from server.replay.playback import Playback
from tests.page import drives

HOUR_S = 3600.0
LOST_S = (5000.0, 5060.0)
REQUEST: dict[str, Any] = {
    "kind": "drive_trends",
    "signals": ["speed", "distance", "brake", "steering"],
    "buckets": 500,
}


@pytest.mark.field
@pytest.mark.parametrize(
    "hours",
    [
        pytest.param(0.05, marks=pytest.mark.slow),
        pytest.param(8.0, marks=[pytest.mark.soak, pytest.mark.timeout(3600)]),
    ],
)
def test_a_long_drive_opens_in_the_chart_within_0_3_s_and_60_kB(
    hours: float, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    lost_s = (LOST_S[0] * hours / 8, LOST_S[0] * hours / 8 + 60)

    def speed(t: float) -> Any:
        peak = abs(t - 0.7 * hours * HOUR_S) < 0.5
        return None if lost_s[0] <= t < lost_s[1] else drives.twist(14.0 if peak else 6.0 + math.sin(t / 40))

    path = drives.write(tmp_path / "long.bag", {"speed": speed}, seconds=hours * HOUR_S)
    sketch = survey(path)["trends"]
    playback = Playback(open_recording([path]), lambda: open_recording([path]), settings="", now_s=0.0, trends=sketch)
    began_s = time.monotonic()
    whole = playback.answer(REQUEST)
    took_s, size = time.monotonic() - began_s, len(orjson.dumps(whole))
    assert whole["is_sketch"]
    assert found(whole, lost_s)
    playback.index.work(lambda: False)
    for part in ({}, {"from_s": max(0.0, lost_s[0] - 180), "to_s": lost_s[0] + 180}):
        began_s = time.monotonic()
        read = playback.answer({**REQUEST, **part})
        took_s, size = max(took_s, time.monotonic() - began_s), max(size, len(orjson.dumps(read)))
        assert not read["is_sketch"]
        assert part or found(read, lost_s)
        assert any(abs(a - lost_s[0]) < 1.0 and abs(b - lost_s[1]) < 1.0 for a, b in read["blind"])
    playback.close()
    record_property("longest answer [ms]", round(1000 * took_s, 1))
    record_property("largest answer [kB]", round(size / 1000, 1))
    assert took_s <= 0.3
    assert size <= 60_000


def found(answer: Any, lost_s: tuple[float, float]) -> bool:
    """One second of its highest speed, and the time without a message."""
    highest = [high for high in answer["signals"]["speed"]["highest"] if high is not None]
    return max(highest) == 14.0 and any(a <= lost_s[0] + 1 and b >= lost_s[1] - 1 for a, b in answer["blind"])

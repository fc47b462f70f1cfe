"""How the server's memory grows while a car is recorded and pages look on."""

from __future__ import annotations

import statistics
import time

from tests.bench.rig import Rig
from tests.bench.table import Group, Row

PAGES = 20
SAMPLES = 40
MOST_MB_AN_HOUR = 1.0


def measure(rig: Rig) -> Group:
    """The slope of the server's own memory after it has warmed up."""
    with rig.pages(PAGES, scan=True):
        time.sleep(rig.pace.warm_s)
        began_s = time.monotonic()
        samples: list[tuple[float, float]] = []
        for _ in range(SAMPLES):
            samples.append((time.monotonic() - began_s, rig.server.memory_mb()))
            time.sleep(rig.pace.memory_s / SAMPLES)
    rows = (
        Row(what="growth", unit="MB/h", catgraph=growth_mb_an_hour(samples), reach=MOST_MB_AN_HOUR),
        Row(what="of its own (USS)", unit="MB", catgraph=samples[-1][1], digits=1),
    )
    return Group(
        name="memory",
        title=f"Memory of the server, {PAGES} pages, recording, full car load",
        rows=rows,
        notes=(f"slope over {rig.pace.memory_s:g} s, {rig.pace.warm_s:g} s after the pages came",),
    )


def growth_mb_an_hour(samples: list[tuple[float, float]]) -> float:
    """The slope of the line through samples of (seconds, MB): the median of all pairs' slopes, deaf to single steps."""
    slopes = [(b - a) / (t - s) for n, (s, a) in enumerate(samples) for t, b in samples[n + 1 :] if t > s]
    return statistics.median(slopes) * 3600.0

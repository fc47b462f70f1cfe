"""How long an alarm takes from the bridge to the viewers, and whether viewers that do not read delay the others."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from tests.bench.child import Child, Failed
from tests.bench.rig import Rig
from tests.bench.table import Group, Row

STALLED = 2
LAST_ALARM_S = 0.5


def measure_one(rig: Rig) -> Group:
    """One viewer: a page, and a client on the bridge."""
    with rig.pages(1) as pages:
        ours, _ = series(rig, pages)
    with rig.direct() as direct:
        floor, _ = series(rig, direct)
    rows = [
        Row(what=f"alarm to one viewer, {name}", unit="ms", catgraph=a, floor=b, today=b, reach=reach, digits=2)
        for name, a, b, reach in zip(("p50", "p99", "max"), spread(ours), spread(floor), (2, 10, None), strict=True)
    ]
    rate = rig.car.hello["messages_per_s"]
    return Group(
        name="latency",
        title=f"Message on the bridge → alarm at the viewer, full car load ({rate:.0f} messages a second)",
        rows=tuple(rows),
        notes=(f"{len(ours)} speeds above the limit at random moments; the alarm's own delays set to 0",),
    )


def measure_crowd(rig: Rig) -> Group:
    """Many viewers beside two that read nothing."""
    crowd = rig.pace.crowd
    with rig.pages(crowd, stalled=STALLED) as pages:
        ours, report = series(rig, pages)
    with rig.direct(draining=crowd - 1, stalled=STALLED) as direct:
        today, _ = series(rig, direct)
    reaches = (None, 50, None)
    rows = [
        Row(what=f"alarm to {crowd} viewers, {name}", unit="ms", catgraph=a, today=b, reach=reach)
        for name, a, b, reach in zip(("p50", "p99", "max"), spread(ours), spread(today), reaches, strict=True)
    ]
    rows.append(Row(what="longest silence of a page", unit="s", catgraph=report["longest_silence_s"], reach=0.2))
    return Group(
        name="crowd",
        title=f"The same for {crowd} viewers beside {STALLED} that stopped reading",
        rows=tuple(rows),
        notes=(
            f"today: one JSON connection to the bridge each; one of the {crowd} decodes and is timed, the others drain",
        ),
    )


def series(rig: Rig, viewers: Child) -> tuple[list[float], dict[str, Any]]:
    """Latencies of all probes to all viewers [ms], and the viewers' report."""
    viewers.ask("begin")
    sent = rig.car.ask("probe", count=rig.pace.probes, every_s=rig.pace.probe_every_s)
    time.sleep(LAST_ALARM_S)
    report = viewers.ask("report")
    return [ms for alarms in report["alarms"] for ms in latencies_ms(sent, alarms)], report


def latencies_ms(sent: Sequence[Sequence[float]], alarms: Sequence[Sequence[Any]]) -> list[float]:
    """Matches alarms with probes by order; the speed in each shows that the order is right."""
    speeds = [float(str(text).split()[0]) for text, _ in alarms]
    if len(alarms) != len(sent) or any(abs(a - b[0]) > 0.05 for a, b in zip(speeds, sent, strict=True)):
        raise Failed(f"{len(sent)} speeds above the limit were sent, and the alarms that came are others: {speeds}")
    return [(at_ns - sent_ns) / 1e6 for (_, at_ns), (_, sent_ns) in zip(alarms, sent, strict=True)]


def spread(latencies_ms: Sequence[float]) -> tuple[float, float, float]:
    """Median, 99th percentile and maximum."""
    ordered = sorted(latencies_ms)
    return ordered[len(ordered) // 2], ordered[math.ceil(0.99 * len(ordered)) - 1], ordered[-1]

"""How soon a slow-down reaches the car, and how evenly its commands come, with many pages looking on."""

from __future__ import annotations

import itertools
import math
import random
import time
from collections.abc import Sequence

import orjson
from websockets.sync.client import ClientConnection, connect

from tests.bench.child import Failed
from tests.bench.rig import Rig
from tests.bench.table import Group, Row

PERIOD_MS = 50.0
SHORT_S = 0.12  # an order that is only timed is looked at, and released, after so long
PATIENCE_S = 5.0
METRONOME = "/bench/metronome"


def measure(rig: Rig) -> Group:
    """Taps on one page beside many others, at random moments; then one order held, and its gaps."""
    many, taps = rig.pace.many, max(10, rig.pace.probes // 4)
    moments = random.Random(2)
    delays_ms = []
    with rig.pages(many), connect(rig.server.hello["url"]) as page:
        _arm(rig)
        for _ in range(taps):
            rig.car.ask("commanded")
            time.sleep(moments.uniform(0.02, 0.08))
            sent_ns = _slow(page)
            arrived = _arrived(rig)
            delays_ms.append((arrived[0][0] - sent_ns) / 1e6)
            _release(rig)
        rig.car.ask("commanded")
        with rig.direct(watching=0) as bare:
            _slow(page)
            bare.ask(
                "metronome",
                url=rig.car.hello["url"],
                topic=METRONOME,
                seconds=rig.pace.load_s,
                period_s=PERIOD_MS / 1000,
            )
        arrived_ns = [at_ns for at_ns, _ in rig.car.ask("commanded")]
        _release(rig)
    offs_ms = _offs_ms(arrived_ns)
    bare_ms = _offs_ms([at_ns for at_ns, _ in rig.car.ask("commanded", topic=METRONOME)])
    rate_hz = (len(arrived_ns) - 1) / (arrived_ns[-1] - arrived_ns[0]) * 1e9
    rows = (
        Row(what="tap → first command, p50", unit="ms", catgraph=_share(delays_ms, 0.5), digits=1),
        Row(what="tap → first command, p99", unit="ms", catgraph=_share(delays_ms, 0.99), reach=20, digits=1),
        Row(what="commands", unit="Hz", catgraph=rate_hz, digits=2),
        Row(
            what="off 50 ms between commands, p99",
            unit="ms",
            catgraph=_share(offs_ms, 0.99),
            floor=_share(bare_ms, 0.99),
            reach=2,
            digits=2,
        ),
        Row(what="off 50 ms between commands, max", unit="ms", catgraph=max(offs_ms), floor=max(bare_ms), digits=1),
    )
    return Group(
        name="slow-down",
        title=f"Slow-down at the car's bridge, full car load, {many} pages",
        rows=rows,
        notes=(
            f"{taps} taps; {len(arrived_ns)} commands of one order",
            "floor: a bare client that does nothing but speak 20 times a second, at the same time",
        ),
    )


def _offs_ms(arrived_ns: Sequence[int]) -> list[float]:
    return [abs((b - a) / 1e6 - PERIOD_MS) for a, b in itertools.pairwise(arrived_ns)]


def _arm(rig: Rig) -> None:
    ends_s = time.monotonic() + PATIENCE_S
    while not rig.server.ask("command", kind="arm").get("ok"):
        if time.monotonic() > ends_s:
            raise Failed("slow-down cannot be armed")
        time.sleep(0.1)


def _slow(page: ClientConnection) -> int:
    """Orders as a page does; when [ns, CLOCK_MONOTONIC]."""
    sent_ns = time.monotonic_ns()
    page.send(orjson.dumps({"kind": "slow_down", "id": "tap"}).decode())
    return sent_ns


def _arrived(rig: Rig) -> list[tuple[int, float]]:
    """The first commands that came."""
    ends_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends_s:
        time.sleep(SHORT_S)
        arrived: list[tuple[int, float]] = rig.car.ask("commanded")
        if arrived:
            return arrived
    raise Failed("a slow-down was ordered, and no command came to the car")


def _release(rig: Rig) -> None:
    order = rig.server.ask("command", kind="state")["decelerate"]["order"]
    rig.server.ask("command", kind="release", number=order["number"])


def _share(values: Sequence[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[math.ceil(share * len(ordered)) - 1]

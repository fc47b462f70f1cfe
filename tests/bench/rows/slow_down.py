"""How soon a slow-down reaches the car, and how evenly its commands come, with many pages looking on."""

from __future__ import annotations

import itertools
import math
import random
import time
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import urlsplit

import orjson
from websockets.sync.client import ClientConnection, connect

from server.simulator.messages import CMD_VEL
from tests.bench.child import Child, Failed
from tests.bench.rig import Rig
from tests.bench.table import Group, Row
from tests.bench.wire import Wire

PERIOD_MS = 50.0
SHORT_S = 0.12  # an order that is only timed is looked at, and released, after so long
PATIENCE_S = 5.0
METRONOME = "/bench/metronome"


def measure(rig: Rig) -> Group:
    """Taps on one page beside many others, at random moments; then orders held, and their gaps."""
    many, taps = rig.pace.many, max(10, rig.pace.probes // 4)
    moments = random.Random(2)
    delays_ms = []
    with rig.pages(many):
        _arm(rig)
        with connect(rig.server.hello["url"]) as page:
            for _ in range(taps):
                rig.car.ask("commanded")
                time.sleep(moments.uniform(0.02, 0.08))
                sent_ns = _slow(page)
                arrived = _arrived(rig)
                delays_ms.append((arrived[0][0] - sent_ns) / 1e6)
                _release(rig)
        with rig.direct(watching=0) as bare:
            read = _held(rig, bare)
            with rig.apart():
                apart = _held(rig, bare)
    rows = [
        Row(what="tap → first command, p50", unit="ms", catgraph=_share(delays_ms, 0.5), digits=1),
        Row(what="tap → first command, p99", unit="ms", catgraph=_share(delays_ms, 0.99), reach=20, digits=1),
        Row(what="commands", unit="Hz", catgraph=read.rate_hz, digits=2),
        *_evenness("all on the same processors", read),
        *_evenness("the server on one of its own", apart),
    ]
    return Group(
        name="slow-down",
        title=f"Slow-down at the car's bridge, full car load, {many} pages",
        rows=tuple(rows),
        notes=(
            f"{taps} taps; {len(read.ours_ms)} commands of one order",
            "floor: a bare client that does nothing but speak 20 times a second, at the same time",
            f"off 50 ms: between commands as {read.seen}",
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """An order that was held for a while."""

    rate_hz: float
    ours_ms: list[float]  # by how much each gap between commands was off
    bare_ms: list[float]  # the same of a bare client
    seen: str  # where they were timed


def _held(rig: Rig, bare: Child) -> Held:
    url = rig.car.hello["url"]
    try:
        wire = Wire(urlsplit(url).port or 0)
    except PermissionError:
        wire = None
    rig.car.ask("commanded")
    rig.car.ask("commanded", topic=METRONOME)
    try:
        with connect(rig.server.hello["url"]) as page:  # one that has not read for long is let go
            _slow(page)
        bare.ask("metronome", url=url, topic=METRONOME, seconds=rig.pace.held_s, period_s=PERIOD_MS / 1000)
    finally:
        if wire is not None:
            wire.stop()
    read, spoken = (
        [at_ns for at_ns, _ in rig.car.ask("commanded", topic=topic)] for topic in (CMD_VEL.topic, METRONOME)
    )
    _release(rig)
    ours, theirs = (read, spoken) if wire is None else (wire.published(CMD_VEL.topic), wire.published(METRONOME))
    if len(ours) < 2 or len(theirs) < 2:
        raise Failed("an order was held, and its commands were not seen")
    return Held(
        rate_hz=(len(ours) - 1) / (ours[-1] - ours[0]) * 1e9,
        ours_ms=_offs_ms(ours),
        bare_ms=_offs_ms(theirs),
        seen="the bridge reads them" if wire is None else "they come to the bridge's port, by the kernel's clock",
    )


def _evenness(where: str, held: Held) -> tuple[Row, Row]:
    ours, bare = held.ours_ms, held.bare_ms
    return (
        Row(
            what=f"off 50 ms, {where}, p99",
            unit="ms",
            catgraph=_share(ours, 0.99),
            floor=_share(bare, 0.99),
            reach=10,
            digits=2,
        ),
        Row(what=f"off 50 ms, {where}, max", unit="ms", catgraph=max(ours), floor=max(bare), digits=1),
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

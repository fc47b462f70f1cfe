"""What may never happen, whatever is lost between pages and a car: a real broker, an agent and two nodes as processes.

While parts are killed and frozen, and the network swallows what is sent, two people give orders through either node,
and two pages look on. A history of all of it is checked in the end.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import random
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets

from tests.server.bus.fleet_parts import FAULTS, NODES, Part, break_once, journal_of, parts, settled
from tests.server.bus.histories import Shown, check_ages, check_events
from tests.server.viewer import viewer

DEADLINE_MS = 3000  # of a request
EVERY_S = 0.15  # between the changes of one person
ROUND_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Order:
    name: str
    sent_ms: float
    status: int | None  # None: no answer


@dataclass
class History:
    """What the people and pages have seen."""

    orders: list[Order] = field(default_factory=list)
    pages: dict[str, Shown] = field(default_factory=dict)  # one at each node


async def person(node: Part, name: str, history: History) -> None:
    """Orders again and again, and notes what came of it: Ann changes a setting, Bo pauses and resumes monitoring."""
    for n in range(10**9):
        order, sent_ms = f"{name} {n}", time.time() * 1000
        status = None
        with contextlib.suppress(httpx.HTTPError):
            async with httpx.AsyncClient(base_url=node.process.address, timeout=6.0) as client:
                options: dict[str, Any] = {"params": {"vehicle": "ocelot"}, "headers": {"x-catgraph-name": order}}
                if name == "Ann":
                    values = {"speed_limit.max_mps": 20 + n % 1000 / 100}
                    answer = await client.patch("/api/settings", json={"values": values}, **options)
                else:
                    answer = await client.post("/api/pause" if n % 2 == 0 else "/api/resume", **options)
                status = answer.status_code
        history.orders.append(Order(name=order, sent_ms=sent_ms, status=status))
        await asyncio.sleep(EVERY_S)


async def page(node: str, part: Part, history: History) -> None:
    """A page at this node, which dials again with the number of the newest event that it has."""
    shown = history.pages[node] = Shown()
    while True:
        with contextlib.suppress(OSError, websockets.WebSocketException, TimeoutError):
            async with viewer(part.process.address, vehicle="ocelot", have_event=shown.have_event) as one:
                while one.socket.state is websockets.State.OPEN:
                    await asyncio.sleep(0.05)
                    events, one.events = one.events, []
                    shown.events += events
                    states, one.states = one.states, []
                    for state in states:
                        shown.add_state(state)
        await asyncio.sleep(0.2)


@pytest.mark.field
@pytest.mark.parametrize(
    "rounds",
    [
        pytest.param(1, marks=[pytest.mark.slow, pytest.mark.timeout(300)]),
        pytest.param(100, marks=[pytest.mark.soak, pytest.mark.timeout(10_800)]),
    ],
)
async def test_nothing_is_lost_doubled_late_or_old(rounds: int, tmp_path: Path) -> None:
    history, lengths = History(), random.Random(20)
    async with parts(tmp_path, needs_network=rounds > 1) as (broker, made):
        await settled(made)
        at_work = [
            asyncio.create_task(person(made[node], name, history))
            for node, name in zip(NODES, ("Ann", "Bo"), strict=True)
        ]
        looking = [asyncio.create_task(page(node, made[node], history)) for node in NODES]
        try:
            for _ in range(rounds):
                for fault in FAULTS:
                    await asyncio.sleep(ROUND_S)
                    swallow_s = 4.0 if rounds == 1 else math.exp(lengths.uniform(0.0, math.log(60.0)))
                    await break_once(fault, broker, made, swallow_s)
                    await settled(made)
            await asyncio.sleep(ROUND_S)
            for task in at_work:
                task.cancel()
            await asyncio.gather(*at_work, return_exceptions=True)
            await asyncio.sleep(2 * ROUND_S)  # what is late would come now
            journal = await journal_of(made["agent"])
            async with asyncio.timeout(20):
                while not all(page.has(journal[-1]["n"]) for page in history.pages.values()):
                    await asyncio.sleep(0.1)
        finally:
            for task in (*at_work, *looking):
                task.cancel()
            await asyncio.gather(*at_work, *looking, return_exceptions=True)
    check(history, journal)


def _by(event: dict[str, Any]) -> str:
    """Who ordered it: these programs sign nothing, and the agent reports it."""
    return str(event["by"]).removesuffix(" (not signed)")


def check(history: History, journal: list[dict[str, Any]]) -> None:
    check_events(journal, history.pages)
    check_ages(journal, history.pages.values())

    # A restarted agent notes once more what paused it, with the time since when.
    ordered = [e for e in journal if e["change"] in ("settings", "paused", "resumed") and e.get("since_ms") is None]
    done = Counter(_by(event) for event in ordered)
    when = {_by(event): event["at_ms"] for event in ordered}
    answers = Counter(order.status for order in history.orders)
    print(f"{len(history.orders)} orders, answers {dict(answers)}, {len(journal)} events")
    assert answers[200] > len(history.orders) / 4
    assert set(answers) <= {200, 503, None}
    for order in history.orders:
        assert done[order.name] <= 1, f"{order} was carried out twice"
        if order.status == 200 and order.name.startswith("Ann"):  # to pause what is paused is nothing
            assert done[order.name] == 1, f"{order} was answered and is not in the log"
        # A setting is accepted in time and may be stored by a slow disk, or after the process was frozen, later.
        if done[order.name] and order.name.startswith("Bo"):
            late_ms = when[order.name] - order.sent_ms
            assert late_ms <= DEADLINE_MS + 100, f"{order} was carried out {late_ms:.0f} ms after it was given"

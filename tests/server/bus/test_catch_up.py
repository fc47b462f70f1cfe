"""A car that was away from the broker for long: all of it reaches a page in order, and live values are not held up."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import websockets

from server.bus.journal import Journal
from tests.page.processes import running, simulate
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import event, until
from tests.server.viewer import Viewer, viewer

AT_ONCE = 1000


@pytest.mark.field
@pytest.mark.parametrize(
    ("events", "within_s", "late_s"),
    [
        pytest.param(20_000, 30, 0.5, marks=pytest.mark.slow),
        pytest.param(10**6, 1800, 0.1, marks=[pytest.mark.soak, pytest.mark.timeout(3600)], id="a week"),
    ],
)
async def test_a_page_of_a_node_catches_up(events: int, within_s: float, late_s: float, tmp_path: Path) -> None:
    data = tmp_path / "ocelot"
    data.mkdir()
    async with running_broker() as broker, running(*simulate()) as car:
        at_broker = ("--broker", broker.address, "--port", "0")
        agent_at = ("agent", *at_broker, "--vehicle", f"ocelot={car.address}", "--data", str(data))
        async with running("web", *at_broker, "--data", str(tmp_path / "node")) as node:
            async with running(*agent_at), viewer(node.address, vehicle="ocelot") as page:
                await page.until(lambda: page.states and page.events, 20)
                have, before = page.events[-1]["n"], page.states[-1]["server"]["boot"]
            last = away(data / "events.sqlite", events)
            numbers: list[int] = []
            ages_s: list[float] = []
            async with running(*agent_at):
                begun_s = time.monotonic()
                # It is disconnected once, when the node learns that the agent has started anew, and dials again.
                while have + len(numbers) <= last or not ages_s:
                    async with viewer(node.address, vehicle="ocelot", have_event=have + len(numbers)) as page:
                        missing = last - have - len(numbers)
                        await until(lambda page=page, missing=missing: is_done(page, missing), within_s)
                        numbers += [one["n"] for one in page.events]
                        ages_s += [
                            got_s - state["server"]["time_ms"] / 1000
                            for got_s, state in zip(page.got_s, page.states, strict=True)
                            if state["server"]["boot"] != before
                        ]
                took_s = time.monotonic() - begun_s
    p99_s = float(np.percentile(ages_s, 99))
    print(f"{len(numbers)} events in {took_s:.1f} s, {len(ages_s)} states, p99 {p99_s * 1000:.0f} ms old")
    assert numbers == list(range(have + 1, have + 1 + len(numbers)))
    assert ages_s
    assert p99_s <= late_s


def is_done(page: Viewer, missing: int) -> bool:
    """It has what it missed, and values, or was sent away."""
    return page.socket.state is websockets.State.CLOSED or (len(page.events) > missing and len(page.states) > 0)


def away(path: Path, events: int) -> int:
    """What the agent noted meanwhile; the number of the last one."""
    journal = Journal(path)
    try:
        for _ in range(0, events, AT_ONCE):
            journal.append("ocelot", [event("raised while away", by=None, settings_version=1)] * AT_ONCE)
            journal.save()
        assert journal.trouble is None
        return journal.last("ocelot")
    finally:
        journal.close()

"""What recording costs the server beyond monitoring, and how much it writes."""

from __future__ import annotations

import statistics
import time
from typing import Any

from tests.bench.rig import Rig
from tests.bench.table import Group, Row

ROUNDS = 3  # on and off in turn, so that whatever else the machine does falls on both


def order(rig: Rig, on: bool) -> None:
    """Has the server record, or not; either may be so already."""
    rig.server.ask("command", kind="record", on=on)


def measure(rig: Rig) -> Group:
    """The server with one page at full car load, with and without recording, in one run."""
    each_s = rig.pace.load_s / 2
    shares: dict[bool, list[float]] = {True: [], False: []}
    written: dict[str, Any] = {}
    with rig.pages(1):
        for _ in range(ROUNDS):
            for on in (True, False):
                order(rig, on)
                time.sleep(rig.pace.settle_s)
                shares[on].append(rig.server.share_of_core(each_s))
                if on:
                    written = rig.server.ask("command", kind="state")["recording"]
    with_it, without = statistics.median(shares[True]), statistics.median(shares[False])
    rows = (
        Row(what="recording, beyond monitoring", unit="% of a core", catgraph=with_it - without, reach=5, digits=1),
        Row(what="monitoring with it", unit="% of a core", catgraph=with_it, digits=1),
        Row(what="monitoring without", unit="% of a core", catgraph=without, digits=1),
        Row(what="written a second", unit="kB", catgraph=written["bytes"] / 1000 / written["for_s"], digits=0),
        Row(what="messages lost", unit="", catgraph=written["dropped"], reach=0, digits=0),
    )
    seconds = (
        f"{ROUNDS} times {each_s:g} s each, in turn; {written['messages'] / written['for_s']:.0f} messages a second"
    )
    return Group(name="recording", title="Recording all topics, full car load, 1 page", rows=rows, notes=(seconds,))

"""What the way through a broker costs: an agent beside the car, a web node for the pages, and a real broker between."""

from __future__ import annotations

import contextlib
import statistics
import time
from collections.abc import Iterator, Sequence

from tests.bench.child import Child
from tests.bench.rig import Rig
from tests.bench.rows import latency
from tests.bench.table import Group, Row

HOP_MS = 3.0  # what the way may add at the 99th percentile


def measure(rig: Rig) -> Group:
    """Alarms to one viewer with and without the broker, in turn; then the processor of each part."""
    load_s, most = rig.pace.load_s, rig.pace.most
    alone, through = [], []
    with fleet(rig) as (broker, agent, node):
        for _ in range(rig.pace.rounds):
            agent.ask("command", kind="disconnect")
            with rig.pages(1) as pages:
                alone.append(latency.spread(latency.series(rig, pages)[0]))
            agent.ask("command", kind="connect", address=rig.car.hello["url"])
            with rig.pages_at(node.hello["url"], 1) as pages:
                through.append(latency.spread(latency.series(rig, pages)[0]))
        with rig.pages_at(node.hello["url"], 1) as pages:
            few = shares(broker, agent, node, load_s)
        with rig.pages_at(node.hello["url"], most) as pages:
            pages.ask("begin")
            many = shares(broker, agent, node, load_s)
            report = pages.ask("report")
        unwatched = shares(broker, agent, node, load_s)
    rows = [
        Row(what=f"alarm to one viewer, {name}", unit="ms", catgraph=a, floor=b)
        for name, a, b in zip(("p50", "p99", "max"), medians(through), medians(alone), strict=True)
    ]
    hop_ms = medians(through)[1] - medians(alone)[1]
    rows.append(Row(what="what the broker adds, p99", unit="ms", catgraph=hop_ms, reach=HOP_MS))
    for pages_, found in (("no page", unwatched), ("1 page", few), (f"{most} pages", many)):
        rows += [
            Row(what=f"{part}, {pages_}", unit="% of a core", catgraph=share, digits=1)
            for part, share in zip(("broker", "agent", "web node"), found, strict=True)
        ]
    each = (many[2] - few[2]) / (most - 1)
    rows.append(Row(what="web node, each further page on Home", unit="% of a core", catgraph=each, reach=0.4))
    states_per_s = sum(report["states"]) / report["seconds"] / most
    return Group(
        name="fleet",
        title="Through a broker, one car at full load",
        rows=tuple(rows),
        notes=(
            f"floor: the same without a broker, in turn: medians of {rig.pace.rounds} series each, as one standstill of"
            f" the machine decides on p99 of a series; each of the {most} pages got {states_per_s:.1f} states a second",
        ),
    )


def medians(spreads: Sequence[Sequence[float]]) -> list[float]:
    """Of the series, of each of their figures."""
    return [statistics.median(figures) for figures in zip(*spreads, strict=True)]


@contextlib.contextmanager
def fleet(rig: Rig) -> Iterator[tuple[Child, Child, Child]]:
    """A broker, an agent that is connected to the car, and a web node that has received from it; each a process."""
    with contextlib.ExitStack() as up:

        def child(module: str, **options: object) -> Child:
            started = Child(module, **options)
            up.callback(started.stop)
            return started

        broker = child("broker")
        agent = child("serving", broker=broker.hello["address"])
        agent.ask("command", kind="connect", address=rig.car.hello["url"])
        node = child("serving", broker=broker.hello["address"], is_node=True)
        time.sleep(max(1.0, rig.pace.settle_s))
        yield broker, agent, node


def shares(broker: Child, agent: Child, node: Child, for_s: float) -> tuple[float, float, float]:
    """Processor time of each over so long, in per cent of one core."""
    used_s, agent_ns, node_ns = broker.ask("used"), agent.ask("cpu"), node.ask("cpu")
    began_ns = time.monotonic_ns()
    time.sleep(for_s)
    took_ns = time.monotonic_ns() - began_ns
    spent_ns = (1e9 * (broker.ask("used") - used_s), agent.ask("cpu") - agent_ns, node.ask("cpu") - node_ns)
    at_broker, at_agent, at_node = (100.0 * one / took_ns for one in spent_ns)
    return at_broker, at_agent, at_node

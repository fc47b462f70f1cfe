"""What the server costs its machine, and where that goes."""

from __future__ import annotations

from typing import Any

from tests.bench.rig import Rig
from tests.bench.rows import recording
from tests.bench.table import Group, Row


def measure(rig: Rig) -> Group:
    """The server with one page and with many, beside a bare client, a bare relay, and the bridge that does it alone."""
    load_s, most = rig.pace.load_s, rig.pace.most
    with rig.pages(1):
        recording.order(rig, False)  # it has rows of its own
        before = rig.server.ask("timings")
        one = rig.server.share_of_core(load_s)
        after = rig.server.ask("timings")
    with rig.pages(most) as pages:
        recording.order(rig, False)
        pages.ask("begin")
        many = rig.server.share_of_core(load_s)
        report = pages.ask("report")
    with rig.direct() as direct:
        client = direct.share_of_core(load_s)
    with rig.relay() as relay, rig.pages_at(relay.hello["url"], most):
        relaying = relay.share_of_core(load_s)
    idle = rig.car.share_of_core(load_s)
    with rig.direct(watching=0, draining=1):
        today_one = rig.car.share_of_core(load_s) - idle
    with rig.direct(watching=0, draining=most):
        today_many = rig.car.share_of_core(load_s) - idle
    states_per_s = sum(report["states"]) / report["seconds"] / most
    rows = (
        Row(what="1 page", unit="% of a core", catgraph=one, floor=client, today=today_one, reach=10, digits=1),
        Row(
            what=f"{most} pages",
            unit="% of a core",
            catgraph=many,
            floor=relaying,
            today=today_many,
            reach=40,
            digits=1,
        ),
        *_inside(before, after),
    )
    return Group(
        name="cpu",
        title="Processor of what serves the viewers, full car load",
        rows=rows,
        notes=(
            f"each of the {most} pages got {states_per_s:.1f} states a second; floor: a bare client that decodes and"
            f" compares, a bare relay that pushes {most} pages the newest messages; today: what the viewers add to the"
            " bridge",
        ),
    )


def _inside(before: dict[str, Any], after: dict[str, Any]) -> list[Row]:
    """Rows of the timed functions of the server, from two answers to `timings`."""
    wall_ns = after["at_ns"] - before["at_ns"]
    calls = {name: after["spent"][name][0] - before["spent"][name][0] for name in after["spent"]}
    spent_ns = {name: after["spent"][name][1] - before["spent"][name][1] for name in after["spent"]}

    def each_us(name: str) -> float:
        return spent_ns[name] / max(1, calls[name]) / 1000

    return [
        Row(what="the judge (Monitor.step)", unit="% of a core", catgraph=100 * spent_ns["step"] / wall_ns),
        Row(what="a message parsed", unit="µs", catgraph=each_us("parse"), digits=1),
        Row(what="a message decoded, kept, judged", unit="µs", catgraph=each_us("message"), digits=1),
        Row(what="a tick of 0.1 s: all judged, a state made", unit="µs", catgraph=each_us("tick"), digits=0),
        Row(what="of it the state", unit="µs", catgraph=each_us("frame"), digits=0),
    ]

"""What viewers cost the car's own computer: its bridge's processor time and bytes, with one viewer and with many."""

from __future__ import annotations

import time

from tests.bench.child import Child
from tests.bench.rig import Rig
from tests.bench.table import Group, Row

Load = tuple[float, float]  # per cent of a core, kB/s


def measure(rig: Rig) -> Group:
    """The bridge under one and many pages, and under as many direct viewers."""
    many = rig.pace.many
    with rig.pages(1):
        one = _load(rig.car, rig.pace.load_s)
    with rig.pages(many):
        all_pages = _load(rig.car, rig.pace.load_s)
    with rig.direct(watching=0, draining=1):
        one_direct = _load(rig.car, rig.pace.load_s)
    with rig.direct(watching=0, draining=many):
        all_direct = _load(rig.car, rig.pace.load_s)
    rows = []
    for i, what, unit in ((0, "processor", "% of a core"), (1, "bytes sent", "kB/s")):
        ours, today = (one[i], all_pages[i]), (one_direct[i], all_direct[i])
        rows += [
            Row(what=f"bridge's {what}, 1 viewer", unit=unit, catgraph=ours[0], today=today[0], digits=1),
            Row(what=f"bridge's {what}, {many} viewers", unit=unit, catgraph=ours[1], today=today[1], digits=1),
            Row(
                what=f"{many} viewers against 1, {what}",
                unit="×",
                catgraph=ours[1] / ours[0],
                today=today[1] / today[0],
                reach=1.1,
            ),
        ]
    return Group(
        name="bridge",
        title="Load on the car's bridge, full car load",
        rows=tuple(rows),
        notes=("our own bridge, which encodes once for all; rosbridge_suite encodes anew for each viewer",),
    )


def _load(car: Child, load_s: float) -> Load:
    before, began_s = car.ask("counts"), time.monotonic()
    share = car.share_of_core(load_s)
    after, took_s = car.ask("counts"), time.monotonic() - began_s
    return share, (after["bytes"] - before["bytes"]) / took_s / 1000

"""How many bytes a scan and a whole page are on the wire."""

from __future__ import annotations

import json
import statistics
import time

import numpy as np
import orjson

from server.simulator.car import SimulatedCar
from server.simulator.messages import SCAN
from tests.bench.child import Child
from tests.bench.rig import Rig
from tests.bench.table import Group, Row

BEAMS = 1081


def measure(rig: Rig) -> Group:
    """Bytes of one scan of 1081 beams, then of a page on Home and on Scan at full car load."""
    load_s = rig.pace.load_s / 2
    car = rig.dense_car
    with rig.pages(1, car=car, scan=True, deflate=False) as pages:
        ours = _scan_bytes(pages, load_s)
    with rig.direct(car=car) as direct:
        as_json = _scan_bytes(direct, load_s)
    with rig.direct(car=car, cbor=True) as direct:
        as_cbor = _scan_bytes(direct, load_s)
    with rig.pages(1) as pages:
        home = _bytes_per_s(pages, load_s)
    with rig.pages(1, scan=True) as pages:
        scan = _bytes_per_s(pages, load_s)
    with rig.direct() as direct:
        everything = _bytes_per_s(direct, load_s)
    with rig.direct(cbor=True) as direct:
        with_cbor = _bytes_per_s(direct, load_s)
    rows = (
        Row(
            what=f"a scan of {BEAMS} beams", unit="B", catgraph=ours, floor=as_cbor, today=as_json, reach=2200, digits=0
        ),
        Row(
            what="a page on Home",
            unit="kB/s",
            catgraph=home / 1000,
            floor=with_cbor / 1000,
            today=everything / 1000,
            digits=1,
        ),
        Row(
            what="a page on Scan",
            unit="kB/s",
            catgraph=scan / 1000,
            floor=with_cbor / 1000,
            today=everything / 1000,
            digits=1,
        ),
    )
    return Group(
        name="bytes",
        title="Bytes to the viewer, WebSocket headers included",
        rows=rows,
        notes=(
            "floor: scans in CBOR; a page's bytes are as its socket counts them, compressed",
            f"this bridge spells a float32 as short as it can; rosbridge_suite's JSON of a scan: {_suite_bytes()} B",
        ),
    )


def _scan_bytes(viewer: Child, load_s: float) -> float:
    viewer.ask("begin")
    time.sleep(load_s)
    (scans,) = viewer.ask("report")["scans"]
    payload = statistics.median(scans)
    return payload + (2 if payload < 126 else 4 if payload < 65536 else 10)  # RFC 6455, 5.2: a server's header


def _bytes_per_s(viewer: Child, load_s: float) -> float:
    viewer.ask("begin")
    time.sleep(load_s)
    report = viewer.ask("report")
    return float(report["bytes_in"]) / float(report["seconds"])


def _suite_bytes() -> int:
    """The same scan as rosbridge_suite spells it: each float32 with the digits of a float64."""
    for message in SimulatedCar(scan_beams=BEAMS).messages():
        if message.topic == SCAN.topic:
            plain = orjson.loads(orjson.dumps(dict(message.message) | {"ranges": []}))
            plain["ranges"] = np.asarray(message.message["ranges"], dtype=np.float32).astype(float).tolist()
            return len(json.dumps({"op": "publish", "topic": SCAN.topic, "msg": plain}))
    raise AssertionError("the car has no laser")

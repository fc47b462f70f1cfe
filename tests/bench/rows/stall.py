"""The longest stall of the server's event loop while everything happens at once and its disk is slow."""

from __future__ import annotations

import json
import time
import urllib.request
from typing import Any

import numpy as np

from tests.bench.child import Child, Failed
from tests.bench.rig import Rig
from tests.bench.table import Group, Row

DISK_S = 0.03  # what each access to the disk takes longer, as on a worn SD card
SETTINGS_EVERY_S = 0.25
EXPORT_EVERY_S = 2.0
MOST_MS = 20.0
READY_WITHIN_S = 60.0


def measure(rig: Rig) -> Group:
    """Recording, exports, pages, changes of settings and reads of a long log, on a slow disk."""
    server = Child("serving", events=rig.pace.events, disk_s=DISK_S)
    try:
        base = server.hello["url"].replace("ws://", "http://").removesuffix("/ws")
        server.ask("command", kind="connect", address=rig.car.hello["url"])
        with rig.pages_at(server.hello["url"], rig.pace.crowd, scan=True), rig.apart_from(server):
            recording = _recorded(server, base, rig.pace.settle_s)
            server.ask("begin_stalls")
            changes, exports = _load(server, base, recording, rig.pace.stall_s)
            lags_ms, own_ms = np.array(server.ask("stalls")).T * 1000
            frames = server.ask("command", kind="state")["recording"]
    finally:
        server.stop()
    p99_ms, longest_ms = float(np.percentile(lags_ms, 99.9)), float(lags_ms.max())
    rows = (
        Row(what="stall, p99.9", unit="ms", catgraph=p99_ms, reach=MOST_MS),
        Row(what="stall, longest", unit="ms", catgraph=longest_ms),
        Row(what="stall, median", unit="ms", catgraph=float(np.median(lags_ms))),
        Row(what="work between two timers, p99.9", unit="ms", catgraph=float(np.percentile(own_ms, 99.9))),
        Row(what="work between two timers, longest", unit="ms", catgraph=float(own_ms.max())),
        Row(what="messages the recording lost", unit="", catgraph=frames["dropped"], reach=0, digits=0),
    )
    note = (
        f"{len(lags_ms)} timers in {rig.pace.stall_s:g} s; {changes} changes of settings, {exports} exports, "
        f"{rig.pace.events} events in the journal; each access to the disk takes {DISK_S * 1000:.0f} ms longer; work: "
        "processor time of the event loop's thread, of which a stall makes more at once"
    )
    title = f"Event loop under load: recording, exports, {rig.pace.crowd} pages, full car load, slow disk"
    return Group(name="stall", title=title, rows=rows, notes=(note,))


def _recorded(server: Child, base: str, for_s: float) -> str:
    """The id of a recording that is complete and read; another one is being made meanwhile."""
    for on in (False, True, False, True):
        server.ask("command", kind="record", on=on)
        time.sleep(for_s)
    ends_s = time.monotonic() + READY_WITHIN_S
    while time.monotonic() < ends_s:
        rows = _asked(base, "/api/recordings")["recordings"]
        if ready := [row["id"] for row in rows if row["state"] == "read"]:
            return str(ready[0])
        time.sleep(0.2)
    raise Failed(f"no recording was read within {READY_WITHIN_S:g} s")


def _load(server: Child, base: str, recording: str, for_s: float) -> tuple[int, int]:
    """Changes settings, exports, lists and reads the log for so long; how many changes and exports."""
    changes = exports = 0
    ends_s = time.monotonic() + for_s
    export_at_s = 0.0
    while (now_s := time.monotonic()) < ends_s:
        values = {"speed_limit.max_mps": 20.0 + changes % 2}
        if not server.ask("command", kind="set", values=values)["ok"]:
            raise Failed("a change of settings was refused")
        changes += 1
        if now_s >= export_at_s:
            export_at_s, exports = now_s + EXPORT_EVERY_S, exports + 1
            _asked(base, f"/api/recordings/{recording}/exports", {"format": "csv" if exports % 2 else "bag"})
            _asked(base, "/api/recordings")
            _asked(base, "/api/log?limit=100&change=raised")
        time.sleep(SETTINGS_EVERY_S)
    return changes, exports


def _asked(base: str, path: str, body: dict[str, Any] | None = None) -> Any:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(base + path, data, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return json.loads(answer.read())

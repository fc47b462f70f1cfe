"""How fast a recorded drive is judged."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

import orjson

from server.analysis.check_pool import cores
from tests.bench.child import Failed
from tests.bench.rig import Rig
from tests.bench.table import Group, Row
from tests.tree import PROJECT, RECORDINGS

DRIVE = "catvehicle_2016-06-01.bag"
TIMES_REAL, TIMES_REAL_TWO_CORES = 100, 180
SEVERAL = 4  # recordings at once
ROUNDS, ROUNDS_QUICK = 9, 2
READ = """
import sys, time
from pathlib import Path
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore
began_s = time.perf_counter()
store = get_typestore(Stores.ROS1_NOETIC)
with Reader(Path(sys.argv[1])) as reader:
    for connection, _, raw in reader.messages():
        store.deserialize_ros1(raw, connection.msgtype)
print(time.perf_counter() - began_s)
"""


def measure(rig: Rig) -> Group:
    """`catgraph check` on the CATVehicle's drive, each time in a process of its own, opening the file included."""
    path = RECORDINGS / DRIVE
    if not path.is_file():
        raise Failed(f"no {path}: name the folder of the recordings in CATGRAPH_DATA")
    judged_ms, whole_ms, several_ms, floor_ms = [], [], [], []
    length_s, messages = 0.0, 0
    for _ in range(ROUNDS_QUICK if rig.pace.load_s < 1 else ROUNDS):
        began_s = time.perf_counter()
        found = orjson.loads(_run("-m", "server", "check", str(path), "--json", "-"))["judged"]
        whole_ms.append(1000 * (time.perf_counter() - began_s))
        judged_ms.append(1000 * found["took_s"])
        began_s = time.perf_counter()
        _run("-m", "server", "check", *[str(path)] * SEVERAL, "--json", "-")
        several_ms.append(1000 * (time.perf_counter() - began_s) - (whole_ms[-1] - judged_ms[-1]))
        length_s, messages = found["to_s"] - found["from_s"], found["messages"]
        floor_ms.append(1000 * float(_run("-c", READ, str(path))))
    reach_ms = 1000 * length_s / TIMES_REAL
    rows = (
        Row(
            what="opened and judged, median",
            unit="ms",
            catgraph=statistics.median(judged_ms),
            floor=statistics.median(floor_ms),
            reach=reach_ms,
            digits=0,
        ),
        Row(what="opened and judged, best", unit="ms", catgraph=min(judged_ms), floor=min(floor_ms), digits=0),
        Row(what="the whole command, median", unit="ms", catgraph=statistics.median(whole_ms), digits=0),
        Row(
            what=f"{SEVERAL} at once on {cores()} cores, median",
            unit="ms",
            catgraph=statistics.median(several_ms),
            reach=SEVERAL * 1000 * length_s / TIMES_REAL_TWO_CORES,
            digits=0,
        ),
    )
    best, median = (1000 * length_s / took_ms for took_ms in (min(judged_ms), statistics.median(judged_ms)))
    return Group(
        name="rehearsal",
        title=f"catgraph check on a recorded drive of {length_s:.0f} s, {messages} messages",
        rows=rows,
        notes=(
            f"{best:.0f} × real time at best, {median:.0f} × in the middle, of {len(judged_ms)} processes; "
            f"the goal is {TIMES_REAL} ×, and {TIMES_REAL_TWO_CORES} × for {SEVERAL} at once on two cores",
            f"{SEVERAL} at once: the whole command without the start of one process",
            "floor: rosbags reads the same bag and unpacks its messages, without judging anything",
        ),
    )


def _run(*arguments: str) -> bytes:
    done = subprocess.run([sys.executable, *arguments], cwd=PROJECT, capture_output=True, timeout=120, check=False)
    if done.returncode not in (0, 1):  # 1: a critical alarm was raised
        raise Failed(done.stderr.decode("utf-8", "replace").strip() or f"it ended with {done.returncode}")
    return done.stdout

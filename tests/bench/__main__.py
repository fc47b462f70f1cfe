"""`python -m tests.bench`: measures all rows in one run and prints them as one table."""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import orjson
import psutil

from tests.bench import yardstick
from tests.bench.child import Failed
from tests.bench.rig import FULL, QUICK, Rig
from tests.bench.rows import (
    bridge,
    cpu,
    fleet,
    gap,
    latency,
    many,
    memory,
    recording,
    rehearsal,
    size,
    slow_down,
    stall,
)
from tests.bench.table import Group, printed

GROUPS: dict[str, Callable[[Rig], Group]] = {
    "latency": latency.measure_one,
    "crowd": latency.measure_crowd,
    "gap": gap.measure,
    "bytes": size.measure,
    "bridge": bridge.measure,
    "cpu": cpu.measure,
    "memory": memory.measure,
    "recording": recording.measure,
    "stall": stall.measure,
    "slow-down": slow_down.measure,
    "rehearsal": rehearsal.measure,
    "fleet": fleet.measure,
    "many": many.measure,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """0: measured, whatever came of it; 1: something could not be measured."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a rough run in under 20 s: see that it works, no more")
    parser.add_argument("--only", action="append", choices=GROUPS, metavar="NAME", help=f"one of {', '.join(GROUPS)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    args = parser.parse_args(arguments)
    began_s, load_before = time.monotonic(), os.getloadavg()[0]
    groups: list[Group] = []
    failed = 0
    paces_ms = yardstick.times_ms()
    with Rig(QUICK if args.quick else FULL) as rig:
        for name in args.only or GROUPS:
            _say(f"measuring {name} …")
            try:
                groups.append(GROUPS[name](rig))
            except Failed as why:
                failed += 1
                print(f"{name} could not be measured: {why}", file=sys.stderr)
            paces_ms += yardstick.times_ms()
    paces = f"{min(paces_ms):.1f} … {max(paces_ms):.1f} ms, median {statistics.median(paces_ms):.1f}"
    machine = (
        f"{psutil.cpu_count()} cores, load average {load_before:.1f} → {os.getloadavg()[0]:.1f} with this bench in it, "
        f"a fixed piece of work {paces}, Python {platform.python_version()}, {platform.system()}, "
        f"{time.monotonic() - began_s:.0f} s"
    )
    _say("")
    print(printed(groups))
    print(f"\n{machine}")
    print("floor: the same work by a bare WebSocket client on the bridge; today: one rosbridge connection a viewer")
    if args.json is not None:
        found = {"machine": machine, "quick": args.quick, "groups": [group.as_json() for group in groups]}
        args.json.write_bytes(orjson.dumps(found, option=orjson.OPT_INDENT_2))
    return 1 if failed else 0


def _say(text: str) -> None:
    """Progress, on a terminal only, in one line that the next one replaces."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())

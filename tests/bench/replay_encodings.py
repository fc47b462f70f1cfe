"""`python -m tests.bench.replay_encodings DRIVE`: what a replay costs for each message in each encoding, in one run.

The processor time of `catgraph replay` at true speed with one client that subscribes to every topic. `--beside`
measures another tree in turns with this one, in the encodings that it has.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from websockets.sync.client import ClientConnection, connect

from tests.bench.child import PROJECT

ENCODINGS = ("none", "cbor", "cbor-raw")
WARM_S = 2.0


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.replay_encodings", description=__doc__)
    parser.add_argument("drive", type=Path, help="a recording of at least the measured time")
    parser.add_argument("--beside", type=Path, metavar="TREE", help="another tree, measured in turns with this one")
    parser.add_argument("--seconds", type=float, default=15.0, help="of each measurement (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=2, help="medians of so many (default: %(default)s)")
    args = parser.parse_args(arguments)
    trees = [PROJECT] if args.beside is None else [PROJECT, args.beside.resolve()]
    found: dict[tuple[Path, str], list[float]] = {}
    for _ in range(args.rounds):
        for encoding in ENCODINGS:
            for tree in trees:
                cost = micros(tree, args.drive.resolve(), encoding, args.seconds)
                if cost is not None:
                    found.setdefault((tree, encoding), []).append(cost)
    print(f"{'':10} processor time of the replay for each message [µs]")
    for tree in trees:
        row = {
            encoding: statistics.median(found[tree, encoding]) for encoding in ENCODINGS if (tree, encoding) in found
        }
        print(f"{tree.name:10} " + "  ".join(f"{encoding} {cost:.0f}" for encoding, cost in row.items()))
    return 0


def micros(tree: Path, drive: Path, encoding: str, seconds: float) -> float | None:
    """Processor time for each message that the client gets; None where the tree does not have the encoding."""
    command = [sys.executable, "-m", "server", "replay", str(drive), "--port", "0", "--wait"]
    with subprocess.Popen(command, cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            url = next(match[0] for line in process.stdout if (match := re.search(r"ws://[\d.]+:\d+", line)))
            with connect(url, max_size=None, compression=None) as socket:
                if not subscribe(socket, encoding):
                    return None
                count(socket, WARM_S)
                before = processor_s(process.pid)
                messages = count(socket, seconds)
                used = processor_s(process.pid) - before
        finally:
            process.terminate()
    return used / messages * 1e6


def processor_s(pid: int) -> float:
    """Processor time of a process by Linux's clock of it, whose number clock_getcpuclockid(3) makes of the pid.

    psutil's figures have steps of 10 ms, which 150 scans do not take.
    """
    return time.clock_gettime((~pid << 3) | 2)


def subscribe(socket: ClientConnection, encoding: str) -> bool:
    """Subscribes to every topic; False where the bridge refuses the encoding."""
    socket.send(json.dumps({"op": "call_service", "service": "/rosapi/topics", "id": "topics"}))
    topics = json.loads(socket.recv())["values"]["topics"]
    for topic in topics:
        socket.send(json.dumps({"op": "subscribe", "topic": topic, "compression": encoding}))
    first = socket.recv(20.0)
    return isinstance(first, bytes) or json.loads(first)["op"] != "status"


def count(socket: ClientConnection, seconds: float) -> int:
    """Messages that come in this time."""
    ends_s, number = time.monotonic() + seconds, 0
    while (left_s := ends_s - time.monotonic()) > 0:
        try:
            socket.recv(left_s, decode=False)
        except TimeoutError:
            break
        number += 1
    return number


if __name__ == "__main__":
    sys.exit(main())

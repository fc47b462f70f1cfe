"""Joins two network namespaces by a radio that delays, loses and throttles packets, where the kernel has no netem.

    python -m tests.radio.radio A B [--profile NAME] [--net 10.77.1] [--seed 7]

Makes the namespaces A and B (removed at the end), a `rad` interface in each with NET.1 and NET.2, and prints `ready`.
Run programs in them with `ip netns exec A …`; traffic stays on this machine. Each line on standard input changes the
radio at once: a profile's name, or `DIRECTION delay_ms jitter_ms loss_percent rate_kbit` with DIRECTION `a>b`, `b>a` or
`both`; rate 0 is unlimited. Every packet has a delay of its own (delay ± jitter, uniform), so packets overtake each
other as with netem; with a rate, what would wait longer than 2 s is dropped. A line a second goes to standard error:
packets, lost, overflowed and bytes of both directions. Needs root, iproute2 and /dev/net/tun.
"""

from __future__ import annotations

import argparse
import asyncio
import fcntl
import os
import random
import signal
import struct
import subprocess
import sys

PROFILES = {  # delay [ms], jitter [ms], loss [%], rate [kbit/s]
    "clean": (0, 0, 0, 0),
    "fair": (80, 20, 2, 0),
    "weak": (150, 50, 5, 0),
    "bad": (300, 100, 10, 500),
    "off": (0, 0, 100, 0),
}
TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
LONGEST_QUEUE, LONGEST_WAIT_S = 1000, 2.0


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


def tun(namespace: str, address: str, peer: str) -> int:
    """A TUN device whose far side is here and whose interface `rad` is in the namespace."""
    handle = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    name = f"rad{os.getpid() % 10000}{address[-1]}"
    fcntl.ioctl(handle, TUNSETIFF, struct.pack("16sH22s", name.encode(), IFF_TUN | IFF_NO_PI, b""))
    ip("link", "set", name, "netns", namespace)
    ip("-n", namespace, "link", "set", name, "name", "rad")
    ip("-n", namespace, "addr", "add", address, "peer", peer, "dev", "rad")
    ip("-n", namespace, "link", "set", "lo", "up")
    ip("-n", namespace, "link", "set", "rad", "up")
    return handle


class Direction:
    """Packets from one TUN device to another."""

    def __init__(self, source: int, target: int, chance: random.Random) -> None:
        self.source, self.target, self.chance = source, target, chance
        self.shape = PROFILES["clean"]
        self.busy_s = 0.0
        self.waiting = self.packets = self.lost = self.overflowed = self.bytes = 0

    def readable(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                packet = os.read(self.source, 65536)
            except OSError:  # nothing more to read, or the interface is gone
                return
            delay_ms, jitter_ms, loss, rate_kbit = self.shape
            self.packets += 1
            self.bytes += len(packet)
            if self.chance.random() * 100 < loss:
                self.lost += 1
                continue
            now_s = loop.time()
            due_s = now_s + max(0.0, delay_ms + self.chance.uniform(-jitter_ms, jitter_ms)) / 1000
            if rate_kbit:
                on_air_s = len(packet) * 8 / (rate_kbit * 1000)
                free_s = max(now_s, self.busy_s)
                if free_s + on_air_s - now_s > LONGEST_WAIT_S:
                    self.overflowed += 1
                    continue
                self.busy_s = free_s + on_air_s
                due_s += self.busy_s - now_s
            if self.waiting >= LONGEST_QUEUE:
                self.overflowed += 1
                continue
            self.waiting += 1
            loop.call_at(due_s, self.arrive, packet)

    def arrive(self, packet: bytes) -> None:
        self.waiting -= 1
        try:
            os.write(self.target, packet)
        except OSError:  # the interface is down: as on the air
            self.lost += 1


async def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("a")
    parser.add_argument("b")
    parser.add_argument("--profile", choices=PROFILES, default="clean")
    parser.add_argument("--net", default="10.77.1")
    parser.add_argument("--seed", type=int, default=7)
    given = parser.parse_args()
    made, directions = [], {}
    try:
        for name in (given.a, given.b):
            ip("netns", "add", name)
            made.append(name)
        first = tun(given.a, f"{given.net}.1", f"{given.net}.2")
        second = tun(given.b, f"{given.net}.2", f"{given.net}.1")
        chance = random.Random(given.seed)
        directions = {"a>b": Direction(first, second, chance), "b>a": Direction(second, first, chance)}
        loop = asyncio.get_running_loop()
        for one in directions.values():
            one.shape = PROFILES[given.profile]
            loop.add_reader(one.source, one.readable)
        lines = asyncio.StreamReader()
        await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
        print("ready", flush=True)
        reporting = asyncio.create_task(report(directions))
        while line := (await lines.readline()).decode().split():
            change(directions, line)
        await reporting  # standard input has ended: on as it is, until a signal
    finally:
        for one in directions.values():
            asyncio.get_running_loop().remove_reader(one.source)
        for name in made:
            ip("netns", "del", name)


def change(directions: dict[str, Direction], line: list[str]) -> None:
    try:
        if line[0] in PROFILES:
            chosen, shape = list(directions.values()), PROFILES[line[0]]
        else:
            chosen = list(directions.values()) if line[0] == "both" else [directions[line[0]]]
            shape = tuple(float(part) for part in line[1:5])
            if len(shape) != 4:
                raise ValueError("four numbers are needed")
    except (KeyError, ValueError) as error:
        print(f"not understood: {' '.join(line)} ({error})", file=sys.stderr, flush=True)
        return
    for one in chosen:
        one.shape = shape


async def report(directions: dict[str, Direction]) -> None:
    while True:
        await asyncio.sleep(1)
        rows = [f"{n} {w.packets} packets {w.lost} lost {w.overflowed} over {w.bytes} B" for n, w in directions.items()]
        print(" | ".join(rows), file=sys.stderr, flush=True)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        asyncio.run(main())
    except KeyboardInterrupt:
        pass

"""The bench's clients straight on the bridge: what a page costs without catgraph, and the least that it can cost.

One of them decodes every message and compares the speed; the others only drain their sockets, as thirty phones would
each on a processor of its own.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any

import cbor2
import orjson

from server.app.process import uvloop_runner
from server.simulator.messages import SCAN, VEL
from tests.bench.lean_socket import LeanSocket, open_socket
from tests.bench.orders import execute_orders, options

LIMIT_MPS = 11.0
AFTER_A_GAP_S = 1.5
_STANDING = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
STALE_S = 0.1  # older than a page's state may be


class Watcher:
    """Decodes all, compares the speed with the limit, and notes when it was above."""

    socket: LeanSocket

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self.alarms: list[list[Any]] = []  # [speed in m/s, ns]
        self.ages_s: list[float] = []  # of each speed message when it was read
        self.scans: list[int] = []  # bytes of each
        self.messages = 0

    def hear(self, _: LeanSocket, payload: bytes, is_text: bool) -> None:
        message = orjson.loads(payload) if is_text else cbor2.loads(payload)
        self.messages += 1
        topic = message["topic"]
        if topic == VEL.topic:
            speed_mps = message["msg"]["linear"]["x"]
            if abs(speed_mps) > LIMIT_MPS:
                self.alarms.append([speed_mps, time.monotonic_ns()])
            self.ages_s.append(time.monotonic() - message["msg"]["angular"]["x"])
        elif topic == SCAN.topic:
            self.scans.append(len(payload))


class Direct:
    """All clients of the process."""

    def __init__(self) -> None:
        self._watchers: list[Watcher] = []
        self._drains: list[LeanSocket] = []
        self._stalled: list[LeanSocket] = []
        self._began_s = time.monotonic()
        self._bytes_in = 0

    async def connect(
        self, url: str, topics: list[str], watching: int = 1, draining: int = 0, stalled: int = 0, cbor: bool = False
    ) -> None:
        """Opens clients, each with a subscription to every topic; `cbor`: scans in CBOR, as catgraph requests them."""
        for _ in range(watching):
            watcher = Watcher()
            watcher.socket = await open_socket(url, watcher.hear)
            self._watchers.append(watcher)
        self._drains = [await open_socket(url) for _ in range(draining)]
        self._stalled = [await open_socket(url) for _ in range(stalled)]
        for socket in self._sockets():
            for topic in topics:
                compression = "cbor" if cbor and topic == SCAN.topic else "none"
                socket.send(orjson.dumps({"op": "subscribe", "topic": topic, "compression": compression}))
        for socket in self._stalled:
            socket.pause()

    async def begin(self) -> None:
        for watcher in self._watchers:
            watcher.forget()
        self._began_s = time.monotonic()
        self._bytes_in = sum(watcher.socket.bytes_in for watcher in self._watchers)

    async def report(self) -> dict[str, Any]:
        """What the watchers received since `begin`."""
        return {
            "seconds": time.monotonic() - self._began_s,
            "messages": [watcher.messages for watcher in self._watchers],
            "alarms": [watcher.alarms for watcher in self._watchers],
            "scans": [watcher.scans for watcher in self._watchers],
            "bytes_in": sum(watcher.socket.bytes_in for watcher in self._watchers) - self._bytes_in,
        }

    async def gap(self, seconds: float) -> list[dict[str, Any]]:
        """All watchers stop reading for so long; answers how old what each then reads is."""
        return await asyncio.gather(*(self._gap(watcher, seconds) for watcher in self._watchers))

    async def metronome(self, url: str, topic: str, seconds: float, period_s: float) -> None:
        """A bare client that sends one Twist a period, and does nothing else."""
        socket = await open_socket(url)
        loop = asyncio.get_running_loop()
        try:
            socket.send(orjson.dumps({"op": "advertise", "topic": topic, "type": "geometry_msgs/Twist"}))
            due_s = loop.time()
            ends_s = due_s + seconds
            while due_s < ends_s:
                await asyncio.sleep(max(0.0, due_s - loop.time()))
                socket.send(orjson.dumps({"op": "publish", "topic": topic, "msg": _STANDING}))
                due_s += period_s
        finally:
            socket.abort()

    async def leave(self) -> None:
        for socket in self._sockets():
            socket.abort()
        self._watchers, self._drains, self._stalled = [], [], []

    def _sockets(self) -> list[LeanSocket]:
        return [*(watcher.socket for watcher in self._watchers), *self._drains, *self._stalled]

    async def _gap(self, watcher: Watcher, seconds: float) -> dict[str, Any]:
        watcher.socket.pause()
        await asyncio.sleep(seconds)
        watcher.forget()
        watcher.socket.resume()
        await asyncio.sleep(AFTER_A_GAP_S)
        share = sum(age_s > STALE_S for age_s in watcher.ages_s) / max(1, len(watcher.ages_s))
        return {
            "first_age_s": watcher.ages_s[0] if watcher.ages_s else None,
            "stale": round(share * watcher.messages),  # speeds come evenly among the other messages
        }


async def main() -> None:
    direct = Direct()
    orders = {
        "connect": direct.connect,
        "begin": direct.begin,
        "report": direct.report,
        "gap": direct.gap,
        "metronome": direct.metronome,
        "leave": direct.leave,
    }
    try:
        await execute_orders(orders, {})
    finally:
        await direct.leave()


if __name__ == "__main__":
    with uvloop_runner() as runner:
        runner.run(main(**options()))

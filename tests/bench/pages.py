"""The bench's pages: they use docs/protocol.md, read all messages at once and record their arrival times."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import orjson

from server.app.process import uvloop_runner
from tests.bench.lean_socket import LeanSocket, open_socket
from tests.bench.orders import execute_orders, options

MONITORING_WITHIN_S = 15.0
AFTER_A_GAP_S = 1.5  # how long a page's frames are looked at when it reads again
STAGGER_S = 0.013  # pages read again one after the other, so that they meet the server's tick at different moments
TICK_S = 0.1  # a state is made this often


class Page:
    """One page. `socket` is set when it is opened."""

    socket: LeanSocket

    def __init__(self) -> None:
        self.newest: dict[str, Any] = {}  # the newest state, read only while `reads_states`
        self.listed = 0  # cars whose summary was in the newest list, read only while `reads_states`
        self.reads_states = True
        self.forget()

    def forget(self) -> None:
        """What was noted so far does not count."""
        self.state_at_s: list[float] = []
        self.ages_s: list[float] = []  # of each state when it came, while `reads_states`
        self.round_trips_s: list[float] = []  # from a take to the state it brought
        self.alarms: list[list[Any]] = []  # [text, ns] of each speed alarm raised
        self.lists = 0  # of all cars
        self.scans: list[int] = []  # bytes of each
        self._took_s: float | None = None

    def hear(self, socket: LeanSocket, payload: bytes, is_text: bool) -> None:
        """One message, answered as a page answers."""
        if not is_text:
            self.scans.append(len(payload))
        elif payload.startswith(b'{"kind":"state"'):
            self._state(payload)
        elif payload.startswith(b'{"kind":"offer"'):
            self._took_s = time.monotonic()
            socket.send(b'{"kind":"take","seq":%d}' % orjson.loads(payload)["seq"])
        elif payload.startswith(b'{"kind":"cars"'):
            self.lists += 1
            if self.reads_states:
                self.listed = sum(car["summary"] is not None for car in orjson.loads(payload)["cars"])
        elif payload.startswith(b'{"kind":"events"'):
            events = orjson.loads(payload)["events"]
            at_ns = time.monotonic_ns()
            self.alarms += [
                [e["text"], at_ns] for e in events if e["alarm"] == "speed_limit" and e["change"] == "raised"
            ]
            socket.send(b'{"kind":"have","event":%d}' % events[-1]["n"])

    def _state(self, payload: bytes) -> None:
        now_s = time.monotonic()
        self.state_at_s.append(now_s)
        if self._took_s is not None:
            self.round_trips_s.append(now_s - self._took_s)
            self._took_s = None
        if self.reads_states:
            self.newest = orjson.loads(payload)
            self.ages_s.append(time.time() - self.newest["server"]["time_ms"] / 1000)


class Pages:
    """All pages of the process."""

    def __init__(self) -> None:
        self._live: list[Page] = []
        self._stalled: list[Page] = []
        self._began_s = time.monotonic()
        self._bytes_in = self._bytes_out = 0

    async def connect(self, url: str, count: int, stalled: int = 0, scan: bool = False, deflate: bool = True) -> None:
        """Opens pages, waits until they see a car that is monitored, and lets some of them stop reading."""
        pages = [await self._open(url, scan=scan, deflate=deflate) for _ in range(count + stalled)]
        await self._monitored(pages)
        self._come_in(pages)
        self._live, self._stalled = pages[:count], pages[count:]
        for page in self._stalled:
            page.socket.pause()

    async def open(self, url: str, vehicles: list[str], count: int) -> None:
        """More pages, each on Home of the next of the vehicles in turn, until there are `count`."""
        pages = [
            await self._open(f"{url}/ws?vehicle={vehicles[k % len(vehicles)]}", scan=False, deflate=True)
            for k in range(len(self._live), count)
        ]
        await self._monitored(pages)
        self._come_in(pages)

    async def open_fleet(self, url: str, cars: int, count: int) -> None:
        """More pages of all cars, until there are `count`; each shows so many cars that send data."""
        pages = [await self._open(f"{url}/ws?fleet=1", scan=False, deflate=True) for _ in range(len(self._live), count)]
        ends_s = time.monotonic() + MONITORING_WITHIN_S
        for page in pages:
            while page.listed < cars:
                if time.monotonic() > ends_s:
                    raise TimeoutError(f"a page saw {page.listed} of {cars} cars within {MONITORING_WITHIN_S:g} s")
                await asyncio.sleep(0.01)
        self._come_in(pages)

    def _come_in(self, pages: list[Page]) -> None:
        for page in pages:
            page.reads_states = False
        self._live += pages

    async def begin(self) -> None:
        """From now on counts."""
        for page in self._live:
            page.forget()
        self._began_s = time.monotonic()
        self._bytes_in = sum(page.socket.bytes_in for page in self._live)
        self._bytes_out = sum(page.socket.bytes_out for page in self._live)

    async def report(self) -> dict[str, Any]:
        """What came since `begin`. Raises ConnectionError where a page was let go meanwhile."""
        ended_s = time.monotonic()
        if any(page.socket.is_closed for page in self._live):
            raise ConnectionError("the server closed the connection of a page")
        silences = [
            max(b - a for a, b in zip([self._began_s, *p.state_at_s], [*p.state_at_s, ended_s], strict=True))
            for p in self._live
        ]
        return {
            "seconds": ended_s - self._began_s,
            "states": [len(page.state_at_s) for page in self._live],
            "lists": [page.lists for page in self._live],
            "longest_silence_s": max(silences),
            "alarms": [page.alarms for page in self._live],
            "scans": [page.scans for page in self._live],
            "bytes_in": sum(page.socket.bytes_in for page in self._live) - self._bytes_in,
            "bytes_out": sum(page.socket.bytes_out for page in self._live) - self._bytes_out,
        }

    async def gap(self, seconds: float) -> list[dict[str, Any]]:
        """All pages stop reading for so long; answers what each got first, and how much of it was stale."""
        return await asyncio.gather(*(self._gap(page, seconds + i * STAGGER_S) for i, page in enumerate(self._live)))

    async def leave(self) -> None:
        for page in self._live + self._stalled:
            page.socket.abort()
        self._live, self._stalled = [], []

    async def _open(self, url: str, *, scan: bool, deflate: bool) -> Page:
        page = Page()
        page.socket = await open_socket(url, page.hear, deflate=deflate)
        page.socket.send(b'{"kind":"hello","have_event":null}')
        if scan:
            page.socket.send(b'{"kind":"watch","scan":true}')
        return page

    async def _monitored(self, pages: list[Page]) -> None:
        ends_s = time.monotonic() + MONITORING_WITHIN_S
        for page in pages:
            while not page.newest or page.newest["signals"]["speed"]["freshness"] != "fresh":
                if time.monotonic() > ends_s:
                    seen = {part: page.newest.get(part) for part in ("server", "session", "link")}
                    raise TimeoutError(f"a page saw no speed within {MONITORING_WITHIN_S:g} s: {seen}")
                await asyncio.sleep(0.01)

    async def _gap(self, page: Page, seconds: float) -> dict[str, Any]:
        rtt_s = sorted(page.round_trips_s)[len(page.round_trips_s) // 2]
        page.forget()
        page.socket.pause()
        await asyncio.sleep(seconds)
        page.forget()  # what was read in the moment of stopping
        page.reads_states = True
        page.socket.resume()
        await asyncio.sleep(AFTER_A_GAP_S)
        page.reads_states = False
        stale = sum(age_s > TICK_S + rtt_s + 0.01 for age_s in page.ages_s)
        return {
            "first_age_s": page.ages_s[0] if page.ages_s else None,
            "rtt_s": rtt_s,
            "stale": stale,
            "closed": page.socket.is_closed,
        }


async def main() -> None:
    pages = Pages()
    orders = {
        "connect": pages.connect,
        "open": pages.open,
        "open_fleet": pages.open_fleet,
        "begin": pages.begin,
        "report": pages.report,
        "gap": pages.gap,
        "leave": pages.leave,
    }
    try:
        await execute_orders(orders, {})
    finally:
        await pages.leave()


if __name__ == "__main__":
    with uvloop_runner() as runner:
        runner.run(main(**options()))

"""Connections to a NATS broker that are there before they are needed.

Behind a gap of the radio a dial takes three and a half round trips until the broker has the subscriptions, and its
first packet may wait for seconds to be repeated. By an idle connection they take half a trip: nothing of it was under
way when the radio was lost, so that TCP waits for nothing.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from nats.aio.client import Client

from server.bus.nats_probe import PortProbe
from server.system.supervision import cancel

PORT = 4222
RETRY_S = 1.0  # after a dial that the broker refused
SPARE_RETRY_S = 10.0  # where it is not needed now
PROBED_FOR_S = 60.0  # then a dial is tried as well
GAP_S = 0.5  # where the port answers no sooner, the first packet of a dial is lost
TRIED_ANYWAY_S = 600.0  # in a gap an idle connection that is tried is lost
MOST_DIALS = 6  # at once, with those that settle, and in RETRY_S
SETTLES_S = 3.0  # a broker pings a new connection after 2.0 to 2.4 s: lost in a gap, that holds up all that follows
KEEP_EVERY_S = 20.0  # one is pinged: networks forget silent connections, and the broker would ping after 2 min
KEPT_WITHIN_S = 5
CLOSES_WITHIN_S = 1.0


class Spares:
    """Dials, keeps `count` connections idle, and gives one of them once the broker can be reached."""

    def __init__(self, dial: Callable[[], Awaitable[Client]], address: str, count: int) -> None:
        """`dial` raises what went wrong."""
        self._dial = dial
        self._count = count
        at = urlsplit(address)
        # Where a connection lives, a refusal shows that the radio is back: new ones may be refused, by whatever it is.
        self._probe = PortProbe(at.hostname or "", at.port or PORT, lambda: self.is_any)
        self._idle: list[Client] = []  # the one that was silent for longest comes first
        self._dials: set[asyncio.Task[None]] = set()  # those as well that wait until they may be tried again
        self._settling: dict[asyncio.Task[None], Client] = {}  # new ones, and one that is pinged
        self._closing: set[asyncio.Task[None]] = set()
        self._begun_s: list[float] = []  # when dials were begun of late
        self._again: asyncio.TimerHandle | None = None  # then more may be
        self._needed = asyncio.Event()  # there is no connection to work by
        self._is_proven = True  # the one that was taken answers
        self._unsettled: list[Client] = []
        self._changed, self._dialled = asyncio.Event(), asyncio.Event()

    @property
    def is_any(self) -> bool:
        return any(one.is_connected for one in self._idle)

    @property
    def is_newer(self) -> bool:
        """Whether there is one that answered since the last one was taken."""
        return self._dialled.is_set() and self.is_any

    async def run(self) -> None:
        """Dial what is missing, as many at once: over a bad radio a dial takes seconds."""
        now = asyncio.get_running_loop().time
        keep_at_s = now() + KEEP_EVERY_S
        while True:
            self._changed.clear()
            self._forget_ended()
            is_needed = self._needed.is_set()
            there = len(self._idle) + (0 if is_needed else len(self._settling))
            self._begin(self._count + is_needed - there - len(self._dials))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout_at(keep_at_s):
                    await self._changed.wait()
            if now() < keep_at_s:
                continue
            keep_at_s = now() + KEEP_EVERY_S
            if self._idle and not self._needed.is_set():  # while its ping is under way another one is given
                self._settle(self._idle.pop(0))

    async def take(self) -> Client:
        """The next one to work by: an idle one, as soon as the broker's port answers, or else one that is new."""
        self._need()
        self._is_proven = False
        began_s = asyncio.get_running_loop().time()
        probing = self._probe.begin()
        dialled = asyncio.create_task(self._dialled.wait())
        try:
            # In a gap it would be lost as the one before; where no new connection is let through, it is the only one.
            wait_s = TRIED_ANYWAY_S if self.is_any else None
            await asyncio.wait({probing, dialled}, timeout=wait_s, return_when=asyncio.FIRST_COMPLETED)
            if probing.done() and asyncio.get_running_loop().time() - began_s > GAP_S:
                self._begin(1 + self._count)  # beside those whose first packet waits to be repeated
            while True:
                while self._idle:
                    if (one := self._idle.pop(0)).is_connected:
                        return one
                    self._drop(one)
                self._need()
                await self._dialled.wait()
        finally:  # without a pause: cancelled in one, the client that is returned would be lost
            self._needed.clear()
            self._dialled.clear()
            self._changed.set()  # one is missing now
            dialled.cancel()
            self._probe.end()

    def beside(self) -> list[Client]:
        """Two idle ones, or one, for copies of what is sent by the one that was taken. Where there are more, one stays
        unused: the next gap may begin at once."""
        self._forget_ended()
        used = self._idle[: min(2, max(1, len(self._idle) - 1))]
        self._idle = [*self._idle[len(used) :], *used]
        return used

    def works(self) -> None:
        """The one that was taken last answers."""
        self._is_proven = True
        for one in self._unsettled:
            if one in self._idle:
                self._idle.remove(one)
                self._settle(one, SETTLES_S)
        self._unsettled.clear()

    def _begin(self, dials: int) -> None:
        loop = asyncio.get_running_loop()
        self._begun_s = [at_s for at_s in self._begun_s if loop.time() - at_s < RETRY_S]
        open_ones = len(self._dials) + sum(one.is_connected for one in self._settling.values())
        most = MOST_DIALS - max(open_ones, len(self._begun_s))
        if self._needed.is_set() and not self._probe.is_reached:  # each looks the name up in threads that all share
            most = min(most, 1 - len(self._dials))
        for _ in range(min(dials, most)):
            self._begun_s.append(loop.time())
            task = asyncio.create_task(self._add(), name="spare connection")
            self._dials.add(task)
            task.add_done_callback(self._dials.discard)
            task.add_done_callback(lambda _: self._changed.set())
        if dials > most:
            if self._again is not None:
                self._again.cancel()
            self._again = loop.call_later(RETRY_S, self._changed.set)

    async def _add(self) -> None:
        try:
            one = await self._dial()
        except TimeoutError:
            return
        except Exception:  # `dial` reported it; without another try a car would be lost for good
            return await self._wait_to_dial()
        if (self._needed.is_set() or not self._is_proven) and not self.is_newer:
            self._idle.insert(0, one)
            self._unsettled.append(one)
            return self._dialled.set()
        return self._settle(one, SETTLES_S)

    async def _wait_to_dial(self) -> None:
        """Return when a dial may be tried again after one that failed."""
        if not self._needed.is_set():
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(SPARE_RETRY_S):
                    await self._needed.wait()
            return
        await asyncio.sleep(RETRY_S)
        if self._needed.is_set():  # while the broker is away only its port is dialled
            await asyncio.wait({self._probe.begin()}, timeout=PROBED_FOR_S)

    def _settle(self, one: Client, after_s: float = 0.0) -> None:
        task = asyncio.create_task(self._put_last(one, after_s), name="spare connection")
        self._settling[task] = one
        task.add_done_callback(self._settling.pop)
        task.add_done_callback(lambda _: self._changed.set())

    async def _put_last(self, one: Client, after_s: float) -> None:
        """Keep it as a spare one, if the broker answers by it."""
        try:
            await asyncio.sleep(after_s)
            await one.rtt(timeout=KEPT_WITHIN_S)  # a flush returns at once where nothing reads the answer any more
        except Exception:  # whatever it was: it does not answer
            return self._drop(one)
        self._forget_ended()
        if len(self._idle) >= self._count + (self._needed.is_set() or not self._is_proven):  # one more where none works
            return self._drop(one)
        self._idle.append(one)
        return self._dialled.set()

    def _forget_ended(self) -> None:
        for one in self._idle:
            if not one.is_connected:
                self._drop(one)
        self._idle = [one for one in self._idle if one.is_connected]
        self._unsettled = [one for one in self._unsettled if one in self._idle]

    def _need(self) -> None:
        self._needed.set()
        self._dialled.clear()
        self._changed.set()

    def _drop(self, one: Client) -> None:
        """Close it. Nobody waits for its end: bytes may be left that cannot be sent now."""
        task = asyncio.create_task(_close(one), name="close a connection")
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)

    async def give_up(self, one: Client) -> None:
        """From now on nothing comes by it."""
        self._drop(one)
        await asyncio.sleep(0)

    async def close(self) -> None:
        self._probe.end()
        await cancel(self._dials)
        clients = [*self._idle, *self._settling.values()]
        self._idle.clear()
        await cancel(self._settling)
        for one in clients:
            self._drop(one)
        if self._closing:
            await asyncio.wait(self._closing, timeout=CLOSES_WITHIN_S)
        await cancel(self._closing)


async def _close(one: Client) -> None:
    with contextlib.suppress(Exception):  # one that never connected cannot be closed
        await one.close()

"""Connections to a NATS broker that are there before they are needed.

Behind a gap of the radio a dial takes three and a half round trips until the broker has the subscriptions, and its
first packet may wait for seconds to be repeated. By an idle connection they take half a trip: nothing of it was under
way when the radio was lost, so that TCP waits for nothing.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Collection, Coroutine
from typing import Any
from urllib.parse import urlsplit

from nats.aio.client import Client

PORT = 4222
RETRY_S = 1.0  # after a dial that the broker refused
SPARE_RETRY_S = 10.0  # where it is not needed now
PROBE_EVERY_S = 0.25  # a dial into the last moment of a gap is lost, and the system repeats it after 1 or 3 s
PROBE_SLOWLY_S = 1.0  # where the broker was away for a minute
PROBE_SLOWLY_AFTER_S = 60.0
PROBE_FOR_S = 2.0
REACHED_FOR_S = 2.0  # so long the answer to a probe counts
MOST_DIALS = 6  # at once
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
        self._host, self._port = at.hostname or "", at.port or PORT
        self._idle: list[Client] = []  # the one that was silent for longest comes first
        self._dials: set[asyncio.Task[None]] = set()
        self._settling: set[asyncio.Task[None]] = set()  # new ones, and one that is pinged
        self._closing: set[asyncio.Task[None]] = set()
        self._is_needed = False  # there is no connection to work by
        self._changed, self._dialled, self._reached = asyncio.Event(), asyncio.Event(), asyncio.Event()
        self._reached_s = -REACHED_FOR_S

    @property
    def is_any(self) -> bool:
        return any(one.is_connected for one in self._idle)

    async def run(self) -> None:
        """Dial what is missing, as many at once: over a bad radio a dial takes seconds."""
        try:
            while True:
                self._changed.clear()
                self._forget_ended()
                there = len(self._idle) + (0 if self._is_needed else len(self._settling))
                self._begin(self._count + self._is_needed - there - len(self._dials))
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(KEEP_EVERY_S):
                        await self._changed.wait()
                    continue
                if self._idle and not self._is_needed:  # while its ping is under way another one is given
                    self._spawn(self._put_last(self._idle.pop(0)), self._settling)
        finally:
            await _cancel(self._dials)

    async def take(self) -> Client:
        """The next one to work by: an idle one, as soon as the broker's port answers, or else one that is new."""
        self._need()
        began_s = asyncio.get_running_loop().time()
        probing = asyncio.create_task(self._probe())
        waiting: set[asyncio.Task[Any]] = {probing, asyncio.create_task(self._dialled.wait())}
        try:
            await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            if probing.done() and asyncio.get_running_loop().time() - began_s > 2 * PROBE_EVERY_S:
                self._begin(1 + self._count)  # beside those whose first packet waits to be repeated
            while True:
                while self._idle:
                    if (one := self._idle.pop(0)).is_connected:
                        return one
                self._need()
                await self._dialled.wait()
        finally:
            self._is_needed = False
            self._changed.set()  # one is missing now
            await _cancel(waiting)

    def _begin(self, dials: int) -> None:
        for _ in range(min(dials, MOST_DIALS - len(self._dials))):
            self._spawn(self._add(), self._dials)

    def _spawn(self, work: Coroutine[Any, Any, None], among: set[asyncio.Task[None]]) -> None:
        task = asyncio.create_task(work, name="spare connection")
        among.add(task)
        task.add_done_callback(among.discard)
        task.add_done_callback(lambda _: self._changed.set())

    async def _add(self) -> None:
        try:
            one = await self._dial()
        except TimeoutError:
            return
        except Exception:  # `dial` reported it; without another try a car would be lost for good
            return await asyncio.sleep(RETRY_S if self._is_needed else SPARE_RETRY_S)
        if self._is_needed and not self._dialled.is_set():
            self._idle.insert(0, one)
            return self._dialled.set()
        return self._spawn(self._put_last(one, SETTLES_S), self._settling)

    async def _put_last(self, one: Client, after_s: float = 0.0) -> None:
        """Keep it as a spare one, if the broker answers by it."""
        try:
            await asyncio.sleep(after_s)
            await one.flush(timeout=KEPT_WITHIN_S)
        except BaseException as why:  # whatever it was: it does not answer
            await self.give_up(one)
            if isinstance(why, Exception):
                return None
            raise
        self._forget_ended()
        if len(self._idle) >= self._count:
            return await self.give_up(one)
        return self._idle.append(one)

    def _forget_ended(self) -> None:
        self._idle = [one for one in self._idle if one.is_connected]

    def _need(self) -> None:
        self._is_needed = True
        self._dialled.clear()
        self._changed.set()

    async def give_up(self, one: Client) -> None:
        """From now on nothing comes by it. Nobody waits for its end: bytes may be left that cannot be sent now."""
        task = asyncio.create_task(_close(one), name="close a connection")
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)
        await asyncio.sleep(0)

    async def close(self) -> None:
        await _cancel(self._settling)
        while self._idle:
            await self.give_up(self._idle.pop())
        if self._closing:
            await asyncio.wait(self._closing, timeout=CLOSES_WITHIN_S)
        await _cancel(self._closing)

    async def _probe(self) -> None:
        """Return once the broker's port answers a dial, a new one every moment."""
        now = asyncio.get_running_loop().time
        began_s, dials = now(), set[asyncio.Task[None]]()
        self._reached.clear()
        try:
            while now() - self._reached_s >= REACHED_FOR_S:
                dials.add(asyncio.create_task(self._reach()))
                wait_s = PROBE_EVERY_S if now() - began_s < PROBE_SLOWLY_AFTER_S else PROBE_SLOWLY_S
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(wait_s):
                        await self._reached.wait()
                dials = {dial for dial in dials if not dial.done()}
        finally:
            await _cancel(dials)

    async def _reach(self) -> None:
        with contextlib.suppress(OSError, TimeoutError):
            async with asyncio.timeout(PROBE_FOR_S):
                _, writer = await asyncio.open_connection(self._host, self._port)
            writer.close()
            self._reached_s = asyncio.get_running_loop().time()
            self._reached.set()


async def _close(one: Client) -> None:
    with contextlib.suppress(Exception):  # one that never connected cannot be closed
        await one.close()


async def _cancel(tasks: Collection[asyncio.Task[Any]]) -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)

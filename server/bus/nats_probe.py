"""Whether the port of a NATS broker answers: it is dialled every moment, and what is accepted is closed at once."""

from __future__ import annotations

import asyncio
import contextlib
import random
import socket
import threading
from collections.abc import Callable

from server.system.loopback import is_ip
from server.system.supervision import cancel

EVERY_S = 0.1  # a dial into the last moment of a gap is lost, and the system repeats it after 1 or 3 s
SLOWLY_S = 1.0  # where the broker was away for a minute
SLOWLY_AFTER_S = 60.0
SPREAD = 0.1  # of that time: the agents of a broker that was lost are not to dial it in step
FOR_S = 2.0
REACHED_FOR_S = 2.0  # so long an answer counts
LOOK_UP_EVERY_S = 1.0


class PortProbe:
    """Dials `host` and `port`. `refusal_counts`: whether a port that refuses shows enough, as a reachable host."""

    def __init__(self, host: str, port: int, refusal_counts: Callable[[], bool]) -> None:
        self._host, self._port = host, port
        self._refusal_counts = refusal_counts
        self._addresses = [host] if is_ip(host) else []  # the last known ones, one of each family
        self._is_looking_up = False
        self._looked_up_s = -LOOK_UP_EVERY_S
        self._task: asyncio.Task[None] | None = None
        self._reached = asyncio.Event()
        self.reached_s = -REACHED_FOR_S

    @property
    def is_reached(self) -> bool:
        """Whether it answered of late."""
        return asyncio.get_running_loop().time() - self.reached_s < REACHED_FOR_S

    def begin(self) -> asyncio.Task[None]:
        """Ends once the port answers, or has answered of late: the probe that is under way, or a new one."""
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._run(), name="probe the broker's port")
        return self._task

    def end(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _run(self) -> None:
        now = asyncio.get_running_loop().time
        began_s, dials = now(), set[asyncio.Task[None]]()
        self._reached.clear()
        try:
            while not self.is_reached:
                self._look_up()
                dials |= {asyncio.create_task(self._reach(one)) for one in self._addresses}
                wait_s = EVERY_S if now() - began_s < SLOWLY_AFTER_S else SLOWLY_S
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(wait_s * random.uniform(1 - SPREAD, 1 + SPREAD)):
                        await self._reached.wait()
                dials = {dial for dial in dials if not dial.done()}
        finally:
            await cancel(dials)

    async def _reach(self, address: str) -> None:
        try:
            async with asyncio.timeout(FOR_S):
                _, writer = await asyncio.open_connection(address, self._port)
            writer.close()
        except ConnectionRefusedError:
            if not self._refusal_counts():
                return
        except Exception:  # whatever it was: it was not reached
            return
        self.reached_s = asyncio.get_running_loop().time()
        self._reached.set()

    def _look_up(self) -> None:
        """One at a time, and in a thread of its own: with its resolver behind the radio a lookup takes 10 s and cannot
        be cancelled, and a few of them would hold up all work in the threads that a process shares."""
        loop = asyncio.get_running_loop()
        if self._is_looking_up or is_ip(self._host) or loop.time() - self._looked_up_s < LOOK_UP_EVERY_S:
            return

        def look_up() -> None:
            found: list[str] = []
            with contextlib.suppress(OSError, UnicodeError):
                rows = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_STREAM)
                found = list({row[0]: str(row[4][0]) for row in reversed(rows)}.values())
            with contextlib.suppress(RuntimeError):  # the process ends
                loop.call_soon_threadsafe(self._looked_up, found)

        threading.Thread(target=look_up, name="look up the broker", daemon=True).start()
        self._is_looking_up = True  # no sooner: a thread may not be had

    def _looked_up(self, found: list[str]) -> None:
        self._is_looking_up, self._looked_up_s = False, asyncio.get_running_loop().time()
        self._addresses = found or self._addresses

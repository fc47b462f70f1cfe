"""Spare connections that end, do not answer or are refused: the next one is there as soon as it can be."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, cast

import pytest
from nats.aio.client import Client

from server.bus import nats_probe, nats_spares
from server.bus.nats_spares import KEEP_EVERY_S, RETRY_S, SETTLES_S, TRIED_ANYWAY_S, Spares
from tests.server.bus.buses import until
from tests.server.bus.test_nats_spares import Idle

NOWHERE = "nats://127.0.0.1:1"  # no probe reaches it


class Dials:
    """Of a broker that takes `takes` of them and refuses the others."""

    def __init__(self, takes: int) -> None:
        self.takes = takes
        self.pinged: list[str] = []
        self.made: list[Idle] = []

    async def __call__(self) -> Client:
        await asyncio.sleep(0.1)
        if len(self.made) >= self.takes:
            raise ConnectionRefusedError
        self.made.append(Idle("abcdefgh"[len(self.made)], self.pinged))
        return cast(Client, self.made[-1])


@contextlib.asynccontextmanager
async def kept(dial: Callable[[], Awaitable[Client]], count: int) -> AsyncIterator[Spares]:
    spares = Spares(dial, NOWHERE, count)
    running = asyncio.create_task(spares.run())
    try:
        yield spares
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await spares.close()


async def taken(spares: Spares, within_s: float) -> Any:
    async with asyncio.timeout(within_s):
        return await spares.take()


@pytest.mark.virtual_time
async def test_what_is_dialled_before_the_taken_connection_answers_is_taken_next_and_else_settles() -> None:
    dials = Dials(5)
    async with kept(dials, 1) as spares:
        assert (await taken(spares, 1)).name == "a"
        assert not spares.is_newer
        await asyncio.sleep(0.2)
        assert spares.is_newer
        newest = dials.made[-1]
        assert await taken(spares, 0.1) is newest
        await asyncio.sleep(0.2)
        assert spares.is_newer
        spares.works()
        assert not spares._idle, "the broker has not pinged it yet"
        await asyncio.sleep(SETTLES_S + 0.1)
        assert len(spares._idle) == 1


@pytest.mark.virtual_time
@pytest.mark.parametrize("refuses", [True, False])
async def test_an_idle_connection_is_taken_where_no_new_one_is_let_through(
    refuses: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a firewall."""

    async def open_connection(*_: Any) -> Any:
        if refuses:
            raise ConnectionRefusedError
        await asyncio.sleep(3600)

    monkeypatch.setattr(asyncio, "open_connection", open_connection)
    async with kept(Dials(2), 1) as spares:
        assert (await taken(spares, 1)).name == "a"
        spares.works()
        await asyncio.sleep(SETTLES_S + 0.3)
        assert (await taken(spares, 1 if refuses else TRIED_ANYWAY_S + 1)).name == "b"


@pytest.mark.virtual_time
async def test_what_accepts_and_stays_silent_does_not_keep_this_program_ever_busier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As a frozen broker, or a proxy of a network."""
    passes: list[float] = []
    begin = Spares._begin

    def counted(self: Spares, dials: int) -> None:
        passes.append(asyncio.get_running_loop().time())
        begin(self, dials)

    monkeypatch.setattr(Spares, "_begin", counted)

    async def dial() -> Client:
        await asyncio.sleep(6)
        raise TimeoutError

    async with kept(dial, 2) as spares:
        taking = asyncio.create_task(spares.take())
        await asyncio.sleep(600)
        assert len(passes) < 3 * 600
        taking.cancel()


async def test_a_name_is_looked_up_beside_all_other_work_and_its_last_address_is_dialled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In a gap a resolver may be behind the radio."""
    lookups: list[str] = []
    goes_on = threading.Event()
    dialled: list[str] = []

    def getaddrinfo(host: str, *_: Any, **__: Any) -> Any:
        lookups.append(host)
        if len(lookups) > 1:
            goes_on.wait(30)
            raise socket.gaierror
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("192.0.2.1", 4222))]

    async def open_connection(host: str, *_: Any) -> Any:
        dialled.append(host)
        raise OSError

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
    monkeypatch.setattr(asyncio, "open_connection", open_connection)
    monkeypatch.setattr(nats_probe, "EVERY_S", 0.01)
    monkeypatch.setattr(nats_probe, "LOOK_UP_EVERY_S", 0.05)
    probe = nats_probe.PortProbe("broker.example", 4222, lambda: False)
    try:
        probe.begin()
        await until(lambda: len(lookups) == 2)
        before = len(dialled)
        await until(lambda: len(dialled) > before + 20)
        assert await asyncio.to_thread(lambda: "at once") == "at once"
        assert len(lookups) == 2
        goes_on.set()
        await until(lambda: len(lookups) == 4)
        before = len(dialled)
        await until(lambda: len(dialled) > before)
        assert set(dialled) == {"192.0.2.1"}
    finally:
        goes_on.set()
        probe.end()


@pytest.mark.virtual_time
async def test_a_dial_that_misses_its_cancellation_is_cancelled_again() -> None:
    """asyncio.wait_for of Python 3.11 loses one that comes with its result."""
    cancelled = 0

    async def dial() -> Client:
        nonlocal cancelled
        while cancelled < 2:
            try:
                await asyncio.sleep(3600)
            except asyncio.CancelledError:
                cancelled += 1
        raise asyncio.CancelledError

    async with asyncio.timeout(5):
        async with kept(dial, 1):
            await asyncio.sleep(0.1)
    assert cancelled == 2


@pytest.mark.virtual_time
async def test_a_connection_that_settles_while_one_is_needed_is_given() -> None:
    async with kept(Dials(2), 1) as spares:
        assert (await taken(spares, 1)).name == "a"
        await asyncio.sleep(1)
        assert (await taken(spares, SETTLES_S)).name == "b"


@pytest.mark.virtual_time
async def test_where_no_spare_ones_are_kept_a_connection_that_settles_is_given_as_well() -> None:
    """As at a web node."""
    one = Idle("a", [])
    async with kept(Dials(0), 0) as spares:
        taking = asyncio.create_task(taken(spares, 2))
        await asyncio.sleep(0.05)
        spares._settle(cast(Client, one), 1)
        assert (await taking).name == "a"


@pytest.mark.virtual_time
async def test_a_second_connection_is_given_where_the_first_ends_before_it_was_given() -> None:
    async with kept(Dials(0), 0) as spares:
        taking = asyncio.create_task(taken(spares, 1))
        await asyncio.sleep(0.05)
        first, second = Idle("a", []), Idle("b", [])
        spares._dial = cast(Any, iter_of(first, second))
        adding = spares._add(), spares._add()
        await adding[0]
        first.is_connected = False
        await adding[1]
        assert (await taking).name == "b"


def iter_of(*clients: Idle) -> Callable[[], Awaitable[Idle]]:
    rest = iter(clients)

    async def dial() -> Idle:
        return next(rest)

    return dial


@pytest.mark.virtual_time
async def test_spare_connections_that_were_refused_do_not_delay_one_that_is_needed() -> None:
    dials = Dials(0)
    async with kept(dials, nats_spares.MOST_DIALS) as spares:
        await asyncio.sleep(1)  # all of them wait until they may be tried again
        dials.takes = 1
        await taken(spares, 2 * RETRY_S)


@pytest.mark.virtual_time
async def test_a_spare_connection_is_pinged_while_another_one_is_refused() -> None:
    dials = Dials(2)
    async with kept(dials, 2) as spares:
        await taken(spares, 1)
        spares.works()
        await asyncio.sleep(3.5 * KEEP_EVERY_S)
        assert dials.pinged == ["b"] * 4


async def test_a_connection_is_closed_where_its_settling_has_not_begun() -> None:
    one = Idle("a", [])
    async with kept(Dials(0), 1) as spares:
        spares._settle(cast(Client, one), SETTLES_S)
    assert not one.is_connected

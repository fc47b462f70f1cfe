"""Spare connections that end, do not answer or are refused: the next one is there as soon as it can be."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, cast

import pytest
from nats.aio.client import Client

from server.bus import nats_spares
from server.bus.nats_spares import KEEP_EVERY_S, RETRY_S, SETTLES_S, Spares
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
        await asyncio.sleep(3.5 * KEEP_EVERY_S)
        assert dials.pinged == ["b"] * 4


async def test_a_connection_is_closed_where_its_settling_has_not_begun() -> None:
    one = Idle("a", [])
    async with kept(Dials(0), 1) as spares:
        spares._settle(cast(Client, one), SETTLES_S)
    assert not one.is_connected

"""Plays messages into a bridge at their own spacing."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterable, Iterator
from itertools import islice
from typing import TypeVar

from server.judge.message import Message
from server.rosbridge_server.server import RosBridge

SOON_S = 0.0005  # nearer than this is now: the loop cannot sleep more finely
TURN_S = 0.005  # when late, others get a turn at least this often

T = TypeVar("T")


async def play(
    messages: Iterable[Message],
    bridge: RosBridge,
    *,
    rate: float = 1.0,
    clock: Callable[[], float] | None = None,
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    on_end: Callable[[], None] | None = None,
    on_message: Callable[[Message], None] | None = None,
    ahead: int = 0,
) -> int:
    """Publish every message when it is due, at `rate` times real time; return their number.

    All due times are relative to the first message, so that delays never add up: late messages are sent at once, in
    order, until none is late. The topics must have been advertised. `clock` returns seconds (monotonic
    where none is given) and `sleep` waits on it. `ahead`: so many messages are fetched in a thread before they are due,
    for sources that read files; 0 fetches each only when the one before it is out, for sources that react to what
    happens.
    """
    if not rate > 0:
        raise ValueError("the rate must be above 0")
    clock_s = clock or time.monotonic
    count = 0
    first_at_s = began_s = 0.0
    turn_ends = time.monotonic() + TURN_S
    async with contextlib.aclosing(_fetched(iter(messages), ahead)) as fetched:
        async for message in fetched:
            if count == 0:
                first_at_s, began_s = message.at_s, clock_s()
            wait_s = began_s + (message.at_s - first_at_s) / rate - clock_s()
            if wait_s > SOON_S:
                await sleep(wait_s)
                turn_ends = time.monotonic() + TURN_S
            elif time.monotonic() > turn_ends:
                await asyncio.sleep(0)
                turn_ends = time.monotonic() + TURN_S
            bridge.publish(message.topic, message.message)
            count += 1
            if on_message is not None:
                on_message(message)
    if on_end is not None:
        on_end()
    return count


async def _fetched(source: Iterator[T], ahead: int) -> AsyncGenerator[T, None]:
    if ahead <= 0:
        for item in source:
            yield item
        return
    fetch = asyncio.create_task(asyncio.to_thread(_take, source, ahead))
    try:
        while batch := await fetch:
            fetch = asyncio.create_task(asyncio.to_thread(_take, source, ahead))
            for item in batch:
                yield item
    finally:  # the caller may close the source next: wait for the thread to leave it
        if not fetch.done():
            await asyncio.wait({fetch})
        if not fetch.cancelled():
            fetch.exception()  # seen, should there be one


def _take(source: Iterator[T], count: int) -> list[T]:
    return list(islice(source, count))

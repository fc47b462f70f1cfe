"""Plays messages into a bridge at their own spacing, with later stamps where a recording is repeated."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterable, Iterator
from itertools import islice
from typing import Any, TypeVar

from server.judge.message import Json, Message
from server.rosbridge_server.server import RosBridge

_NS = 10**9
_TIMES = (("secs", "nsecs"), ("sec", "nanosec"))  # of ROS 1, of ROS 2
_MOST = {"secs": 2**32 - 1, "sec": 2**31 - 1}  # seconds: beyond, there is no such stamp
DEEPEST = 8  # levels; stamps of the standard messages are at most 3 deep

SOON_S = 0.0005  # nearer than this is now: the loop cannot sleep more finely
TURN_S = 0.005  # when late, others get a turn at least this often

T = TypeVar("T")


def moved(message: Json, by_s: float) -> Json:
    """The message with each field `stamp` later by so much; a copy where there is any. A stamp of zero is none."""
    if not by_s:
        return message
    found = _moved(message, round(by_s * _NS), DEEPEST)
    return found if isinstance(found, dict) else message


def _moved(value: Any, by_ns: int, deep: int) -> Any:
    """A changed copy, or the very same where there is no stamp in it."""
    if deep == 0:
        return value
    if isinstance(value, dict):
        changed: dict[str, Any] = {}
        for name, one in value.items():
            if not isinstance(one, dict | list):
                continue
            other = _later(one, by_ns) if name == "stamp" else _moved(one, by_ns, deep - 1)
            if other is not one:
                changed[name] = other
        return {**value, **changed} if changed else value
    if isinstance(value, list) and value and isinstance(value[0], dict):
        others = [_moved(one, by_ns, deep - 1) for one in value]
        return others if any(other is not one for other, one in zip(others, value, strict=True)) else value
    return value


def _later(stamp: Any, by_ns: int) -> Any:
    for seconds, parts in _TIMES:
        if isinstance(stamp, dict) and stamp.keys() == {seconds, parts}:
            whole, part = stamp[seconds], stamp[parts]
            if not (isinstance(whole, int) and isinstance(part, int)) or not (whole or part):
                return stamp
            later, part = divmod(whole * _NS + part + by_ns, _NS)
            return {seconds: later, parts: part} if 0 <= later <= _MOST[seconds] else stamp
    return stamp


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

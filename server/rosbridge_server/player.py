"""Plays messages into a bridge at their own spacing, with later stamps where a recording is repeated."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable, Iterable, Iterator
from itertools import islice
from typing import Any, Protocol, TypeVar

from server.judge.message import Json, Message
from server.recording.read.decode import fields_of
from server.recording.read.errors import Undecodable
from server.rosbridge_server.encoding import Outgoing
from server.rosbridge_server.server import RosBridge

_NS = 10**9
_TIMES = (("secs", "nsecs"), ("sec", "nanosec"))  # of ROS 1, of ROS 2
_MOST = {"secs": 2**32 - 1, "sec": 2**31 - 1}  # seconds: beyond, there is no such stamp
DEEPEST = 8  # levels; stamps of the standard messages are at most 3 deep

SOON_S = 0.0005  # nearer than this is now: the loop cannot sleep more finely
TURN_S = 0.005  # when late, others get a turn at least this often
PREPARED = 64  # messages that are encoded together before they are due: one by one takes several times as long

T = TypeVar("T")


def moved(message: Json, by_s: float) -> Json:
    """The message with each field `stamp` later by so much; a copy where there is any. A stamp of zero is none."""
    if not by_s:
        return message
    try:
        fields = fields_of(message)
    except Undecodable:
        return message
    found = _moved(fields, round(by_s * _NS), DEEPEST)
    return found if found is not fields and isinstance(found, dict) else message


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


class Timer(Protocol):
    """What a loop's `call_later` returns."""

    def cancel(self) -> None: ...


async def play(
    messages: Iterable[Message],
    bridge: RosBridge,
    *,
    rate: float = 1.0,
    clock: Callable[[], float] | None = None,
    call_later: Callable[[float, Callable[[], None]], Timer] | None = None,
    on_message: Callable[[Message], None] | None = None,
    ahead: int = 0,
) -> int:
    """Publish every message when it is due, at `rate` times real time; return their number.

    All due times are relative to the first message, so that delays never add up: late messages are sent at once, in
    order, until none is late. The topics must have been advertised. `clock` returns seconds (monotonic where none is
    given) and `call_later` waits on it (the loop's where none is given). `ahead`: so many messages are fetched in a
    thread before they are due, for sources that read files; 0 fetches each only when the one before it is out, for
    sources that react to what happens.
    """
    if not rate > 0:
        raise ValueError("the rate must be above 0")
    call_later = call_later or asyncio.get_running_loop().call_later
    playing = _Playing(bridge, rate, clock or time.monotonic, call_later, on_message)
    count = 0
    async with contextlib.aclosing(_fetched(iter(messages), ahead)) as fetched:
        async for batch in fetched:
            count += len(batch)
            await playing.play(batch)
    return count


class _Playing:
    """Publishes messages when they are due, in callbacks of the loop; waking a task takes another cycle of it."""

    def __init__(
        self,
        bridge: RosBridge,
        rate: float,
        clock: Callable[[], float],
        call_later: Callable[[float, Callable[[], None]], Timer],
        on_message: Callable[[Message], None] | None,
    ) -> None:
        self._bridge = bridge
        self._rate = rate
        self._clock = clock
        self._call_later = call_later
        self._on_message = on_message
        self._origin: tuple[float, float] | None = None  # recorded time and time of the clock
        self._turn_ends = time.monotonic() + TURN_S
        self._batch: deque[Message] = deque()  # what is not published yet
        self._prepared: deque[Outgoing] = deque()  # the next messages
        self._timer: Timer | None = None
        self._played: asyncio.Future[None]

    async def play(self, batch: deque[Message]) -> None:
        """Returns when the last message is published; each is removed from the batch then, for it may be large."""
        if self._origin is None:
            self._origin = batch[0].at_s, self._clock()
        self._batch = batch
        self._played = asyncio.get_running_loop().create_future()
        self._step()
        try:
            await self._played
        finally:
            if self._timer is not None:
                self._timer.cancel()

    def _begin_turn(self) -> None:
        self._turn_ends = time.monotonic() + TURN_S
        self._step()

    def _step(self) -> None:
        if self._played.done():  # cancelled: its timer may fire before the task wakes
            return
        try:
            next_s = self._publish_due()
        except Exception as error:
            self._played.set_exception(error)
            return
        if next_s is None:
            self._played.set_result(None)
        else:
            self._timer = self._call_later(next_s, self._begin_turn)

    def _publish_due(self) -> float | None:
        """Publishes until nothing is due or the turn is over; returns the time until the next step, None at the end."""
        batch, prepared = self._batch, self._prepared
        with self._bridge.writing_together:
            while batch and self._wait_s() <= SOON_S:
                if time.monotonic() > self._turn_ends:
                    return 0.0
                message = batch.popleft()
                self._bridge.publish(message.topic, prepared.popleft() if prepared else message.message)
                if self._on_message is not None:
                    self._on_message(message)
        if not batch:
            return None
        if not prepared:
            self._prepare()
        return max(0.0, self._wait_s())

    def _prepare(self) -> None:
        """Encodes the next messages until one is due or the turn is over."""
        for message in islice(self._batch, PREPARED):
            self._prepared.append(self._bridge.prepare(message.topic, message.message))
            if self._wait_s() <= SOON_S or time.monotonic() > self._turn_ends:
                return

    def _wait_s(self) -> float:
        """Until the next message is due."""
        assert self._origin is not None
        first_at_s, began_s = self._origin
        return began_s + (self._batch[0].at_s - first_at_s) / self._rate - self._clock()


async def _fetched(source: Iterator[T], ahead: int) -> AsyncGenerator[deque[T], None]:
    if ahead <= 0:
        for item in source:
            yield deque([item])
        return
    fetch = asyncio.create_task(asyncio.to_thread(_take, source, ahead))
    try:
        while batch := await fetch:
            fetch = asyncio.create_task(asyncio.to_thread(_take, source, ahead))
            yield batch
    finally:  # the caller may close the source next: wait for the thread to leave it
        if not fetch.done():
            await asyncio.wait({fetch})
        if not fetch.cancelled():
            fetch.exception()  # seen, should there be one


def _take(source: Iterator[T], count: int) -> deque[T]:
    return deque(islice(source, count))

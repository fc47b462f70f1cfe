"""Messages played at their own spacing."""

from __future__ import annotations

import asyncio
import math
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from server.judge.message import Message
from server.rosbridge_server import player
from server.rosbridge_server.player import SOON_S, play
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.probe import Probe


def drive(count: int, period_s: float = 0.01, begin_s: float = 1464818234.0) -> Iterator[Message]:
    for number in range(count):
        yield Message(at_s=begin_s + number * period_s, topic="/n", type="std_msgs/Int32", message={"data": number})


@pytest.fixture
def numbers(bridge: RosBridge) -> RosBridge:
    bridge.advertise("/n", "std_msgs/Int32")
    return bridge


class Watch:
    """A clock of the test's own, on which every timer lasts a little too long."""

    def __init__(self, late_s: float) -> None:
        self.now_s = 1000.0
        self.late_s = late_s

    def __call__(self) -> float:
        return self.now_s

    def call_later(self, wait_s: float, callback: Callable[[], None]) -> asyncio.Handle:
        self.now_s += wait_s + self.late_s
        return asyncio.get_running_loop().call_soon(callback)


@pytest.mark.parametrize("ahead", [0, 16])
@pytest.mark.parametrize("rate", [1.0, 10.0])
async def test_messages_come_when_they_are_due_and_lateness_never_adds_up(
    numbers: RosBridge, probe: Probe, ahead: int, rate: float
) -> None:
    await probe.subscribe("/n")
    watch, came_s = Watch(late_s=0.0009), []

    def note(message: Message) -> None:
        came_s.append(watch.now_s - 1000.0)

    await play(drive(200), numbers, rate=rate, clock=watch, call_later=watch.call_later, ahead=ahead, on_message=note)
    due_s = [n * 0.01 / rate for n in range(200)]
    assert all(-SOON_S <= came - due <= 0.0015 for came, due in zip(came_s, due_s, strict=True))
    assert [(await probe.hear())["msg"]["data"] for _ in range(200)] == list(range(200))


async def test_what_is_late_catches_up_without_a_gap(numbers: RosBridge) -> None:
    watch, came_s = Watch(late_s=0.0), []

    def stall(message: Message) -> None:
        came_s.append(round(watch.now_s - 1000.0, 6))
        if message.message["data"] == 10:
            watch.now_s += 0.2

    await play(drive(60), numbers, clock=watch, call_later=watch.call_later, on_message=stall)
    assert came_s[11:31] == pytest.approx([0.3] * 20, abs=0.001)  # at once after the stall
    assert came_s[31:] == pytest.approx([n * 0.01 for n in range(31, 60)], abs=0.001)  # and in step again


@pytest.mark.field
async def test_on_the_real_clock_it_takes_its_time(numbers: RosBridge) -> None:
    began = time.monotonic()
    await play(drive(101), numbers, rate=2.0)
    assert 0.499 <= time.monotonic() - began < 0.9


async def test_others_get_their_turn_while_it_hurries(numbers: RosBridge, probe: Probe) -> None:
    """Long before it is at its end, however fast the machine."""
    played: list[Message] = []
    playing = asyncio.ensure_future(play(drive(200_000, period_s=0.0), numbers, on_message=played.append))
    assert (await probe.call("/rosapi/get_time"))["result"] is True
    assert 0 < len(played) < 100_000
    assert not playing.done()
    playing.cancel()
    await asyncio.wait({playing})


async def test_a_live_source_is_read_one_message_at_a_time(numbers: RosBridge) -> None:
    requested, played = [], []

    def live() -> Iterator[Message]:
        for message in drive(20):
            requested.append(len(played))
            yield message

    await play(live(), numbers, on_message=played.append)
    assert requested == list(range(20))


async def test_a_source_that_breaks_says_so_after_what_was_good(numbers: RosBridge) -> None:
    def breaking() -> Iterator[Message]:
        yield from drive(5, period_s=0.0)
        raise OSError("the disk is gone")

    for ahead in (0, 1, 64):
        played: list[Message] = []
        with pytest.raises(OSError, match="the disk is gone"):
            await play(breaking(), numbers, ahead=ahead, on_message=played.append)
        assert len(played) == (5 if ahead < 2 else 0) or ahead == 64


@pytest.mark.field
async def test_cancelling_waits_for_the_reading_thread(numbers: RosBridge) -> None:
    inside = threading.Event()
    closed = threading.Event()

    def slow() -> Iterator[Message]:
        for message in drive(1_000):
            inside.set()
            time.sleep(0.05)
            assert not closed.is_set(), "read after it was closed"
            yield message

    playing = asyncio.ensure_future(play(slow(), numbers, ahead=4))
    await asyncio.to_thread(inside.wait)
    playing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await playing
    closed.set()
    await asyncio.sleep(0.1)


@pytest.mark.parametrize("count", [2, 3])
async def test_nothing_is_published_after_cancelling_while_late(
    numbers: RosBridge, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A timer may fire after the cancelling and before the task wakes, for the last message or an earlier one."""
    monkeypatch.setattr(player, "TURN_S", math.inf)
    wrong: list[object] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: wrong.append(context))
    played: list[Message] = []
    timers: list[Callable[[], None]] = []

    def call_later(_: float, callback: Callable[[], None]) -> asyncio.Handle:
        timers.append(callback)
        return loop.call_soon(lambda: None)

    watch = Watch(late_s=0.0)
    playing = asyncio.ensure_future(
        play(drive(count), numbers, clock=watch, call_later=call_later, ahead=16, on_message=played.append)
    )
    while not timers:
        await asyncio.sleep(0)
    watch.now_s += 0.01  # the second one is due
    loop.call_soon(timers.pop())  # before the task wakes
    playing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await playing
    assert (len(played), timers, wrong) == (1, [], [])


async def test_a_published_message_is_released(numbers: RosBridge) -> None:
    class Content(dict[str, Any]):
        """A message that can be watched."""

    contents: list[weakref.ref[Content]] = []
    alive: list[int] = []

    def messages() -> Iterator[Message]:
        for message in drive(20):
            content = Content(message.message)
            contents.append(weakref.ref(content))
            yield replace(message, message=content)

    def count_alive(_: Message) -> None:
        alive.append(sum(one() is not None for one in contents))

    await play(messages(), numbers, rate=1e6, ahead=512, on_message=count_alive)
    assert len(alive) == 20
    assert alive[-1] <= 2


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
async def test_a_senseless_rate_is_refused(numbers: RosBridge, rate: float) -> None:
    with pytest.raises(ValueError, match="rate must be above 0"):
        await play(drive(1), numbers, rate=rate)


async def test_nothing_to_play_is_no_mistake(numbers: RosBridge) -> None:
    assert await play(iter(()), numbers) == 0

"""Messages played at their own spacing."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator

import pytest

from server.bridge.player import play
from server.bridge.server import RosBridge
from server.source import Message
from tests.server.bridge.probe import Probe


def drive(count: int, period_s: float = 0.01, begin_s: float = 1464818234.0) -> Iterator[Message]:
    for number in range(count):
        yield Message(at_s=begin_s + number * period_s, topic="/n", type="std_msgs/Int32", message={"data": number})


@pytest.fixture
def numbers(bridge: RosBridge) -> RosBridge:
    bridge.advertise("/n", "std_msgs/Int32")
    return bridge


@pytest.mark.parametrize("ahead", [0, 16])
async def test_messages_come_in_order_at_their_spacing(numbers: RosBridge, probe: Probe, ahead: int) -> None:
    await probe.subscribe("/n")
    lateness: list[float] = []
    began = time.monotonic()
    played = asyncio.ensure_future(
        play(
            drive(100),
            numbers,
            ahead=ahead,
            on_message=lambda m: lateness.append(time.monotonic() - began - m.message["data"] * 0.01),
        )
    )
    heard = [(await probe.hear())["msg"]["data"] for _ in range(100)]
    assert await played == 100
    assert heard == list(range(100))
    late = sorted(lateness)
    assert late[0] > -0.001  # never early
    assert late[50] < 0.008
    assert lateness[-1] < 0.05  # and lateness does not add up


async def test_the_rate_shortens_the_spacing(numbers: RosBridge) -> None:
    began = time.monotonic()
    await play(drive(100), numbers, rate=10.0)
    assert 0.095 <= time.monotonic() - began < 0.3


async def test_what_is_late_catches_up_without_a_gap(numbers: RosBridge) -> None:
    times: list[float] = []

    def stall(message: Message) -> None:
        times.append(time.monotonic())
        if message.message["data"] == 10:
            time.sleep(0.2)

    began = time.monotonic()
    await play(drive(60), numbers, on_message=stall)
    assert times[29] - times[11] < 0.1  # sent at once after the stall
    assert times[59] - began < 0.7  # back in step: 0.59 s is its due


async def test_others_get_their_turn_while_it_hurries(numbers: RosBridge, probe: Probe) -> None:
    playing = asyncio.ensure_future(play(drive(200_000, period_s=0.0), numbers))
    began = time.monotonic()
    assert (await probe.call("/rosapi/get_time"))["result"] is True
    assert time.monotonic() - began < 0.2
    assert not playing.done()
    playing.cancel()
    await asyncio.wait({playing})


async def test_a_given_clock_decides(numbers: RosBridge) -> None:
    clock_s = 0.0

    def fast() -> float:
        nonlocal clock_s
        clock_s += 100.0
        return clock_s

    began = time.monotonic()
    assert await play(drive(50, period_s=10.0), numbers, clock=fast) == 50
    assert time.monotonic() - began < 0.5


async def test_a_live_source_is_asked_for_one_message_at_a_time(numbers: RosBridge) -> None:
    asked, played = [], []

    def live() -> Iterator[Message]:
        for message in drive(20):
            asked.append(len(played))
            yield message

    ended: list[bool] = []
    await play(live(), numbers, on_message=played.append, on_end=lambda: ended.append(True))
    assert asked == list(range(20))
    assert ended == [True]


async def test_a_source_that_breaks_says_so_after_what_was_good(numbers: RosBridge) -> None:
    def breaking() -> Iterator[Message]:
        yield from drive(5, period_s=0.0)
        raise OSError("the disk is gone")

    for ahead in (0, 1, 64):
        played: list[Message] = []
        with pytest.raises(OSError, match="the disk is gone"):
            await play(breaking(), numbers, ahead=ahead, on_message=played.append)
        assert len(played) == (5 if ahead < 2 else 0) or ahead == 64


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


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
async def test_a_senseless_rate_is_refused(numbers: RosBridge, rate: float) -> None:
    with pytest.raises(ValueError, match="rate must be above 0"):
        await play(drive(1), numbers, rate=rate)


async def test_nothing_to_play_is_no_mistake(numbers: RosBridge) -> None:
    assert await play(iter(()), numbers) == 0

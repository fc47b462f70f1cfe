"""A link that is up and dead is found within 2 s; one that is only slow is left alone."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import signal
import sys
import time
from collections.abc import AsyncIterator
from typing import Any

import pytest
from websockets.asyncio.server import ServerConnection
from websockets.frames import Frame, Opcode

from server.rosbridge.subscription import Subscription
from tests.server.link_listener import Bridge, LinkListener, accept, answering, bridging, linked, text_frame

A_BRIDGE = """
import asyncio
from server.rosbridge_server.server import RosBridge

async def main():
    bridge = RosBridge(ros_version=1)
    bridge.advertise("/vel", "geometry_msgs/Twist")
    print(await bridge.start("127.0.0.1", 0), flush=True)
    while True:
        bridge.publish("/vel", {"linear": {"x": 1.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}})
        await asyncio.sleep(0.05)

asyncio.run(main())
"""


@contextlib.asynccontextmanager
async def process() -> AsyncIterator[tuple[asyncio.subprocess.Process, int]]:
    """A bridge in a process of its own that can be stopped as a hung computer stops; with its port."""
    running = await asyncio.create_subprocess_exec(sys.executable, "-c", A_BRIDGE, stdout=asyncio.subprocess.PIPE)
    assert running.stdout is not None
    try:
        yield running, int(await asyncio.wait_for(running.stdout.readline(), 60))
    finally:
        with contextlib.suppress(ProcessLookupError):
            running.send_signal(signal.SIGCONT)
            running.kill()
        await running.communicate()


@pytest.mark.field
async def test_a_stopped_process_is_found_within_2_s_and_its_return_too() -> None:
    listener = LinkListener()
    async with process() as (bridge, port), linked(f"127.0.0.1:{port}", listener) as link:
        link.subscribe(Subscription(topic="/vel", type="geometry_msgs/Twist"))
        await listener.wait_for("message", 5)
        os.kill(bridge.pid, signal.SIGSTOP)
        stopped_s = time.monotonic()
        problem = await listener.wait_for("closed", within_s=3.0)
        assert problem.code == "bridge_silent"
        assert 1.4 < time.monotonic() - stopped_s < 2.0
        assert link.heard_s == pytest.approx(stopped_s, abs=0.3)
        os.kill(bridge.pid, signal.SIGCONT)
        messages = len(listener.all("message"))
        await listener.wait_for("message", messages + 5, within_s=4.0)
        assert len(listener.all("opened")) == 2


@pytest.mark.virtual_time
@pytest.mark.parametrize("talks_before", [True, False])
async def test_a_bridge_that_neither_reads_nor_pongs_is_found_within_2_s(talks_before: bool) -> None:
    listener = LinkListener()
    fell_silent_s = 0.0

    async def fall_silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal fell_silent_s
        await accept(reader, writer)
        reader._transport.pause_reading()  # type: ignore[attr-defined]
        for _ in range(30 if talks_before else 0):
            writer.write(text_frame(b'{"op":"publish","topic":"/a","msg":{"a":12}}'))
            await asyncio.sleep(0.013)
        fell_silent_s = time.monotonic()
        await asyncio.sleep(5)

    async with answering(fall_silent) as port, linked(f"127.0.0.1:{port}", listener):
        await listener.wait_for("opened")
        assert (await listener.wait_for("closed", within_s=4.0)).code == "bridge_silent"
        assert 1.55 < time.monotonic() - fell_silent_s < 1.75
        assert len(listener.all("message")) == (30 if talks_before else 0)


def count_pings(bridge: Bridge, pings: list[float], *, pong_after_s: float = 0.0) -> None:
    """Makes the newest connection of the bridge count pings, and answer them late."""
    connection: ServerConnection = bridge.socket
    protocol = connection.protocol
    receive = protocol.recv_frame

    def count(frame: Frame) -> None:
        if frame.opcode is not Opcode.PING:
            receive(frame)
            return
        pings.append(time.monotonic())

        def pong() -> None:
            protocol.send_pong(frame.data)
            connection.send_data()

        connection.loop.call_later(pong_after_s, pong)

    protocol.recv_frame = count  # type: ignore[method-assign]


@pytest.mark.virtual_time
async def test_a_slow_way_is_not_a_silent_one() -> None:
    """A radio link with 1.1 s there and back."""
    listener = LinkListener()
    pings: list[float] = []
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        count_pings(bridge, pings, pong_after_s=1.1)
        await asyncio.sleep(2.6)
        assert [name for name, _ in listener.received] == ["opened"]
        assert pings


@pytest.mark.virtual_time
async def test_pings_come_at_one_rate_also_where_the_car_talks() -> None:
    """Each answer bounds how old what comes after it can be."""
    listener = LinkListener()
    pings: list[float] = []
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        count_pings(bridge, pings)
        await asyncio.sleep(1.05)
        assert link.heard_s is not None
        assert time.monotonic() - link.heard_s <= 0.1
        for _ in range(60):
            await bridge.say({"op": "publish", "topic": "/a", "msg": {}})
            await asyncio.sleep(0.013)
        gaps_s = [later - earlier for earlier, later in itertools.pairwise(pings)]
        assert len(gaps_s) >= 17  # in 1.83 s
        assert gaps_s == pytest.approx([0.1] * len(gaps_s), abs=0.001)


def hold_up(seconds: float) -> None:
    """As a callback that takes so long."""
    loop: Any = asyncio.get_running_loop()
    loop.setup_looptime(start=loop.time() + seconds)


@pytest.mark.virtual_time
async def test_held_up_ourselves_we_do_not_blame_the_bridge() -> None:
    """The loop stands still longer than any silence may last, and with it the bridge in the same process."""
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        await asyncio.sleep(0.35)  # so that no ping is on its way
        hold_up(2.0)
        await asyncio.sleep(0.5)
        assert listener.all("closed") == []


@pytest.mark.virtual_time
async def test_held_up_while_the_bridge_died_it_is_found_all_the_same() -> None:
    listener = LinkListener()

    async def fall_silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        reader._transport.pause_reading()  # type: ignore[attr-defined]
        await asyncio.sleep(8)

    async with answering(fall_silent) as port, linked(f"127.0.0.1:{port}", listener):
        await listener.wait_for("opened")
        hold_up(2.0)
        assert (await listener.wait_for("closed", within_s=0.11)).code == "bridge_silent"


@pytest.mark.virtual_time
async def test_a_large_message_that_trickles_in_is_life() -> None:
    """2 s for one message, with all pongs behind it."""
    listener = LinkListener()

    async def trickle(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        frame = text_frame(b'{"op":"publish","topic":"/a","msg":"%s"}' % (b"x" * 70_000))
        for at in range(0, len(frame), 2000):
            writer.write(frame[at : at + 2000])
            await asyncio.sleep(0.06)
        await asyncio.sleep(5)

    async with answering(trickle) as port, linked(f"127.0.0.1:{port}", listener):
        await listener.wait_for("message", within_s=8.0)
        assert listener.all("closed") == []

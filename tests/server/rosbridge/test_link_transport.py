"""What a link does to its socket, in real time and on both event loops: opening, dropping, ending, and a full pipe."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import socket
import ssl
from pathlib import Path

import psutil
import pytest

from tests.server.link_listener import LinkListener, accept, answering, black_hole, bridging, linked, until
from tests.server.rosbridge.rows import ANY, OVER, ROWS, SCAN, SPEED

pytestmark = pytest.mark.both_loops


async def test_twenty_reconnects_multiply_no_subscription() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        bridge.hangs_up = True
        for row in (SPEED, SCAN, ANY):
            link.subscribe(row)
        for opening in range(1, 21):
            await listener.wait_for("opened", opening)
            await listener.wait_for("closed", opening)
            if opening == 20:
                bridge.hangs_up = False
            await asyncio.sleep(0)
            link.retry_now()
        await listener.wait_for("opened", 21)
        link.send_now(OVER)
        await until(lambda: OVER in bridge.operations)
        assert bridge.operations == [*ROWS, OVER]
        assert len(bridge.connections) == link.attempts == 21
        assert [name for name, _ in listener.received] == ["opened", "closed"] * 20 + ["opened"]


@pytest.mark.field
async def test_a_goodbye_that_cannot_be_answered_ends_the_link_all_the_same() -> None:
    """The bridge reads nothing, so that our answer stays in the pipe for ever."""
    listener = LinkListener()
    sent = asyncio.Event()

    async def leave(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        reader._transport.pause_reading()  # type: ignore[attr-defined]
        await sent.wait()
        writer.write(b"\x88\x00")
        await asyncio.sleep(5)

    async with answering(leave) as port, linked(f"127.0.0.1:{port}", listener) as link:
        await listener.wait_for("opened")
        link._socket.sendMessage(b"x" * 12_000_000)  # type: ignore[union-attr]
        sent.set()
        assert (await listener.wait_for("closed", within_s=1.2)).code == "closed"


@pytest.mark.field
async def test_what_a_dropped_link_still_held_is_never_delivered() -> None:
    """The bridge stops reading with commands on their way to it: once the link is dropped, they are void."""
    listener = LinkListener()
    got = bytearray()
    may_read = asyncio.Event()
    is_read = asyncio.Event()
    listening = socket.socket()
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    listening.bind(("127.0.0.1", 0))

    async def stop_reading(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        reader._transport.pause_reading()  # type: ignore[attr-defined]
        await may_read.wait()
        reader._transport.resume_reading()  # type: ignore[attr-defined]
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(65536):
                got.extend(data)
        is_read.set()

    async with answering(stop_reading, sock=listening) as port, linked(f"127.0.0.1:{port}", listener) as link:
        await listener.wait_for("opened")
        for _ in range(100):
            link._socket.sendMessage(b"x" * 10_000)  # type: ignore[union-attr]
        assert (await listener.wait_for("closed", within_s=2.5)).code == "bridge_silent"
        link.stop()
        may_read.set()
        await asyncio.wait_for(is_read.wait(), 3)
        assert len(got) < 300_000  # what the bridge's own machine had taken already; a million was sent


@pytest.mark.field
async def test_a_hundred_openings_leave_nothing_behind() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        bridge.hangs_up = True
        link.subscribe(ANY)
        await listener.wait_for("closed", 1)
        before: tuple[int, int, int] = (0, 0, 0)
        process = psutil.Process()
        for opening in range(1, 101):
            await listener.wait_for("closed", opening)
            if opening in (10, 100):
                for socket_ in bridge.sockets:
                    await socket_.wait_closed()
                bridge.sockets.clear()
                gc.collect()
                now = (len(asyncio.all_tasks()), process.num_fds(), process.num_threads())
                assert opening == 10 or now == before
                before = now
            await asyncio.sleep(0)
            link.retry_now()


@pytest.mark.field
async def test_ended_while_dialling() -> None:
    listener = LinkListener()
    with black_hole() as port:
        before = asyncio.all_tasks()
        fds = psutil.Process().num_fds()
        async with linked(f"127.0.0.1:{port}", listener):
            await asyncio.sleep(0.1)
        await until(lambda: asyncio.all_tasks() == before, within_s=0.3)
        await until(lambda: psutil.Process().num_fds() <= fds + 1, within_s=0.3)  # uvloop keeps one of its own
    assert listener.received == []


async def test_secure(certificate: Path, secure: ssl.SSLContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    listener = LinkListener()
    async with bridging(ssl=secure) as bridge, linked(f"wss://127.0.0.1:{bridge.port}", listener) as link:
        await listener.wait_for("opened")
        link.send_now({"op": "unsubscribe", "id": "a", "topic": "/a"})
        await until(lambda: bridge.operations)
        await bridge.say({"op": "publish", "topic": "/a", "msg": 1})
        assert await listener.wait_for("message") == ("/a", 1, None)
        link.abort()
        await listener.wait_for("opened", 2)

"""The bridge as a process among others: its port, its clients, and how it freezes and dies."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import time
import urllib.error
import urllib.request

import pytest
import websockets
from websockets.frames import Frame, Opcode

from server.rosbridge_server.connection import HANDSHAKE_S
from server.rosbridge_server.server import CannotListen, RosBridge
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import Probe, probing, until

TEXT = {"data": "hello"}


@pytest.fixture
def talk(bridge: RosBridge) -> RosBridge:
    bridge.advertise("/talk", "std_msgs/String")
    return bridge


async def test_a_port_in_use_is_said_in_one_sentence(port: int) -> None:
    with pytest.raises(CannotListen, match=f"port {port} on 127.0.0.1 is already in use by another program"):
        await RosBridge().start(port=port)


@pytest.mark.parametrize(
    ("host", "port", "why"),
    [
        ("203.0.113.7", 0, "203.0.113.7 is not an address of this machine"),
        ("no.such.host.invalid", 0, "not an address of this machine"),
        ("x" * 300, 0, "not an address of this machine"),
        ("127.0.0.1", 70_000, "70000 is not a port"),
    ],
)
async def test_a_wrong_address_is_said_in_one_sentence(host: str, port: int, why: str) -> None:
    with pytest.raises(CannotListen, match=why):
        await RosBridge().start(host, port)


async def test_starting_twice_is_a_mistake(bridge: RosBridge) -> None:
    with pytest.raises(RuntimeError, match="already listening"):
        await bridge.start()


async def test_stopping_says_goodbye_and_frees_the_port(talk: RosBridge, port: int, probe: Probe) -> None:
    await probe.subscribe("/talk")
    talk.publish("/talk", TEXT)
    await talk.stop()
    assert (await probe.hear())["msg"] == TEXT  # what was published before still arrives
    with pytest.raises(websockets.ConnectionClosedOK):
        await probe.hear()
    await talk.stop()  # once more does no harm
    again = RosBridge()
    assert await again.start(port=port) == port
    await again.stop()


@pytest.mark.virtual_time
async def test_a_frozen_bridge_answers_nothing_and_keeps_its_clients(talk: RosBridge, port: int, probe: Probe) -> None:
    await probe.subscribe("/talk")
    talk.freeze()
    talk.publish("/talk", {"data": "kept"})
    await probe.send(op="call_service", service="/rosapi/get_time", id="t")
    pong = await probe.socket.ping()
    newcomer = asyncio.ensure_future(websockets.connect(f"ws://127.0.0.1:{port}").__aenter__())
    assert await probe.hears_nothing(0.3)
    assert not pong.done()
    assert not newcomer.done()
    assert talk.clients == 1
    talk.thaw()
    assert {(await probe.hear())["op"], (await probe.hear())["op"]} == {"publish", "service_response"}
    await asyncio.wait_for(pong, 2)
    await (await asyncio.wait_for(newcomer, 2)).close()


@pytest.mark.field
async def test_a_freeze_is_total_for_a_client_that_sends_much(bridge: RosBridge, probe: Probe) -> None:
    handled = 0

    def toil(args: object) -> dict[str, int]:
        nonlocal handled
        handled += 1
        time.sleep(0.001)
        return {}

    bridge.add_service("/toil", "demo/Toil", toil)
    call = json.dumps({"op": "call_service", "service": "/toil"}).encode()
    probe.socket.transport.write(b"".join(Frame(Opcode.TEXT, call).serialize(mask=True) for _ in range(200)))
    await until(lambda: handled > 20)
    bridge.freeze()  # many wait to be handled, and websockets has stopped reading for that
    before = handled
    pong = await probe.socket.ping()
    await asyncio.sleep(0.3)
    assert handled <= before + 1
    assert not pong.done()
    bridge.thaw()
    for _ in range(200):
        await probe.hear_op("service_response")
    await asyncio.wait_for(pong, 2)


@pytest.mark.virtual_time
async def test_a_frozen_bridge_answers_nothing_even_when_websockets_resumes_reading(
    bridge: RosBridge, probe: Probe
) -> None:
    await probe.settle()
    bridge.freeze()
    [connection] = bridge._listener._sockets
    connection.transport.resume_reading()  # as websockets does when its queue has room again
    pong = await probe.socket.ping()
    await asyncio.sleep(0.1)
    assert not pong.done()
    bridge.thaw()
    await asyncio.wait_for(pong, 2)


async def test_a_killed_bridge_drops_all_and_refuses_until_revived(talk: RosBridge, port: int, probe: Probe) -> None:
    await probe.subscribe("/talk")
    await talk.kill()
    with pytest.raises(websockets.ConnectionClosedError) as closed:
        await probe.hear()
    assert closed.value.rcvd is None  # no goodbye
    with pytest.raises(ConnectionRefusedError):
        await websockets.connect(f"ws://127.0.0.1:{port}")
    assert talk.clients == 0
    talk.publish("/talk", TEXT)  # the car goes on without its bridge
    await talk.revive()
    async with probing(port) as again:
        await again.subscribe("/talk")
        talk.publish("/talk", TEXT)
        assert (await again.hear())["msg"] == TEXT


async def test_a_frozen_bridge_can_be_killed_and_comes_back_awake(talk: RosBridge, port: int, probe: Probe) -> None:
    talk.freeze()
    await talk.kill()
    await talk.revive()
    async with probing(port) as again:
        assert (await again.call("/rosapi/get_time"))["result"] is True


async def test_flaps_leave_no_task_and_no_descriptor(talk: RosBridge, port: int) -> None:
    before = len(asyncio.all_tasks()), len(os.listdir("/proc/self/fd"))
    for _ in range(30):
        async with probing(port) as probe:
            await probe.subscribe("/talk")
            await talk.kill()
        await talk.revive()
    await until(lambda: len(asyncio.all_tasks()) <= before[0])
    assert len(os.listdir("/proc/self/fd")) <= before[1]
    assert [topic.subscribers for topic in talk.graph.topics()] == [{}]


@pytest.mark.field
async def test_a_slow_client_delays_nobody_and_loses_only_its_own(port: int, talk: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/talk")
    async with probing(port) as slow:
        await slow.subscribe("/talk", queue_length=3)
        slow.socket.transport.pause_reading()
        big = {"data": "x" * 100_000}
        waits_s = []
        for number in range(200):
            began = time.perf_counter()
            talk.publish("/talk", {**big, "number": number})
            assert (await probe.hear())["msg"]["number"] == number
            waits_s.append(time.perf_counter() - began)
        assert sorted(waits_s)[190] < 0.1  # a bridge that waited for the slow one would not get this far at all
        assert talk.dropped > 50
        dropped = talk.dropped
        slow.socket.transport.resume_reading()
        numbers = [(await slow.hear())["msg"]["number"] for _ in range(200 - dropped)]
        assert numbers == sorted(numbers)
        assert numbers[-3:] == [197, 198, 199]  # the newest are what was kept
    assert talk.dropped == dropped


async def test_without_a_queue_length_the_bytes_are_bounded(
    port: int, talk: RosBridge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.rosbridge_server.client.BACKLOG_BYTES", 500_000)
    async with probing(port) as slow:
        await slow.subscribe("/talk")
        slow.socket.transport.pause_reading()
        for _ in range(300):
            talk.publish("/talk", {"data": "x" * 100_000})
            await asyncio.sleep(0)
        assert talk.dropped > 50
        [client] = talk._clients
        assert client._outbox._backlog_bytes <= 500_000
        slow.socket.transport.abort()


@pytest.mark.virtual_time
async def test_a_client_that_sends_and_never_reads_is_throttled(port: int, talk: RosBridge) -> None:
    calls = 0

    def count(args: object) -> dict[str, str]:
        nonlocal calls
        calls += 1
        return {"much": "x" * 100_000}

    talk.add_service("/much", "demo/Much", count)
    request = json.dumps({"op": "call_service", "service": "/much"}).encode()
    async with probing(port) as greedy, probing(port) as other:
        greedy.socket.transport.pause_reading()
        greedy.socket.transport.write(b"".join(Frame(Opcode.TEXT, request).serialize(mask=True) for _ in range(2_000)))
        before = -1
        while calls != before:
            before = calls
            await asyncio.sleep(0.3)
        assert calls < 500  # what the system's own buffers take, and a little more
        assert (await other.call("/rosapi/get_time"))["result"] is True
        greedy.socket.transport.abort()
        await until(lambda: talk.clients == 1)


async def test_a_message_beyond_the_limit_ends_the_connection() -> None:
    async with bridging(max_message_bytes=10_000) as (bridge, port), probing(port) as probe:
        await probe.socket.send("x" * 10_001)
        with pytest.raises(websockets.ConnectionClosedError, match="1009"):
            await probe.hear()
        await until(lambda: bridge.clients == 0)


async def test_clients_beyond_the_limit_are_turned_away() -> None:
    async with bridging(max_clients=2) as (bridge, port), probing(port) as one, probing(port):
        assert (await one.call("/rosapi/get_time"))["result"] is True
        with pytest.raises(websockets.InvalidStatus, match="503"):
            await websockets.connect(f"ws://127.0.0.1:{port}")
        await one.socket.close()
        await until(lambda: bridge.clients == 1)
        async with probing(port) as another:
            assert (await another.call("/rosapi/get_time"))["result"] is True


@pytest.mark.virtual_time
async def test_sockets_that_say_nothing_are_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.rosbridge_server.listener.EXTRA_SOCKETS", 3)
    async with bridging(max_clients=2) as (_, port):
        silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(8)]
        ends = [asyncio.ensure_future(reader.read()) for reader, _ in silent]
        done, _ = await asyncio.wait(ends, timeout=HANDSHAKE_S - 0.1)
        assert len(done) == 3  # five may wait, three found no place
        done, waiting = await asyncio.wait(ends, timeout=0.2)
        assert not waiting  # and who never becomes a WebSocket is sent away
        for end in ends:
            end.exception()
        for _, writer in silent:
            writer.close()
        async with probing(port) as probe:
            assert (await probe.call("/rosapi/get_time"))["result"] is True


async def test_a_flood_of_pings_without_reading_ends(
    port: int, bridge: RosBridge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.rosbridge_server.connection.LARGEST_BUFFER", 50_000)
    narrow = socket.socket()
    narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16_384)
    narrow.connect(("127.0.0.1", port))
    narrow.setblocking(False)
    async with websockets.connect(f"ws://127.0.0.1:{port}", sock=narrow, ping_interval=None) as deaf:
        deaf.transport.pause_reading()
        pings = b"".join(Frame(Opcode.PING, bytes(125)).serialize(mask=True) for _ in range(1_000))
        try:
            async with asyncio.timeout(20):
                while bridge.clients:
                    if deaf.transport.get_write_buffer_size() < 1_000_000:
                        deaf.transport.write(pings)
                    await asyncio.sleep(0)
        finally:
            deaf.transport.abort()


async def test_a_browser_that_comes_by_mistake_gets_words(port: int) -> None:
    def fetch() -> tuple[int, str]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=20) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read().decode()

    status, text = await asyncio.to_thread(fetch)
    assert status == 426
    assert "WebSocket" in text


@pytest.mark.virtual_time
async def test_garbage_instead_of_a_handshake_harms_nothing(port: int, capfd: pytest.CaptureFixture[str]) -> None:
    for garbage in (b"\0" * 100, b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 1_000, b"\x16\x03\x01\x02\x00\x01", b"\r\n\r\n"):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(garbage)
        with contextlib.suppress(ConnectionError, TimeoutError):
            await asyncio.wait_for(reader.read(), 0.2)
        writer.close()
    async with probing(port) as probe:
        assert (await probe.call("/rosapi/get_time"))["result"] is True
    assert capfd.readouterr() == ("", "")


@pytest.mark.virtual_time
async def test_draining_waits_for_slow_clients(port: int, talk: RosBridge) -> None:
    async with probing(port) as slow:
        await slow.subscribe("/talk")
        slow.socket.transport.pause_reading()
        for _ in range(100):
            talk.publish("/talk", {"data": "x" * 100_000})
        assert not await talk.drain(0.1)
        slow.socket.transport.resume_reading()
        drained = asyncio.ensure_future(talk.drain(5.0))
        for _ in range(100):
            await slow.hear()
        assert await drained
        assert talk.dropped == 0


async def test_it_serves_on_ipv6_where_there_is_some() -> None:
    if not socket.has_ipv6:
        pytest.skip("no IPv6 here")
    bridge = RosBridge()
    try:
        port = await bridge.start("::1")
    except CannotListen:
        pytest.skip("no IPv6 here")
    async with websockets.connect(f"ws://[::1]:{port}"):
        await until(lambda: bridge.clients == 1)
    await bridge.stop()

"""What is too much is turned away in words: bodies, heads, frames, nesting, requests, orders, connections, slowness."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
import websockets
from h11 import IDLE

from server.app.app import create_app
from server.app.config import Config
from server.protocol.rate_limit import MAX_DEPTH, Allowance, Limits, Rate, nests_deeper
from server.system import loopback
from server.web.middleware.throttle import is_upload
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.viewer import viewer

JSON = {"Content-Type": "application/json"}


# -- the arithmetic ---


def test_an_allowance_is_taken_and_comes_back() -> None:
    one = Allowance(Rate(per_s=2.0, at_once=3), 10.0)
    assert [one.takes(10.0) for _ in range(4)] == [True, True, True, False]
    assert one.wait_s(10.0) == pytest.approx(0.5)
    assert not one.takes(10.4)
    assert one.takes(10.5)
    assert not one.is_whole(11.9)
    assert one.is_whole(12.5)
    assert [one.takes(1000.0) for _ in range(4)] == [True, True, True, False], "what was not used is not saved up"


def test_a_clock_that_goes_back_gives_nothing() -> None:
    one = Allowance(Rate(per_s=1.0, at_once=1), 10.0)
    assert one.takes(10.0)
    assert not one.takes(5.0)
    assert not one.takes(10.5)
    assert one.takes(11.0)


@pytest.mark.parametrize(
    ("value", "depth"),
    [(1, 0), ("[[[", 0), ([], 1), ({}, 1), ([1, [2]], 2), ({"a": {"b": [1]}}, 3), ([{}, [[[]]]], 4)],
)
def test_depth_is_counted(value: Any, depth: int) -> None:
    assert nests_deeper(value, depth - 1) or depth == 0
    assert not nests_deeper(value, depth)


# -- over HTTP ---


def routes_with_bodies() -> list[tuple[str, str]]:
    """Every route that takes a body, with any name where it takes one."""
    paths = create_app(Config()).openapi()["paths"]
    found = [
        (method.upper(), path.replace("{n}", "1").replace("{", "").replace("}", ""))
        for path, methods in paths.items()
        for method in methods
        if method in ("post", "put", "patch", "delete")
    ]
    assert len(found) > 15
    return found


async def test_no_route_takes_a_body_without_end() -> None:
    """Declared in its head, and found while it comes."""

    async def endless() -> AsyncIterator[bytes]:
        for _ in range(20):
            yield b"[" * 16_384

    async with serving(Config()) as base, httpx.AsyncClient(base_url=base, timeout=20) as client:
        for method, path in routes_with_bodies():
            most, words = (Limits().upload_bytes, "8 MB") if is_upload(path) else (Limits().body_bytes, "256 kB")
            answer = await client.request(method, path, content=b" " * (most + 1), headers=JSON)
            assert answer.status_code == 413, (method, path)
            assert answer.json()["detail"] == f"At most {words} are taken."
        for method, path in routes_with_bodies():
            if is_upload(path):
                continue
            found_out = await client.request(method, path, content=endless(), headers=JSON)
            assert found_out.status_code == 413, (method, path)
        assert (await client.get("/api/health")).status_code == 200


@pytest.mark.parametrize(
    ("sent", "status", "is_paused"),
    [
        (b"3\r\n{}\n\r\n0\r\n\r\n", 200, True),
        (b"3\r\n{}\n\r\n", 408, False),
        (b"3\r\n{}\n\r\nnonsense\r\n", 400, False),
    ],
    ids=["whole", "unfinished", "broken"],
)
async def test_a_command_without_a_body_is_carried_out_once_its_request_is_whole(
    sent: bytes, status: int, is_paused: bool
) -> None:
    limits = Limits(body_s=0.3) if status == 408 else Limits()
    async with serving(Config(limits=limits)) as base, http_client(base_url=base) as client:
        async with plugged(base) as (reader, writer):
            writer.write(b"POST /api/pause HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n")
            await asyncio.sleep(0.05)
            writer.write(sent)
            async with asyncio.timeout(5):
                assert (await reader.readline()).startswith(b"HTTP/1.1 %d" % status)
        assert (await client.get("/api/state")).json()["session"]["paused"] is is_paused


@pytest.mark.parametrize("opening", [b"[", b'{"a":', b'{"address":[', b'{"values":{"a":'])
async def test_nesting_is_refused_on_every_route(opening: bytes) -> None:
    async with serving(Config()) as base, httpx.AsyncClient(base_url=base, timeout=20) as client:
        for method, path in routes_with_bodies():
            for depth in (200, 2000):
                shut = {b"[": b"]", b'{"a":': b"1" + b"}"}.get(opening, b"")
                for body in (opening * depth, opening * depth + shut[:1] + shut[1:] * depth):
                    if len(body) > Limits().body_bytes:
                        continue
                    answer = await client.request(method, path, content=body, headers=JSON)
                    assert answer.status_code < 500, (method, path, depth, answer.text)
            answer = await client.get("/api/health")
            assert answer.status_code == 200


@pytest.mark.field
async def test_a_device_that_asks_without_end_is_told_when_to_come_back() -> None:
    limits = Limits(local_requests=Rate(per_s=1.0, at_once=20))
    async with serving(Config(limits=limits)) as base, http_client(base_url=base) as client:
        answers = [await client.get("/api/health") for _ in range(40)]
        assert [answer.status_code for answer in answers[:20]] == [200] * 20
        late = answers[-1]
        assert late.status_code == 429
        assert late.json()["detail"] == "Too many requests at once from this device: try again in 1 s."
        assert late.headers["retry-after"] == "1"
        assert late.headers["x-content-type-options"] == "nosniff"
        with pytest.raises(websockets.InvalidStatus) as refused:
            await websockets.connect(base.replace("http", "ws") + "/ws")
        assert refused.value.response.status_code == 429
        await asyncio.sleep(1.0)
        assert (await client.get("/api/health")).status_code == 200


# -- on the wire ---


@contextlib.asynccontextmanager
async def plugged(base: str) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    host, _, port = base.removeprefix("http://").partition(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    try:
        yield reader, writer
    finally:
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()


async def ended(reader: asyncio.StreamReader, within_s: float = 20.0) -> bytes:
    """All that still comes before the other side hangs up."""
    async with asyncio.timeout(within_s):
        try:
            return await reader.read()
        except ConnectionResetError:
            return b""


@pytest.mark.field
@pytest.mark.parametrize("sent", [b"", b"GET / HT", b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\nX: "], ids=repr)
async def test_a_head_that_does_not_come_to_its_end_is_not_waited_for(sent: bytes) -> None:
    async with serving(Config(limits=Limits(head_s=0.5))) as base, plugged(base) as (reader, writer):
        writer.write(sent)
        await asyncio.sleep(0.3)
        with contextlib.suppress(OSError):
            writer.write(sent[-1:])  # a drop now and then does not begin the wait anew
        assert await ended(reader, 3.0) == b""


async def test_a_second_request_on_a_connection_is_not_waited_for_either() -> None:
    async with serving(Config(limits=Limits(head_s=0.5))) as base, plugged(base) as (reader, writer):
        writer.write(b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert (await reader.readline()).startswith(b"HTTP/1.1 200")
        writer.write(b"GET /api/hea")
        await ended(reader, 3.0)


@pytest.mark.field
async def test_a_body_that_drips_is_given_up() -> None:
    async with serving(Config(limits=Limits(body_s=0.5))) as base, plugged(base) as (reader, writer):
        writer.write(b"POST /api/connect HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n")
        writer.write(b"Content-Length: 100\r\n\r\n{")
        await asyncio.sleep(0.3)
        writer.write(b" ")
        answer = await ended(reader, 3.0)
        assert answer.startswith(b"HTTP/1.1 408")
        assert b"The request did not end within 0.5 s." in answer


async def test_a_head_without_end_is_refused() -> None:
    async with serving(Config()) as base, plugged(base) as (reader, writer):
        writer.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Long: " + b"a" * 40_000 + b"\r\n\r\n")
        answer = await ended(reader)
        assert answer == b"" or answer.startswith(b"HTTP/1.1 400"), "refused, or hung up on before all of it was read"


async def test_what_is_no_http_is_answered_with_all_headers() -> None:
    async with serving(Config()) as base, plugged(base) as (reader, writer):
        writer.write(b"\x16\x03\x01 nonsense\r\n\r\n")
        answer = (await ended(reader)).lower()
        assert answer.startswith(b"http/1.1 400")
        for name in (b"content-security-policy: default-src 'none'", b"x-content-type-options: nosniff"):
            assert name in answer
        assert b"server:" not in answer


@pytest.mark.field
async def test_one_address_gets_so_many_connections(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of this machine are not counted, and a test has no other: for it, this machine is another."""
    monkeypatch.setattr(loopback, "is_loopback", lambda _: False)
    async with serving(Config(limits=Limits(connections=5))) as base, contextlib.AsyncExitStack() as stack:
        lines = [await stack.enter_async_context(plugged(base)) for _ in range(5)]
        async with plugged(base) as (reader, _):
            assert await ended(reader, 3.0) == b""
        lines[0][1].close()
        await lines[0][1].wait_closed()
        await asyncio.sleep(0.1)
        async with plugged(base) as (reader, writer):
            writer.write(b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert (await reader.readline()).startswith(b"HTTP/1.1 200")


def test_what_is_taken_for_granted_of_h11() -> None:
    import h11

    connection = h11.Connection(h11.SERVER)
    assert connection.their_state is IDLE
    connection.receive_data(b"GET / HTTP/1.1\r\nHost: a\r\n")
    assert connection.next_event() is h11.NEED_DATA
    assert connection.their_state is IDLE, "a head that has not come to its end is still waited for"
    assert connection.trailing_data[0]


# -- on the page's socket ---


@pytest.mark.field
async def test_orders_that_run_away_are_refused_in_words_and_the_page_lives() -> None:
    limits = Limits(commands=Rate(per_s=5.0, at_once=10))
    async with serving(Config(limits=limits)) as base, viewer(base) as one:
        await one.until(lambda: one.states)
        answers = [await one.ask(kind="retry") for _ in range(15)]
        reasons = [str(answer["reason"]) for answer in answers]
        assert sum(reason.startswith("Too many commands at once") for reason in reasons) in (4, 5)
        assert not reasons[0].startswith("Too many")
        await asyncio.sleep(0.5)
        assert not str((await one.ask(kind="retry"))["reason"]).startswith("Too many")


async def test_a_page_that_floods_is_let_go() -> None:
    limits = Limits(messages=Rate(per_s=10.0, at_once=50))
    async with serving(Config(limits=limits)) as base:
        async with websockets.connect(base.replace("http", "ws") + "/ws") as socket:
            with contextlib.suppress(websockets.ConnectionClosed):
                for _ in range(2000):
                    await socket.send('{"kind":"have","event":0}')
            await _to_its_end(socket)
            assert socket.close_code == 1008
        async with http_client() as client:
            assert (await client.get(f"{base}/api/health")).json()["pages"] == 0


@pytest.mark.parametrize("depth", [MAX_DEPTH + 1, 900])
async def test_a_message_that_nests_is_no_message(depth: int) -> None:
    async with serving(Config()) as base, viewer(base) as one:
        await one.until(lambda: one.states)
        deep = '{"kind":"pause","id":"a","x":' + "[" * depth + "]" * depth + "}"
        await one.socket.send(deep)
        complaint = await one.until(lambda: next((r for r in one.other if r["kind"] == "problem"), None))
        assert complaint["reason"] in ("The message is nested too deeply.", "The message is not JSON.")
        assert "ok" in await one.ask(kind="pause")


async def test_a_frame_beyond_the_limit_ends_its_page_only() -> None:
    async with serving(Config()) as base, viewer(base) as other:
        await other.until(lambda: other.states)
        async with websockets.connect(base.replace("http", "ws") + "/ws") as socket:
            await socket.send(json.dumps({"kind": "hello", "name": "x" * 70_000}))
            await _to_its_end(socket)
            assert socket.close_code == 1009
        assert "ok" in await other.ask(kind="pause")


async def _to_its_end(socket: websockets.ClientConnection) -> None:
    with contextlib.suppress(websockets.ConnectionClosed):
        async with asyncio.timeout(10):
            async for _ in socket:
                pass

"""Requests for what an agent keeps, over a real broker: whole, in order, once, and given up with the client."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
from collections.abc import AsyncIterator
from typing import Any

import pytest
from nats.aio.client import Client

from server.bus import nats_http as http
from server.bus import nats_wire as wire
from server.bus.bus import NotServed
from server.bus.nats_http_agent import MOST_TASKS, App, HttpAgent
from server.bus.nats_http_node import BrokeOff, HttpNode, new_id
from server.bus.nats_link import processed
from tests.server.bus.broker import connected, running_broker
from tests.server.bus.buses import until

LARGE = 40 * http.CHUNK + 17


def part(at: int, size: int) -> bytes:
    """100 kB, or what is left, of a body of that size from `at` on."""
    return bytes((at // 100_000 + n) % 251 for n in range(min(100_000, size - at)))


class Kept:
    """An application as an agent has one: it notes the requests, and answers by the path."""

    def __init__(self) -> None:
        self.requests: list[tuple[str, bytes]] = []
        self.made = 0  # bytes that were taken from it
        self.ended = 0

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        body = (await receive())["body"]
        self.requests.append((f"{scope['method']} {scope['path']}", body))
        try:
            await send({"type": "http.response.start", "status": 200, "headers": [(b"x", b"y")]})
            size = int(scope["path"].rpartition("/")[2] or 0)
            for at in range(0, size, 100_000):
                await send({"type": "http.response.body", "body": part(at, size), "more_body": True})
                self.made += len(part(at, size))
            if scope["path"].startswith("/fails"):
                raise RuntimeError("as a bug does")
            if scope["path"].startswith("/waits"):
                await asyncio.Event().wait()
            await send({"type": "http.response.body", "body": hashlib.sha256(body).digest() if body else b""})
        finally:
            self.ended += 1


def scope_of(begin: http.Begin) -> dict[str, Any]:
    if begin.sender.role != "operator":
        raise http.Refused(403, "A viewer cannot.")
    return {"type": "http", "method": begin.method, "path": begin.path}


def begin_of(path: str, method: str = "GET", role: str = "operator") -> http.Begin:
    return http.Begin(id=new_id(), method=method, path=path, sender=http.Sender(id="a", role=role))


@contextlib.asynccontextmanager
async def both(app: App) -> AsyncIterator[tuple[HttpNode, HttpAgent, Client]]:
    """A node, an agent, and the node's client."""
    now = asyncio.get_running_loop().time
    async with running_broker() as broker, connected(broker.address) as there, connected(broker.address) as here:
        agent = HttpAgent(lambda: ("ocelot",), app, scope_of, now=now)
        node = HttpNode(lambda _: None, now=now)
        await agent.start(there)
        await processed(there)
        await node.start(here)
        try:
            yield node, agent, here
        finally:
            await node.stop()
            await agent.stop()


async def read(node: HttpNode, begin: http.Begin, body: bytes = b"") -> bytes:
    async with node.call("ocelot", begin, body) as answer:
        assert (answer.status, answer.headers) == (200, {"x": "y"})
        return b"".join([chunk async for chunk in answer.chunks])


async def test_bodies_of_any_size_come_whole_and_in_order() -> None:
    app = Kept()
    async with both(app) as (node, _, _):
        for size in (0, 1, http.CHUNK, http.CHUNK + 1, LARGE):
            got = await read(node, begin_of(f"/file/{size}"))
            assert len(got) == size
            assert got == b"".join(part(at, size) for at in range(0, size, 100_000))
        sent = bytes(range(256)) * 800  # more than one message takes
        assert await read(node, begin_of("/file/", "POST"), sent) == hashlib.sha256(sent).digest()
        assert app.requests[-1] == ("POST /file/", sent)
        with pytest.raises(NotServed):
            await read(node, begin_of("/file/", "POST"), bytes(http.MOST_PARTS * http.CHUNK + 1))


@pytest.mark.field
async def test_what_nobody_reads_is_not_made_and_ends_with_the_client() -> None:
    app = Kept()
    async with both(app) as (node, agent, _):
        async with node.call("ocelot", begin_of(f"/file/{100 * http.CHUNK}")) as answer:
            chunks = aiter(answer.chunks)
            await anext(chunks)
            await asyncio.sleep(0.3)
            assert app.made <= (http.MOST_AHEAD + 3) * http.CHUNK + 100_000
            await chunks.aclose()  # type: ignore[attr-defined]
        await until(lambda: app.ended == 1)
        assert not agent._answering
        async with node.call("ocelot", begin_of(f"/waits/{2 * http.CHUNK}")) as answer:
            chunks = aiter(answer.chunks)
            await anext(chunks)
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(anext(chunks), 0.2)
        await until(lambda: app.ended == 2)


async def test_lost_messages_are_sent_again_and_a_request_is_carried_out_once() -> None:
    app = Kept()
    async with both(app) as (node, agent, here):
        request, lost = here.request, 0

        async def lossy(subject: str, payload: bytes, timeout: float) -> Any:
            """Every third answer is lost: the agent got the message, and the node gets nothing."""
            nonlocal lost
            answer = await request(subject, payload, timeout=timeout)
            lost += 1
            if lost % 3 == 1:
                raise TimeoutError
            return answer

        here.request = lossy  # type: ignore[method-assign, assignment]
        got = await read(node, begin_of(f"/file/{8 * http.CHUNK}", "POST"), bytes(3 * http.CHUNK))
        assert len(got) == 8 * http.CHUNK + 32
        assert len(app.requests) == 1
        assert lost > 8
        assert agent.refused == 0


async def test_a_failed_answer_a_role_that_may_not_and_too_much_at_once_are_told() -> None:
    app = Kept()
    async with both(app) as (node, agent, _):
        with pytest.raises(BrokeOff):
            await read(node, begin_of(f"/fails/{3 * http.CHUNK}"))
        with pytest.raises(http.Refused, match="A viewer cannot"):
            await read(node, begin_of("/file/1", role="viewer"))
        async with contextlib.AsyncExitStack() as stack:
            for _ in range(12):
                await stack.enter_async_context(node.call("ocelot", begin_of(f"/waits/{2 * http.CHUNK}")))
            with pytest.raises(http.Refused, match="too many requests"):
                await read(node, begin_of("/file/1"))
        await until(lambda: not agent._answering)
        assert await read(node, begin_of("/file/1")) != b""


async def test_a_flood_of_messages_is_bounded_and_what_is_given_up_still_ends() -> None:
    async with both(Kept()) as (node, agent, client):
        begin = begin_of(f"/waits/{2 * http.CHUNK}")
        async with node.call("ocelot", begin):
            pull = http.pack(http.Pull(id=begin.id, n=99, have=0))
            for _ in range(MOST_TASKS + 100):
                await client.publish(wire.subject("ocelot", "http.pull"), pull, reply="nowhere")
            await processed(client)
            await until(lambda: agent.refused >= 100)
            assert len(agent._tasks) <= MOST_TASKS
            await client.publish(wire.subject("ocelot", "http.drop"), http.pack(http.Drop(id=begin.id)))
            await until(lambda: not agent._answering)


async def test_an_agent_that_goes_away_ends_what_it_answers() -> None:
    app = Kept()
    async with both(app) as (node, agent, _):
        async with node.call("ocelot", begin_of(f"/file/{100 * http.CHUNK}")) as answer:
            chunks = aiter(answer.chunks)
            await anext(chunks)
            await agent.stop()
            with pytest.raises(BrokeOff):
                async for _ in chunks:
                    pass
        with pytest.raises(NotServed, match="takes no such requests"):
            await read(node, begin_of("/file/1"))

"""At a web node: passes requests for recordings, exports and mail to the agent that keeps them."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Callable
from urllib.parse import parse_qs, quote

from starlette.responses import StreamingResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.access.identity import SCOPE_KEY, Principal
from server.bus import nats_http as http
from server.bus.bus import NotServed
from server.bus.nats_http_node import Answer, BrokeOff, HttpNode, new_id
from server.web.agents import kept
from server.web.middleware.errors import problem
from server.web.middleware.throttle import is_upload as is_of_marks

log = logging.getLogger("catgraph.web")


class ToAgents:
    """Inside the access guard and the throttle, which every request has passed. `vehicles`: all that are known."""

    def __init__(self, app: ASGIApp, *, node: HttpNode, vehicles: Callable[[], tuple[str, ...]]) -> None:
        self._app = app
        self._node = node
        self._vehicles = vehicles

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        before, name, path = kept.split(scope["path"])
        if not kept.is_kept(scope, path):
            await self._app(scope, receive, send)
            return
        vehicles = self._vehicles()
        if name is None:
            name = _meant(scope)
        answer = _refusal(name, vehicles)
        if answer is not None:
            await answer(scope, receive, send)
            return
        vehicle = name if name is not None else vehicles[0]
        try:
            begin = _begin(scope, before, path)
        except ValueError:
            await problem(400, "This request is not understood.")(scope, receive, send)
            return
        await self._carry(vehicle, begin, scope, receive, send)

    async def _carry(self, vehicle: str, begin: http.Begin, scope: Scope, receive: Receive, send: Send) -> None:
        body = await _whole(receive)
        if body is None:
            return
        try:
            async with self._node.call(vehicle, begin, body) as answer:
                await _streamed(answer)(scope, receive, send)
        except NotServed as why:
            text = str(why)
            await problem(503, f"{text[:1].upper()}{text[1:]}.")(scope, receive, send)
        except http.Refused as why:
            await problem(why.status if why.status in (403, 503) else 502, str(why))(scope, receive, send)
        except BrokeOff as why:  # an answer half given breaks off, and the connection with it
            log.warning("answer of an agent broke off: vehicle=%s path=%s why=%s", vehicle, begin.path, why)


def _meant(scope: Scope) -> str | None:
    """The vehicle that a query names, as requests about its marks do."""
    query = parse_qs(scope["query_string"].decode("latin-1"), max_num_fields=20)
    return query["vehicle"][0] if is_of_marks(scope["path"]) and "vehicle" in query else None


def _refusal(name: str | None, vehicles: tuple[str, ...]) -> ASGIApp | None:
    """Why no agent can take the request; None: one can."""
    if not vehicles:
        return problem(503, "No vehicle has connected to the broker yet.")
    if name is None and len(vehicles) > 1:
        named = ", ".join(vehicles[:20])
        return problem(422, f"Each car's agent keeps its own: ask at /agents/NAME/api/…, for one of {named}.")
    if name is not None and name not in vehicles:
        return problem(404, f"No vehicle is named {name}.")
    return None


def _begin(scope: Scope, before: str, path: str) -> http.Begin:
    """Raises ValueError: too long, or not what a request looks like."""
    who: Principal = scope[SCOPE_KEY]
    return http.Begin(
        id=new_id(),
        method=scope["method"],
        path=path,
        query=scope["query_string"].decode("latin-1"),
        root_path=quote(before),
        scheme="https" if scope["scheme"] == "https" else "http",
        headers={
            name.decode("latin-1"): value.decode("latin-1")
            for name, value in scope["headers"]
            if name.decode("latin-1") in kept.REQUEST_HEADERS
        },
        sender=http.Sender(id=who.id, name=who.name, role=who.role.value),
    )


async def _whole(receive: Receive) -> bytes | None:
    """The body, whose length is bounded before; None: the client left."""
    body = bytearray()
    while True:
        message: Message = await receive()
        if message["type"] != "http.request":
            return None
        body += message.get("body", b"")
        if not message.get("more_body", False):
            return bytes(body)


def _streamed(answer: Answer) -> StreamingResponse:
    """Ends with the client, too."""
    streamed = StreamingResponse(_bytes(answer.chunks), status_code=answer.status)
    streamed.raw_headers = [
        (name.encode("latin-1"), value.encode("latin-1"))
        for name, value in answer.headers.items()
        if name in kept.ANSWER_HEADERS
    ]
    return streamed


async def _bytes(chunks: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    async for chunk in chunks:
        yield chunk

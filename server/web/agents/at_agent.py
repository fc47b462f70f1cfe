"""At an agent: answers requests for what it keeps that web nodes hand on, and none other.

Among it are replays that pages of web nodes show. A node requests the newest frames, one answer at a time.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Body, FastAPI, HTTPException, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from starlette.types import Receive, Scope, Send

from server.access.identity import SCOPE_KEY, Principal, Role, is_enough, needs_of
from server.bus.nats_http import Begin, Refused
from server.control import display_name
from server.protocol.page_messages import ShortText
from server.replay.manager import NoReplay, ReplayClient, ReplayManager
from server.web.agents import kept
from server.web.middleware import errors
from server.web.middleware.methods import HeadAsGet
from server.web.routes.session_request import NAME_HEADER
from server.web.services import Services

router = APIRouter(prefix=kept.REPLAYS)
WAITS_S = 1.0  # for a newer frame
UNASKED_S = 15.0  # a replay that no node requests is closed
Number = Annotated[int, Query(ge=0, lt=1 << 53)]


class Opening(BaseModel):
    """As `ViewSource` opens one."""

    model_config = ConfigDict(extra="forbid", strict=True)
    vehicle: str = Field(max_length=40)
    at_s: float | int | None = None
    settings: str = Field("", max_length=100_000)
    settings_version: int = 0
    topics: dict[ShortText, ShortText] = Field(default_factory=dict, max_length=50)  # as of `OpenReplay`
    units: dict[ShortText, ShortText] = Field(default_factory=dict, max_length=50)


class OpenKept(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    recording: str = Field(max_length=100)
    opening: Opening


class Shown:
    """One replay, closed once no node requests it any more."""

    def __init__(self, manager: ReplayManager) -> None:
        self._manager = manager
        self._changed = asyncio.Event()
        self._due: asyncio.TimerHandle | None = None
        self._closing: asyncio.Task[None] | None = None
        self.client: ReplayClient | None = None

    def on_new(self, _kind: str) -> None:
        self._changed.set()
        self._changed = asyncio.Event()

    def touch(self) -> ReplayClient:
        """Restart the timer that closes it: a node requests it now."""
        self.stop()
        self._due = asyncio.get_running_loop().call_later(UNASKED_S, self._give_up)
        assert self.client is not None
        return self.client

    async def newer(self, have: dict[str, int]) -> ReplayClient:
        """It, once a frame is newer than those, or has failed, or after a second."""
        client = self.touch()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(WAITS_S):
                while client.failed is None and all(have[kind] >= n for kind, n in client.numbers.items()):
                    await self._changed.wait()
        return client

    def stop(self) -> None:
        if self._due is not None:
            self._due.cancel()

    def _give_up(self) -> None:
        if self.client is not None:
            self._closing = asyncio.create_task(self._manager.close(self.client))


class KeptReplays:
    """Those of all nodes, by their tokens."""

    def __init__(self, manager: ReplayManager) -> None:
        self.manager = manager
        self._shown: dict[str, Shown] = {}

    async def open(self, recording: str, opening: dict[str, Any], instead: str = "") -> ReplayClient:
        """`instead`: the token of one that its node closes then. Raises NoReplay."""
        for token in [token for token, shown in self._shown.items() if not self.manager.holds(token)]:
            del self._shown[token]
        shown = Shown(self.manager)
        before = self._shown.get(instead)
        client = shown.client = await self.manager.open(
            recording, opening, on_new=shown.on_new, instead=None if before is None else before.client
        )
        self._shown[client.token] = shown
        shown.touch()
        return client

    def of(self, token: str) -> Shown:
        """Raises NoReplay."""
        self.manager.by_token(token)
        shown = self._shown.get(token)
        if shown is None:
            raise NoReplay("This replay is over.")
        return shown

    async def close(self, token: str) -> None:
        shown = self._shown.pop(token, None)
        if shown is not None and shown.client is not None:
            shown.stop()
            await self.manager.close(shown.client)


def _kept_replays(request: Request) -> KeptReplays:
    found: KeptReplays = request.app.state.replays
    return found


def _shown(request: Request, token: str) -> Shown:
    try:
        return _kept_replays(request).of(token)
    except NoReplay as why:
        raise HTTPException(404, str(why)) from None


@router.post("")
async def opened(
    request: Request, body: Annotated[OpenKept, Body()], instead: Annotated[str, Query(max_length=40)] = ""
) -> dict[str, Any]:
    try:
        client = await _kept_replays(request).open(body.recording, body.opening.model_dump(), instead)
    except NoReplay as why:
        raise HTTPException(409, str(why)) from None
    return {"token": client.token, **client.source_facts()}


@router.get("/{token}")
async def frames(request: Request, token: str, state: Number = 0, scan: Number = 0, timeline: Number = 0) -> Response:
    """A line of JSON, then the frames that are newer than the numbers in the request, one after the other."""
    have = {"state": state, "scan": scan, "timeline": timeline}
    client = await _shown(request, token).newer(have)
    found = client.newest_parts(have)
    head = {
        "numbers": client.numbers,
        "silent_s": client.silent_s,
        "failed": client.failed,
        "parts": [(kind, len(payload)) for kind, payload in found],
    }
    return Response(orjson.dumps(head) + b"\n" + b"".join(payload for _, payload in found))


@router.post("/{token}/ask")
async def send_order(request: Request, token: str, order: Annotated[dict[str, Any], Body()]) -> dict[str, Any]:
    try:
        return await _shown(request, token).touch().ask(order)
    except NoReplay as why:
        raise HTTPException(409, str(why)) from None


@router.delete("/{token}")
async def closed(request: Request, token: str) -> dict[str, Any]:
    await _kept_replays(request).close(token)
    return {"ok": True}


class AtAgent:
    """An ASGI application with the routes in `kept`. `services` is called with the first request."""

    def __init__(self, services: Callable[[], Services]) -> None:
        self._services = services
        self._app: FastAPI | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if self._app is None:
            self._app = _app(self._services())
        await self._app(scope, receive, send)


def _app(services: Services) -> FastAPI:
    app = FastAPI(openapi_url=None)
    app.state.services = services
    app.state.replays = KeptReplays(services.replays)
    app.add_middleware(HeadAsGet)
    errors.install(app)
    for one in (*kept.ROUTERS, router):
        app.include_router(one)
    return app


def scope_of(begin: Begin) -> Scope:
    """The request as an ASGI scope. Raises Refused where its sender may not send it:
    the agent checks the role itself."""
    try:
        role = Role(begin.sender.role)
    except ValueError:
        raise Refused(403, "The node did not say who sent this request.") from None
    is_replay = begin.path.startswith(kept.REPLAYS)  # a viewer may replay, as on a page
    if not is_replay and not is_enough(role, needs_of(begin.method, begin.path)):
        raise Refused(403, "A viewer cannot make changes; an operator can.")
    return {
        "type": "http",
        "asgi": {"version": "3.0", "spec_version": "2.3"},
        "http_version": "1.1",
        "method": begin.method,
        "scheme": begin.scheme,
        "path": begin.path,
        "raw_path": begin.path.encode("utf-8", "replace"),
        "query_string": begin.query.encode("latin-1", "replace"),
        "root_path": begin.root_path,
        "headers": [
            (name.encode("latin-1", "replace"), value.encode("latin-1", "replace"))
            for name, value in (begin.headers | {NAME_HEADER: _stated_name(begin.headers)}).items()
            if name in kept.REQUEST_HEADERS
        ],
        "client": None,
        "server": None,
        "state": {},
        SCOPE_KEY: Principal(id=begin.sender.id, name=begin.sender.name, role=role),
    }


def _stated_name(headers: Mapping[str, str]) -> str:
    """Who sent it in the log of the car: requests for files are not signed."""
    by = display_name.clean(headers.get(NAME_HEADER)) or display_name.of_program(headers.get("user-agent"))
    return display_name.not_signed(by)

"""At an agent: answers requests for what it keeps that web nodes hand on, and none other."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fastapi import FastAPI
from starlette.types import Receive, Scope, Send

from server.access.identity import SCOPE_KEY, Principal, Role
from server.access.rules import is_enough, needs_of
from server.bus.nats_http import Begin, Refused
from server.control import display_name
from server.web.agents import kept, kept_replays
from server.web.middleware import errors
from server.web.middleware.methods import HeadAsGet
from server.web.routes.session_request import NAME_HEADER
from server.web.services import Services


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
    app.state.replays = kept_replays.KeptReplays(services.replays)
    app.add_middleware(HeadAsGet)
    errors.install(app)
    for router in (*kept.ROUTERS, kept_replays.router):
        app.include_router(router)
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

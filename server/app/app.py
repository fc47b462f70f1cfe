"""Builds one server: its sessions, its bus, its pages. No module-level state: two apps can live in one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from fastapi import APIRouter, FastAPI
from starlette.types import ASGIApp

from monitor.catalog import AnyCheck
from server.app.build import build
from server.app.config import Config
from server.app.lifespan import lifespan
from server.system import preload  # noqa: F401
from server.web import interface
from server.web.middleware import errors
from server.web.middleware.access_guard import Guard
from server.web.middleware.headers import SecurityHeaders
from server.web.middleware.methods import HeadAsGet
from server.web.middleware.throttle import Throttle
from server.web.routes import (
    about,
    alarms,
    commands,
    devices,
    exports,
    log,
    logbook,
    mail,
    map,
    marks,
    metrics,
    off_vehicles,
    pages,
    people,
    recorded_marks,
    recordings,
    settings,
    state,
    stored,
)

# In the order in which the reference of the interface shows them. Their models are built once for all applications of a
# process: that takes longer than the rest of a start.
ROUTES = APIRouter()
for _module in (
    state,
    off_vehicles,
    commands,
    alarms,
    marks,
    settings,
    devices,
    people,
    log,
    exports,
    logbook,
    recordings,
    recorded_marks,
    stored,
    mail,
    metrics,
    map,
    about,
):
    ROUTES.include_router(_module.router)
ROUTES.include_router(pages.socket)


def create_app(
    config: Config,
    *,
    now: Callable[[], float] = time.monotonic,
    wall_ms: Callable[[], int] = lambda: time.time_ns() // 1_000_000,
    checks: Sequence[AnyCheck] | None = None,
) -> FastAPI:
    """The ASGI application; its sessions run from its start-up to its shut-down. `checks` None: all there are.

    Raises OSError when the data folder cannot be used, DataFolderRefused when another server uses it or a newer version
    wrote it, AssetsMissing when the page's files are not there,
    MapRefused when a map file cannot be shown.
    """
    running, journal, storage = build(config, now=now, wall_ms=wall_ms, checks=checks)
    app = _Served(
        title="catgraph",
        version=running.version,
        description="Operator control unit for a test vehicle: its state, its alarms, its connection.",
        lifespan=lambda _: lifespan(running, journal, storage),
        routes=ROUTES.routes,
        openapi_url=None,  # FastAPI's own makes it on the event loop, and its page loads scripts from the internet
    )
    app.state.services = running
    app.state.strict_transport = config.tls is not None and config.tls.mode == "files"
    app.add_middleware(HeadAsGet)
    if running.agents is not None:
        from server.web.agents.to_agents import ToAgents  # only here: without a broker nats-py need not be installed

        app.add_middleware(ToAgents, node=running.agents, vehicles=lambda: running.vehicles)
    app.add_middleware(Throttle, limits=config.limits, now=now)
    app.add_middleware(Guard, access=running.access)
    errors.install(app)
    app.state.page_files = pages.install(app)
    return app


class _Served(FastAPI):
    """Every answer has the headers: those of a bug too, which Starlette gives outside of all that is added to it."""

    def openapi(self) -> dict[str, Any]:
        if self.openapi_schema is None:
            self.openapi_schema = interface.described(self)
        return self.openapi_schema

    def build_middleware_stack(self) -> ASGIApp:
        return SecurityHeaders(super().build_middleware_stack(), is_strict=self.state.strict_transport)

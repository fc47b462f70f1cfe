"""Builds one server: its sessions, its bus, its pages. No module-level state: two apps can live in one process."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path

from fastapi import FastAPI
from starlette.types import ASGIApp

from monitor.catalog import AnyCheck
from server.access.access import Access
from server.app.config import Config
from server.bus.bus import LocalBus
from server.bus.journal import Journal
from server.judge.settings import SettingsFile
from server.mail.mailer import Mailer
from server.mail.recorded import Recorded
from server.recording.catalog.catalog import Catalog
from server.recording.export.jobs import Exports
from server.recording.folder import RecordingsFolder
from server.recording.recover import Recovered
from server.recording.recovery import recover_left
from server.replay.manager import Desk
from server.storage.data_folder import DataFolder
from server.vehicle.session import Session
from server.version import catgraph_version
from server.web.maps.layers import Ground
from server.web.maps.tile_proxy import Upstream
from server.web.middleware import errors
from server.web.middleware.access_guard import Guard
from server.web.middleware.headers import SecurityHeaders
from server.web.middleware.throttle import Throttle
from server.web.page_socket import Hub
from server.web.routes import api, devices, docs, metrics, pages, slow_down, third_party
from server.web.routes import exports as web_exports
from server.web.routes import log as alarm_log
from server.web.routes import mail as web_mail
from server.web.routes import map as web_ground
from server.web.routes import recordings as web_recordings
from server.web.services import Services

log = logging.getLogger("catgraph.app")


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
    ground = Ground(config.maps, config.site_image, _upstream(config, now=now, wall_ms=wall_ms))
    folder = DataFolder(config.data) if config.data is not None else None
    journal = Journal(config.data / "events.sqlite" if config.data is not None else None)
    bus = LocalBus(journal, now=now)
    desk = Desk(lambda id: _recording(running, id), now=now)
    running = Services(
        is_open=config.is_open,
        keeps_shell=config.worker,
        found=config.found,
        folder=folder,
        bus=bus,
        hub=Hub(bus, desk=desk, server=lambda: running.server_facts(), limits=config.limits, now=now),
        access=_access(config, now=now, wall_ms=wall_ms),
        sessions={},
        now=now,
        wall_ms=wall_ms,
        boot=secrets.token_hex(8),
        version=catgraph_version(),
        started_s=now(),
        ground=ground,
        mailer=_mailer(config.data, lambda id: _recording(running, id), wall_ms=wall_ms),
        desk=desk,
        recordings=_catalog(config.data, now=now, wall_ms=wall_ms),
    )
    if running.recordings is not None and config.data is not None:
        running.exports = _exports(config.data, running.recordings, now=now, wall_ms=wall_ms)
    for vehicle in config.vehicles:
        running.sessions[vehicle.name] = Session(
            vehicle,
            bus,
            now=now,
            wall_ms=wall_ms,
            server=running.server_facts,
            allowed_hosts=config.allowed_hosts,
            checks=checks,
            settings=SettingsFile(config.data / "settings" / f"{vehicle.name}.toml" if config.data else None),
            recordings=RecordingsFolder(config.data / "recordings") if config.data else None,
            on_finished=running.recordings.add if running.recordings is not None else lambda _: None,
        )

    @asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        if running.recordings is not None:
            await running.recordings.start()
        recovering = _recover(running)
        if running.exports is not None:
            await running.exports.start()
        if running.mailer is not None:
            await running.mailer.start()
        for session in running.sessions.values():
            await session.start()
        try:
            yield
        finally:
            if recovering is not None:
                recovering.cancel()  # what it was at is done again at the next start
            await desk.close_all()
            await asyncio.gather(*(session.stop() for session in running.sessions.values()))
            if running.mailer is not None:
                await running.mailer.stop()
            if running.exports is not None:
                await running.exports.stop()
            if running.recordings is not None:
                await running.recordings.stop()
            running.access.stop()
            journal.close()
            ground.close()
            if folder is not None:
                folder.close()

    app = _Served(
        title="catgraph",
        version=running.version,
        description="Operator control unit for a test vehicle: its state, its alarms, its connection.",
        lifespan=life,
        docs_url=None,  # FastAPI's own page loads its scripts from the internet
        redoc_url=None,
    )
    app.state.services = running
    app.state.strict_transport = config.tls is not None and config.tls.mode == "files"
    app.add_middleware(Throttle, limits=config.limits, now=now)
    app.add_middleware(Guard, access=running.access)
    errors.install(app)
    app.include_router(api.router)
    app.include_router(slow_down.router)
    app.include_router(devices.router)
    app.include_router(alarm_log.router)
    app.include_router(web_exports.router)
    app.include_router(web_recordings.router)
    app.include_router(web_mail.router)
    app.include_router(metrics.router)
    app.include_router(web_ground.router)
    app.include_router(third_party.router)
    app.include_router(docs.router)
    pages.install(app)
    return app


class _Served(FastAPI):
    """Every answer has the headers: those of a bug too, which Starlette gives outside of all that is added to it."""

    def build_middleware_stack(self) -> ASGIApp:
        return SecurityHeaders(super().build_middleware_stack(), is_strict=self.state.strict_transport)


def _access(config: Config, *, now: Callable[[], float], wall_ms: Callable[[], int]) -> Access:
    return Access(config.data, names=config.names, keys=config.keys, is_open=config.is_open, now=now, wall_ms=wall_ms)


def _upstream(config: Config, *, now: Callable[[], float], wall_ms: Callable[[], int]) -> Callable[[], Upstream] | None:
    """Makes the layer of tiles that are fetched, where one is configured."""
    wanted = config.map_upstream
    return None if wanted is None else partial(Upstream, wanted, config.data, now=now, wall_s=lambda: wall_ms() / 1000)


def _catalog(data: Path | None, *, now: Callable[[], float], wall_ms: Callable[[], int]) -> Catalog | None:
    if data is None:
        return None
    return Catalog(data / "recordings", data / "recordings.sqlite", now=now, wall_ms=wall_ms)


def _exports(data: Path, catalog: Catalog, *, now: Callable[[], float], wall_ms: Callable[[], int]) -> Exports:
    folder = RecordingsFolder(catalog.folder)
    return Exports(data / "exports", folder, catalog.path, catalog.add, now=now, wall_ms=wall_ms)


def _mailer(data: Path | None, path_of: Callable[[str], Path | None], *, wall_ms: Callable[[], int]) -> Mailer | None:
    return None if data is None else Mailer(data / "mail", Recorded(path_of), wall_ms=wall_ms)


def _recover(running: Services) -> asyncio.Task[None] | None:
    """Begins to make whole what the last run left, which must be looked for before anything is recorded anew."""
    recordings = running.recordings
    if recordings is None:
        return None
    folder = RecordingsFolder(recordings.folder)
    try:
        left = folder.unfinished()
    except OSError as why:
        log.error("the recordings cannot be looked through: %s", why)
        return None

    def told(path: Path, found: Recovered) -> None:
        if found.path is not None:
            recordings.add(found.path)
        for name, session in running.sessions.items():
            if folder.place(name, found.id).parent == path.parent:
                session.recovered(found)

    return asyncio.create_task(recover_left(left, told=told), name="recover recordings") if left else None


def _recording(running: Services, id: str) -> Path | None:
    """Where a finished recording lies."""
    return None if running.recordings is None else running.recordings.path(id)

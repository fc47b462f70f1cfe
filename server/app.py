"""Builds one server: its sessions, its bus, its pages. No module-level state: two apps can live in one process."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from starlette.types import ASGIApp

from monitor.catalog import AnyCheck
from server import preload  # noqa: F401
from server.access.access import Access
from server.access.guard import Guard
from server.bus import LocalBus
from server.config import Config
from server.export_jobs import Exports
from server.hub import Hub
from server.journal import Journal
from server.mail.mailer import Mailer
from server.mail.recorded import Recorded
from server.playback.desk import Desk
from server.recording.catalog import Catalog
from server.recording.folder import RecordingsFolder
from server.recording.recover import Recovered
from server.recovering import recover_left
from server.session import Session
from server.settings import SettingsFile
from server.storage.data_folder import DataFolder
from server.version import catgraph_version
from server.vitals import problems
from server.web import api, devices, docs, errors, metrics, notices, pages, slow_down
from server.web import exports as web_exports
from server.web import ground as web_ground
from server.web import log as alarm_log
from server.web import mail as web_mail
from server.web import recordings as web_recordings
from server.web.assets import static_dir
from server.web.built import find
from server.web.ground import Ground
from server.web.headers import SecurityHeaders
from server.web.shell import build_of
from server.web.throttle import Throttle
from server.web.upstream import Upstream

log = logging.getLogger("catgraph.app")


@dataclass(slots=True)
class Running:
    """What the routes of one app use."""

    config: Config
    folder: DataFolder | None  # held until the app ends; None: nothing is kept
    bus: LocalBus
    hub: Hub
    access: Access
    sessions: dict[str, Session]
    now: Callable[[], float]
    wall_ms: Callable[[], int]
    boot: str
    version: str
    started_s: float
    ground: Ground
    mailer: Mailer | None  # None: nothing is kept, so nothing is mailed
    recordings: Catalog | None  # None: nothing is kept, so nothing is recorded
    desk: Desk
    exports: Exports | None = None  # None: nothing is kept, so nothing is exported

    def server_facts(self) -> dict[str, Any]:
        """The `server` part of a state."""
        return {
            "time_ms": self.wall_ms(),
            "boot": self.boot,
            "version": self.version,
            "pages": self.hub.pages,
            "frames_skipped": self.hub.skipped,
        }

    def problems(self) -> list[str]:
        """What is wrong with the server, a sentence each; those of a vehicle begin with its name."""
        found = [f"{name}: {what}" for name, session in self.sessions.items() for what in problems(session.vitals())]
        if self.recordings is not None:
            found += self.recordings.problems()
        if self.mailer is not None:
            found += self.mailer.problems()
        return found

    def hello(self, vehicle: str) -> dict[str, Any]:
        return {
            "kind": "hello",
            "version": self.version,
            "boot": self.boot,
            "vehicle": vehicle,
            "vehicles": list(self.sessions),
            "build": build_of(find(static_dir())),
            "time_ms": self.wall_ms(),
            "last_event": self.bus.last_event(vehicle),
            "veil_after_s": 2.0,
        }


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
    running = Running(
        config=config,
        folder=folder,
        bus=bus,
        hub=Hub(bus, desk=desk, server=lambda: running.server_facts(), limits=config.limits, now=now),
        access=Access(config, now=now, wall_ms=wall_ms),
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
    app.state.running = running
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
    app.include_router(notices.router)
    app.include_router(docs.router)
    pages.install(app)
    return app


class _Served(FastAPI):
    """Every answer has the headers: those of a bug too, which Starlette gives outside of all that is added to it."""

    def build_middleware_stack(self) -> ASGIApp:
        config: Config = self.state.running.config
        return SecurityHeaders(
            super().build_middleware_stack(), is_strict=config.tls is not None and config.tls.mode == "files"
        )


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


def _recover(running: Running) -> asyncio.Task[None] | None:
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


def _recording(running: Running, id: str) -> Path | None:
    """Where a finished recording lies."""
    return None if running.recordings is None else running.recordings.path(id)

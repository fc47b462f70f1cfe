"""Makes the parts of one server: its bus, its stores and a session for each vehicle. Nothing of it runs yet."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from monitor.catalog import AnyCheck
from server.access.access import Access
from server.app.config import Config
from server.bus.bus import SessionBus
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.judge.settings import SettingsFile
from server.mail.mailer import Mailer
from server.mail.recorded import Recorded
from server.recording.catalog.catalog import Catalog
from server.recording.export.jobs import Exports
from server.recording.folder import RecordingsFolder
from server.replay.manager import ReplayManager, ReplaySource
from server.storage.data_folder import DataFolder
from server.storage.storage_thread import StorageThread
from server.system.page_files import static_dir
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from server.version import catgraph_version
from server.web.assets.bundle import find
from server.web.assets.service_worker import build_of
from server.web.hub import Hub
from server.web.maps.layers import MapLayers
from server.web.maps.tile_proxy import Upstream
from server.web.services import Services


def build(
    config: Config, *, now: Callable[[], float], wall_ms: Callable[[], int], checks: Sequence[AnyCheck] | None
) -> tuple[Services, Journal, StorageThread]:
    """What the routes use, the journal below its bus, and the thread that writes it. Raises as `create_app` does."""
    ground = MapLayers(config.maps, config.site_image, _upstream(config, now=now, wall_ms=wall_ms))
    folder = DataFolder(config.data) if config.data is not None else None
    storage = StorageThread()
    journal = Journal(config.data / "events.sqlite" if config.data is not None else None, thread=storage)
    bus = LocalBus(journal, now=now, storage=storage)
    replays = ReplayManager(lambda id: _replay_source(running, id), now=now)
    running = Services(
        is_open=config.is_open,
        keeps_shell=config.worker,
        found=config.found,
        folder=folder,
        storage=storage,
        bus=bus,
        unwritten_events=lambda: bus.unwritten_events,
        hub=Hub(
            bus, replays=replays, server=lambda: running.server_facts(), limits=config.limits, now=now, wall_ms=wall_ms
        ),
        access=_access(config, storage, now=now, wall_ms=wall_ms),
        sessions={},
        now=now,
        wall_ms=wall_ms,
        boot=secrets.token_hex(8),
        version=catgraph_version(),
        build=build_of(find(static_dir())),
        started_s=now(),
        ground=ground,
        mailer=_mailer(config.data, lambda id: _recording(running, id), wall_ms=wall_ms),
        replays=replays,
        recordings=_catalog(config.data, now=now, wall_ms=wall_ms),
    )
    if running.recordings is not None and config.data is not None:
        running.exports = _exports(config.data, running.recordings, now=now, wall_ms=wall_ms)
    for vehicle in config.vehicles:
        running.sessions[vehicle.name] = _session(vehicle, running, bus, config, checks, storage)
    return running, journal, storage


def _session(
    vehicle: Vehicle,
    running: Services,
    bus: SessionBus,
    config: Config,
    checks: Sequence[AnyCheck] | None,
    storage: StorageThread,
) -> Session:
    data = config.data
    return Session(
        vehicle,
        bus,
        now=running.now,
        wall_ms=running.wall_ms,
        server=running.server_facts,
        allowed_hosts=config.allowed_hosts,
        checks=checks,
        settings=SettingsFile(data / "settings" / f"{vehicle.name}.toml" if data else None),
        recordings=RecordingsFolder(data / "recordings") if data else None,
        on_finished=running.recordings.add if running.recordings is not None else lambda _: None,
        storage=storage,
    )


def _access(config: Config, storage: StorageThread, *, now: Callable[[], float], wall_ms: Callable[[], int]) -> Access:
    return Access(
        config.data,
        names=config.names,
        keys=config.keys,
        is_open=config.is_open,
        now=now,
        wall_ms=wall_ms,
        storage=storage,
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


def _recording(running: Services, id: str) -> Path | None:
    """The path of a finished recording."""
    return None if running.recordings is None else running.recordings.path(id)


def _replay_source(running: Services, id: str) -> ReplaySource | None:
    """A finished recording with its car, its title and its speed as the catalog has them."""
    path, row = _recording(running, id), running.recordings.row(id) if running.recordings is not None else None
    if path is None or row is None:
        return None
    trends = running.recordings.trends(id) if running.recordings is not None else None
    return ReplaySource(
        path=path, vehicle=row["vehicle"], title=row["title"], sketch=row.get("speed_mps") or (), trends=trends
    )

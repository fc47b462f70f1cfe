"""Makes the parts of one server: its bus, its stores and a session for each vehicle. Nothing of it runs yet."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.catalog import AnyCheck
from server.access.access import FOLDER as ACCESS_FOLDER
from server.access.access import Access
from server.access.order_keys import KnownDevices, OrderKeys
from server.access.people import People
from server.access.shared_access import SharedDevices, SharedPeople
from server.access.signed_orders import SignedOrders
from server.app import store
from server.app.config import Config
from server.bus.bus import PageBus, SessionBus
from server.bus.journal import Journal
from server.bus.journal_db import nothing_lost
from server.bus.local import LocalBus
from server.judge.settings import SettingsFile
from server.mail.mailer import Mailer
from server.mail.source import Recorded
from server.protocol.alarm_state import Note
from server.recording.catalog.catalog import Catalog
from server.recording.export.jobs import Exports
from server.recording.folder import RecordingsFolder
from server.recording.lost_events import lost_events
from server.recording.marks.keeper import MarkKeeper
from server.recording.marks.pending import PendingMedia
from server.replay.manager import ReplayManager, ReplaySource
from server.storage.data_folder import DataFolder
from server.storage.storage_thread import StorageThread
from server.system.page_files import static_dir
from server.vehicle.marks import MarksPlace
from server.vehicle.outcomes import LateCommands
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from server.version import catgraph_version
from server.web.agents.at_agent import AtAgent, scope_of
from server.web.assets.bundle import find
from server.web.assets.service_worker import build_of
from server.web.hub import Hub
from server.web.known_vehicles import OffVehicles
from server.web.maps.layers import MapLayers
from server.web.maps.tile_proxy import Upstream
from server.web.services import Link, Services

if TYPE_CHECKING:  # without a broker nats-py need not be installed
    from server.bus.nats_http_node import HttpNode


def build(
    config: Config, *, now: Callable[[], float], wall_ms: Callable[[], int], checks: Sequence[AnyCheck] | None
) -> tuple[Services, Journal, StorageThread]:
    """What the routes use, the journal below its bus, and the thread that writes it. Raises as `create_app` does."""
    boot = secrets.token_hex(8)
    ground = MapLayers(config.maps, config.site_image, _upstream(config, now=now, wall_ms=wall_ms))
    folder = None if config.data is None else DataFolder(config.data)
    storage = StorageThread()
    kept = None if config.is_node else config.data  # what belongs to the cars is kept at their agents
    names = [vehicle.name for vehicle in config.vehicles]
    lost = partial(lost_events, kept / "recordings", names, now=now) if kept else nothing_lost
    journal = Journal(kept / "events.sqlite" if kept else None, run=boot, thread=storage, lost=lost)
    bus = LocalBus(journal, now=now, storage=storage)
    access = _access(config, storage, now=now, wall_ms=wall_ms)
    orders = _orders(config, storage, lambda name, by, text: _note_device(running, name, by, text), now, wall_ms)
    off = OffVehicles(config.data if config.is_node else None, storage, wall_ms=wall_ms)
    people = People(config.data, wall_ms=wall_ms, storage=storage)
    page_bus, link, agents = _fleet(
        config, bus, access, people, boot, storage, orders, off, AtAgent(lambda: running),
        LateCommands(lambda name: _note_of(running, name), now=now), now=now, wall_ms=wall_ms,
    )  # fmt: skip
    replays = _replays(agents, lambda id: _replay_source(running, id), now=now)
    running = Services(
        is_open=config.is_open,
        keeps_shell=config.worker,
        found=config.found,
        folder=folder,
        storage=storage,
        bus=page_bus,
        unwritten_events=lambda: bus.unwritten_events,
        hub=_hub(lambda: running, page_bus, replays, config, off, people, now=now, wall_ms=wall_ms),
        access=access,
        people=people,
        sessions={},
        now=now,
        wall_ms=wall_ms,
        boot=boot,
        version=catgraph_version(),
        build=build_of(find(static_dir())),
        started_s=now(),
        ground=ground,
        off=off,
        mailer=_mailer(kept, lambda: running, wall_ms=wall_ms),
        replays=replays,
        recordings=_catalog(kept, now=now, wall_ms=wall_ms),
        link=link,
        agents=agents,
        challenge=None if orders is None else orders.challenge,
    )
    _add_to_recordings(running, bus, kept, now=now, wall_ms=wall_ms)
    store.add(running, config.store, kept)
    for vehicle in config.vehicles:
        running.sessions[vehicle.name] = _session(vehicle, running, bus, config, checks, storage)
    return running, journal, storage


def _add_to_recordings(
    running: Services, bus: LocalBus, kept: Path | None, *, now: Callable[[], float], wall_ms: Callable[[], int]
) -> None:
    """Exports and late marks."""
    running.exports = _exports(kept, running.recordings, now=now, wall_ms=wall_ms)
    if kept is not None:
        running.pending_media = PendingMedia(kept / "marks")
        running.marks = MarkKeeper(
            RecordingsFolder(kept / "recordings"),
            running.pending_media,
            vehicles=lambda: tuple(running.sessions),
            find_events=bus.find_events,
            on_changed=running.marks_changed,
            wall_ms=wall_ms,
        )


def _hub(
    running: Callable[[], Services],
    bus: PageBus,
    replays: ReplayManager,
    config: Config,
    off: OffVehicles,
    people: People,
    *,
    now: Callable[[], float],
    wall_ms: Callable[[], int],
) -> Hub:
    return Hub(
        bus,
        replays=replays,
        server=lambda: running().server_facts(),
        limits=config.limits,
        off=off.of,
        now=now,
        wall_ms=wall_ms,
        people=people,
    )


def _fleet(
    config: Config,
    bus: LocalBus,
    access: Access,
    people: People,
    boot: str,
    storage: StorageThread,
    orders: SignedOrders | None,
    off: OffVehicles,
    at_agent: AtAgent,
    late: LateCommands,
    *,
    now: Callable[[], float],
    wall_ms: Callable[[], int],
) -> tuple[PageBus, Link | None, HttpNode | None]:
    """The bus of the pages, the connection to the broker, and at a web node the client for what agents keep.

    Raises BrokerRefused.
    """
    if config.broker is None:
        return bus, None, None
    # Only here: without a broker nats-py need not be installed.
    from server.access.devices_bucket import DevicesBucket
    from server.bus.nats_agent import NatsAgent
    from server.bus.nats_bus import NatsBus
    from server.bus.nats_http_agent import HttpAgent
    from server.bus.nats_http_node import HttpNode
    from server.bus.nats_link import SPARES, BrokerLink
    from server.web.known_vehicles import KnownVehicles
    from server.web.remote_frames import RemoteFrames, event

    if config.is_node:
        known = KnownVehicles(config.data, storage, forget=config.forgotten)
        expected = known.names.union(config.expected)
        remote = NatsBus(
            now=now, read=RemoteFrames(wall_ms), read_event=event, expected=expected,
            on_new=known.note, on_message=off.end_by_data,
        )  # fmt: skip
        agents = HttpNode(remote.link_trouble, now=now)
        if not config.is_open:
            bucket = DevicesBucket(SharedDevices(access, wall_ms=wall_ms, people=SharedPeople(people)))
            access.devices.on_kept = people.on_changed = bucket.changed
            return remote, BrokerLink(config.broker, remote, agents, bucket, name="catgraph web"), agents
        return remote, BrokerLink(config.broker, remote, agents, name="catgraph web"), agents
    assert orders is not None
    is_limited = config.broker.key is not None
    agent = NatsAgent(bus, run=boot, now=now, admit=orders.admit, on_late=late.note, is_limited=is_limited)
    kept = HttpAgent(lambda: bus.vehicles, at_agent, scope_of, now=now)
    name = f"catgraph agent {' '.join(v.name for v in config.vehicles)}"
    # The agent last: it announces itself once all that a node may then request is subscribed to.
    link = BrokerLink(config.broker, kept, agent, name=name, unsent=lambda: agent.unsent, spares=SPARES)
    agent.beside = link.beside
    return bus, link, None


def _replays(
    agents: HttpNode | None, find: Callable[[str], ReplaySource | None], *, now: Callable[[], float]
) -> ReplayManager:
    """Replays of this machine, or at a web node those of the agents."""
    if agents is None:
        return ReplayManager(find, now=now)
    from server.web.agents.remote_replays import RemoteReplays  # only here, as above

    return RemoteReplays(agents, now=now)


def _orders(
    config: Config,
    storage: StorageThread,
    note: Callable[[str, str, str], None],
    now: Callable[[], float],
    wall_ms: Callable[[], int],
) -> SignedOrders | None:
    """What an agent requires of orders through web nodes; None: this is no agent. Raises OSError and BadList."""
    if config.broker is None or config.is_node:
        return None
    listed = config.known_devices
    return SignedOrders(
        OrderKeys(None if config.data is None else config.data / ACCESS_FOLDER, storage=storage),
        known=None if listed is None else KnownDevices(listed, storage=storage, now=now),
        is_required=config.requires_signed,
        now=now,
        wall_ms=wall_ms,
        note=note,
    )


def _note_of(running: Services, vehicle: str) -> Note | None:
    session = running.sessions.get(vehicle)
    return None if session is None else session.note


def _note_device(running: Services, vehicle: str, by: str, text: str) -> None:
    if (note := _note_of(running, vehicle)) is not None:
        note("device", text, by=by or None)


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
        on_finished=running.recording_finished,
        marks=MarksPlace(
            on_late=partial(running.came_late, vehicle.name),
            on_described=partial(running.came_late, vehicle.name),
            media=data / "marks" / vehicle.name if data else None,
        ),
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


def _exports(
    data: Path | None, catalog: Catalog | None, *, now: Callable[[], float], wall_ms: Callable[[], int]
) -> Exports | None:
    if data is None or catalog is None:
        return None
    folder = RecordingsFolder(catalog.folder)
    return Exports(
        data / "exports", folder, catalog.path, catalog.add, now=now, wall_ms=wall_ms, drive_of=catalog.drive_of
    )


def _mailer(data: Path | None, running: Callable[[], Services], *, wall_ms: Callable[[], int]) -> Mailer | None:
    def drive_of(id: str) -> list[str]:
        recordings = running().recordings
        return [id] if recordings is None else recordings.drive_of(id)

    source = Recorded(lambda id: _recording(running(), id), drive_of)
    return None if data is None else Mailer(data / "mail", source, wall_ms=wall_ms)


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

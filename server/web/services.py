"""What the routes of one app use: made by the app, read by the routes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from starlette.requests import HTTPConnection

from server.access.access import Access
from server.bus.bus import PageBus
from server.mail.mailer import Mailer
from server.protocol.messages import ServerHello
from server.protocol.state import ServerState
from server.recording.catalog.catalog import Catalog
from server.recording.export.jobs import Exports
from server.replay.manager import ReplayManager
from server.storage.data_folder import DataFolder
from server.storage.storage_thread import StorageThread
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from server.vehicle.vitals import problems
from server.web.hub import Hub
from server.web.maps.layers import MapLayers


@dataclass(slots=True)
class Services:
    """What the routes of one app use."""

    is_open: bool  # only programs of this machine can reach the server
    keeps_shell: bool  # phones keep the page's shell
    found: tuple[Vehicle, ...]  # offered on the connect screen
    folder: DataFolder | None  # held until the app ends; None: nothing is kept
    storage: StorageThread
    bus: PageBus
    unwritten_events: Callable[[], int]  # in memory only
    hub: Hub
    access: Access
    sessions: dict[str, Session]
    now: Callable[[], float]
    wall_ms: Callable[[], int]
    boot: str
    version: str
    build: str  # of the page as it was served last
    started_s: float
    ground: MapLayers
    mailer: Mailer | None  # None: nothing is kept, so nothing is mailed
    recordings: Catalog | None  # None: nothing is kept, so nothing is recorded
    replays: ReplayManager
    exports: Exports | None = None  # None: nothing is kept, so nothing is exported

    def server_facts(self) -> ServerState:
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

    def hello(self, vehicle: str) -> ServerHello:
        return {
            "kind": "hello",
            "version": self.version,
            "boot": self.boot,
            "vehicle": vehicle,
            "vehicles": list(self.sessions),
            "build": self.build,
            "time_ms": self.wall_ms(),
            "last_event": self.bus.last_event(vehicle),
            "veil_after_s": 2.0,
        }


def services(connection: HTTPConnection) -> Services:
    """The services of the app that a request or a socket belongs to."""
    found: Services = connection.app.state.services
    return found

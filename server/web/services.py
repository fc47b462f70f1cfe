"""What the routes of one app use: made by the app, read by the routes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from starlette.requests import HTTPConnection

from server.access.access import Access
from server.access.people import People
from server.bus.bus import PageBus
from server.mail.drive_reports import DriveReports
from server.mail.mailer import Mailer
from server.protocol.messages import ServerHello
from server.protocol.state import ServerState
from server.recording.catalog.catalog import Catalog
from server.recording.export.jobs import Exports
from server.recording.marks.keeper import MarkKeeper
from server.recording.marks.pending import PendingMedia
from server.replay.manager import ReplayManager
from server.storage.data_folder import DataFolder
from server.storage.storage_thread import StorageThread
from server.vehicle.facts import problems
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle, is_name
from server.web.hub import Hub
from server.web.known_vehicles import OffVehicles
from server.web.maps.layers import MapLayers

if TYPE_CHECKING:  # without a broker nats-py need not be installed, without a store obstore
    from server.bus.nats_http_node import HttpNode
    from server.recording.store.stored_list import StoredRecordings
    from server.recording.store.uploader import Uploader


class Link(Protocol):
    """The connection to the broker."""

    @property
    def complaint(self) -> str | None:
        """Why there is none, as a sentence; None: there is one."""

    @property
    def refused(self) -> str | None:
        """What it does not allow, as a sentence; None: nothing."""

    @property
    def unsent(self) -> str | None:
        """What was too large for it, in sentences; None: nothing."""

    def start(self) -> None:
        """Begin to connect, in the background."""

    async def stop(self) -> None:
        """End; from now on nothing comes from there."""


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
    people: People
    sessions: dict[str, Session]  # of this process; the bus may have vehicles whose sessions are elsewhere
    now: Callable[[], float]
    wall_ms: Callable[[], int]
    boot: str
    version: str
    build: str  # of the page as it was served last
    started_s: float
    ground: MapLayers
    off: OffVehicles
    mailer: Mailer | None  # None: nothing is kept, so nothing is mailed
    recordings: Catalog | None  # None: nothing is kept, so nothing is recorded
    replays: ReplayManager
    pending_media: PendingMedia | None = None  # of marks; None: nothing is kept, or it is at agents
    marks: MarkKeeper | None = None  # late ones, beside recordings
    exports: Exports | None = None  # None: nothing is kept, so nothing is exported
    link: Link | None = None  # None: without a broker
    uploader: Uploader | None = None  # None: nothing of this server is uploaded
    stored: StoredRecordings | None = None  # None: without a store
    drive_reports: DriveReports | None = None  # None: nothing is mailed
    agents: HttpNode | None = None  # at a web node: the client for what the agents keep
    challenge: Callable[[], str] | None = None  # of an agent: what devices sign with their orders

    @property
    def vehicles(self) -> tuple[str, ...]:
        """The names of all vehicles: of this process, or of agents that have sent something."""
        return tuple(self.sessions) or self.bus.vehicles

    def may_be(self, name: str) -> bool:
        """Whether a page of this vehicle can be served: at a web node also before its agent has sent anything."""
        return name in self.vehicles or (self.bus.grows and is_name(name))

    def server_facts(self) -> ServerState:
        """The `server` part of a state."""
        found: ServerState = {
            "time_ms": self.wall_ms(),
            "boot": self.boot,
            "version": self.version,
            "pages": self.hub.pages,
            "frames_skipped": self.hub.skipped,
        }
        if self.challenge is not None:
            found["challenge"] = self.challenge()
        return found

    def where_kept(self, what_for: str = "for recordings") -> str:
        """Why this server has neither recordings nor mail, as a sentence."""
        return f"This server stores nothing: start it with --data FOLDER {what_for}."

    def recording_finished(self, path: Path) -> None:
        """A file was closed: it is listed, reported where that is wished, and uploaded where there is a store."""
        if self.recordings is not None:
            self.recordings.add(path)
        if self.marks is not None:
            self.marks.finished(path)
        if self.drive_reports is not None:
            self.drive_reports.finished(path)
        if self.uploader is not None:
            self.uploader.rouse()

    def came_late(self, vehicle: str, moment_ms: int, intervention: str = "") -> None:
        """A mark came whose moment no recording covers that is being written, or an intervention of then was
        described."""
        if self.marks is not None:
            self.marks.late(vehicle, moment_ms, intervention)

    def marks_changed(self, path: Path) -> None:
        """Marks or descriptions of interventions were stored beside a recording: the list shows them, and they are
        uploaded where there is a store. For a thread that may wait for the disk."""
        if self.recordings is not None:
            self.recordings.reread_annotations(path)
        if self.uploader is not None:
            self.uploader.rouse()

    def problems(self) -> list[str]:
        """What is wrong with the server, a sentence each; those of a vehicle begin with its name."""
        found = [f"{name}: {what}" for name, session in self.sessions.items() for what in problems(session.vitals())]
        if self.link is not None:
            complaints = (self.link.complaint, self.link.refused, self.link.unsent)
            found += [one for one in complaints if one is not None]
        if self.people.complaint is not None:
            found.append(self.people.complaint)
        if self.recordings is not None:
            found += self.recordings.problems()
        if self.mailer is not None:
            found += self.mailer.problems()
        if self.drive_reports is not None:
            found += self.drive_reports.problems()
        if self.uploader is not None:
            found += self.uploader.problems()
        return found

    def lost(self) -> dict[str, str]:
        """Why nothing comes from a vehicle, a sentence each, but for those that are off on purpose."""
        troubles = {name: self.bus.trouble(name) for name in self.vehicles if name not in self.off.names}
        return {name: trouble for name, trouble in troubles.items() if trouble is not None}

    def hello(self, vehicle: str) -> ServerHello:
        found: ServerHello = {
            "kind": "hello",
            "version": self.version,
            "boot": self.bus.run(vehicle) or self.boot,
            "run": self.boot,
            "vehicle": vehicle,
            "vehicles": list(self.vehicles),
            "build": self.build,
            "time_ms": self.wall_ms(),
            "last_event": self.bus.last_event(vehicle),
            "veil_after_s": 2.0,
            "resumes": True,
        }
        if self.bus.grows:
            found["signs"] = True
        return found


def services(connection: HTTPConnection) -> Services:
    """The services of the app that a request or a socket belongs to."""
    found: Services = connection.app.state.services
    return found

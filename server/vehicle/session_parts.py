"""The parts of one vehicle's session: made and joined here, for those that work with several of them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import orjson

from monitor.alarm import Transition
from monitor.catalog import AnyCheck
from server.bus.bus import SessionBus
from server.control.authorization import Authorization
from server.judge.active_settings import ActiveSettings
from server.protocol.state import LiveState
from server.recording.controller import SessionRecording
from server.recording.folder import RecordingsFolder
from server.rosbridge.live_source import LiveSource, OpenSource
from server.slowdown.controller import SlowDownController
from server.system.supervision import Supervisor
from server.vehicle.car_attention import CarAttention
from server.vehicle.car_departure import LIST_SUFFIX, CarDeparture, DepartureFile
from server.vehicle.car_driving import CarDriving
from server.vehicle.car_handover import CarHandover
from server.vehicle.connection import Connection, ConnectionObserver
from server.vehicle.event_log import EventLog
from server.vehicle.judgement import Judgement
from server.vehicle.marks import Marks, MarksPlace
from server.vehicle.message_intake import MessageIntake
from server.vehicle.pause import CarPlannedStop, Pause
from server.vehicle.subscriptions import Subscriptions
from server.vehicle.tick_parts import TickParts

log = logging.getLogger("catgraph.session")

EVENTS_FIRST_S = 0.002  # a page's writer is woken some turns of the loop after its events are there


class StatePublisher:
    """Puts states on the bus for the pages: at once, or soon, so that events go out before.

    The states of one vehicle. `make` makes the frame; `now` is a monotonic clock in seconds.
    """

    def __init__(
        self, vehicle: str, bus: SessionBus, make: Callable[[], LiveState], *, now: Callable[[], float]
    ) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._make = make
        self._now = now
        self._failure = ""  # why no state can be made, as last logged
        self._put_s = now()
        self.is_due = False  # one is put soon

    def restart(self) -> None:
        """The age counts from now."""
        self._put_s = self._now()

    @property
    def age_s(self) -> float | None:
        """Since a state was made for the pages; None: no page is connected."""
        return self._now() - self._put_s if self._bus.watched(self._vehicle) else None

    def put_soon(self) -> None:
        """Once the events have gone out: they must not wait until a state is made. Several changes make one state."""
        if not self.is_due:
            self.is_due = True
            asyncio.get_running_loop().call_later(EVENTS_FIRST_S, self._put_due)

    def put(self) -> None:
        """Never raises: an order that was executed is not answered with an error because no state can be made. Pages
        that get none cover their values."""
        self.is_due = False
        try:
            if self._bus.watched(self._vehicle):
                made_s = self._now()  # before: this process may be stopped while it makes one
                self._bus.put(self._vehicle, "state", orjson.dumps(self._make()).decode(), made_s=made_s)
        except Exception as error:
            if self._failure != (failure := f"{type(error).__name__}: {error}"):
                self._failure = failure
                log.exception("state failed: vehicle=%s", self._vehicle)
        else:
            self._failure, self._put_s = "", self._now()

    def _put_due(self) -> None:
        if self.is_due:  # else one was put meanwhile
            self.put()


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionParts:
    """Each has one job and is testable without the others."""

    settings: ActiveSettings
    connection: Connection
    judgement: Judgement
    recording: SessionRecording
    event_log: EventLog
    authorization: Authorization
    attention: CarAttention
    handover: CarHandover
    departure: CarDeparture
    pause: Pause
    planned_stop: CarPlannedStop
    driving: CarDriving
    slow_down: SlowDownController
    publisher: StatePublisher
    intake: MessageIntake
    marks: Marks


class SessionActions(Protocol):
    """What only the session as a whole can do."""

    def connect(self, typed: str, *, by: str | None) -> None:
        """Dials what was typed, or the configured car where it is empty. Raises BadAddress."""

    def disconnect(self, *, by: str) -> None:
        """Ends monitoring."""

    def settings_changed(self, lines: Sequence[str], *, by: str | None) -> None:
        """New settings count from this moment on; `lines`: what changed, for the log."""

    def recording_ordered(self) -> None:
        """The recorder was switched on or off: topics to record are subscribed to, or no longer."""

    def slow_down_ordered(self) -> None:
        """The slow-down and the checks act on an order at once."""

    def attention_changed(self) -> None:
        """The assignment of the car changed: pages of all cars are notified at once."""


class SessionObserver(ConnectionObserver, Protocol):
    """What the parts report to the session."""

    def alarms_changed(self, transitions: Collection[Transition]) -> None: ...
    def settings_changed(self, lines: Sequence[str], *, by: str | None) -> None: ...


def session_parts(
    vehicle: str,
    bus: SessionBus,
    *,
    observer: SessionObserver,
    supervisor: Supervisor,
    attempts: TickParts,
    checks: Sequence[AnyCheck] | None,
    settings: ActiveSettings,
    recordings: RecordingsFolder | None,
    on_finished: Callable[[Path], None],
    marks: MarksPlace,
    frame: Callable[[], LiveState],
    open_source: OpenSource,
    now: Callable[[], float],
    wall_ms: Callable[[], int],
) -> SessionParts:
    """Makes the parts and joins them. `observer` learns what happens, `frame` makes a state for the pages."""
    judgement = Judgement(checks, settings, now=now, on_transitions=observer.alarms_changed)
    recording = SessionRecording(
        vehicle, recordings, settings, now=now, wall_ms=wall_ms, on_finished=on_finished,
        unreadable=lambda topic, why: intake.recorded_unreadable(topic, why),
    )  # fmt: skip
    event_log = EventLog(vehicle, bus, settings, wall_ms=wall_ms, also=recording.events)
    slow_down = _slow_down(event_log, judgement, recording, number=bus.last_event(vehicle), now=now, wall_ms=wall_ms)
    placed = Marks(event_log.note, recording, wall_ms=wall_ms, place=marks, history=recording.history)
    intake = MessageIntake(vehicle, bus, judgement, recording, slow_down, attempts, placed, now=now)

    def subscriptions(link: LiveSource | None) -> Subscriptions:
        return Subscriptions(
            link, settings, now=now, proved=lambda: connection.prove(),
            recognised=lambda title: observer.settings_changed([f"Vehicle profile: {title}"], by=None),
            learned=recording.learn,
            noted=lambda text: event_log.note("not_received", text),
            timed=lambda asked_s, ros_s: judgement.transport.clock.answered(asked_s, now(), ros_s),
            place=lambda topic, scan: judgement.frames.looks_ahead(topic, scan),
        )  # fmt: skip

    authorization = Authorization(event_log.note, fence=bus.last_event(vehicle))
    connection = Connection(vehicle, observer, intake, subscriptions, open_source, supervisor, now=now)
    intake.follow(connection)
    pause, planned_stop = Pause(event_log), CarPlannedStop(event_log)
    driving = CarDriving(judgement, connection, event_log.note, marks.on_described, now=now, wall_ms=wall_ms)
    departure = CarDeparture(settings, DepartureFile(settings.beside(LIST_SUFFIX)), event_log.note)
    return SessionParts(
        settings=settings,
        connection=connection,
        judgement=judgement,
        recording=recording,
        event_log=event_log,
        authorization=authorization,
        attention=CarAttention(judgement, authorization, event_log.note),
        handover=CarHandover(
            judgement, settings, authorization, pause, planned_stop, slow_down, driving, departure, event_log.note
        ),
        departure=departure,
        driving=driving,
        publisher=StatePublisher(vehicle, bus, frame, now=now),
        pause=pause, planned_stop=planned_stop, slow_down=slow_down, intake=intake, marks=placed,
    )  # fmt: skip


def _slow_down(
    event_log: EventLog,
    judgement: Judgement,
    recording: SessionRecording,
    *,
    number: int,
    now: Callable[[], float],
    wall_ms: Callable[[], int],
) -> SlowDownController:
    return SlowDownController(
        event_log.note, now=now, wall_ms=wall_ms, snapshot=judgement.snapshot,
        record=lambda sent: recording.own("commands", sent), number=number,
    )  # fmt: skip

"""The parts of one vehicle's session: made and joined here, for those that work with several of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

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
from server.vehicle.connection import Connection, ConnectionObserver
from server.vehicle.event_log import EventLog
from server.vehicle.judgement import Judgement
from server.vehicle.message_intake import MessageIntake
from server.vehicle.pause import Pause
from server.vehicle.state_publisher import StatePublisher
from server.vehicle.subscriptions import Subscriptions
from server.vehicle.tick_parts import TickParts


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionParts:
    """Each has one job and is testable without the others."""

    settings: ActiveSettings
    connection: Connection
    judgement: Judgement
    recording: SessionRecording
    event_log: EventLog
    authorization: Authorization
    pause: Pause
    slow_down: SlowDownController
    publisher: StatePublisher
    intake: MessageIntake


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
    frame: Callable[[], LiveState],
    open_source: OpenSource,
    now: Callable[[], float],
    wall_ms: Callable[[], int],
) -> SessionParts:
    """Makes the parts and joins them. `observer` learns what happens, `frame` makes a state for the pages."""
    judgement = Judgement(checks, settings, now=now, on_transitions=observer.alarms_changed)
    recording = SessionRecording(
        vehicle,
        recordings,
        settings,
        now=now,
        wall_ms=wall_ms,
        on_finished=on_finished,
        unreadable=lambda topic, why: intake.recorded_unreadable(topic, why),
    )
    event_log = EventLog(vehicle, bus, settings, wall_ms=wall_ms, also=recording.events)
    slow_down = SlowDownController(
        event_log.note, now=now, wall_ms=wall_ms, snapshot=judgement.snapshot,
        record=lambda sent: recording.own("commands", sent), number=bus.last_event(vehicle),
    )  # fmt: skip
    intake = MessageIntake(vehicle, bus, judgement, recording, slow_down, attempts, now=now)

    def subscriptions(link: LiveSource | None) -> Subscriptions:
        return Subscriptions(
            link,
            settings,
            now=now,
            proved=lambda: connection.prove(),
            recognised=lambda title: observer.settings_changed([f"Vehicle profile: {title}"], by=None),
            learned=recording.learn,
            noted=lambda text: event_log.note("not_received", text),
            timed=lambda asked_s, ros_s: judgement.transport.clock.answered(asked_s, now(), ros_s),
        )

    connection = Connection(vehicle, observer, intake, subscriptions, open_source, supervisor, now=now)
    intake.follow(connection)
    return SessionParts(
        settings=settings,
        connection=connection,
        judgement=judgement,
        recording=recording,
        event_log=event_log,
        authorization=Authorization(event_log.note, fence=bus.last_event(vehicle)),
        pause=Pause(event_log),
        slow_down=slow_down,
        publisher=StatePublisher(vehicle, bus, frame, now=now),
        intake=intake,
    )

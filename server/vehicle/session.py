"""One vehicle being monitored: the single writer of its state, made of parts with one job each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from typing_extensions import Unpack

from monitor.alarm import Transition
from monitor.catalog import AllLimits, AnyCheck
from server.bus.bus import SessionBus
from server.judge.active_settings import ActiveSettings
from server.judge.settings import SettingsFile
from server.protocol.alarm_state import EventDetails
from server.protocol.state import LiveState, ServerState
from server.recording.folder import RecordingsFolder
from server.rosbridge import address
from server.rosbridge.connection_errors import Problem
from server.rosbridge.link_listener import Marks
from server.rosbridge.live_source import LiveSource, OpenSource
from server.storage.storage_thread import StorageThread
from server.system import log_context
from server.system.supervision import Supervisor
from server.vehicle import facts
from server.vehicle.command_handler import CommandHandler
from server.vehicle.facts import Vitals
from server.vehicle.judgement import Judgement
from server.vehicle.marks import NO_PLACE, MarksPlace
from server.vehicle.open_source import open_source
from server.vehicle.restoration import Restoration
from server.vehicle.session_parts import session_parts
from server.vehicle.state_frame import state_frame
from server.vehicle.tick import Tick
from server.vehicle.tick_parts import TickParts
from server.vehicle.vehicle import Vehicle


class Session:
    """Shared by all pages of the vehicle. Runs on the loop that it is started on.

    `now` is a monotonic clock in seconds, `wall_ms` the time of day in ms since 1970.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        bus: SessionBus,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        server: Callable[[], ServerState],
        allowed_hosts: Collection[str] = (),
        checks: Sequence[AnyCheck] | None = None,
        settings: SettingsFile | None = None,
        recordings: RecordingsFolder | None = None,
        on_finished: Callable[[Path], None] = lambda _: None,
        marks: MarksPlace = NO_PLACE,
        storage: StorageThread | None = None,
        open_source: OpenSource = open_source,
    ) -> None:
        """`recordings` None: nothing is recorded. `on_finished` is called with each part. `marks`: where those go
        that no part covers.
        `storage`: the thread that writes settings; None: the session does. `open_source`: where messages come from.
        """
        self.vehicle = vehicle
        self._bus = bus
        self._now = now
        self._wall_ms = wall_ms
        self._server = server
        self._allowed_hosts = frozenset(allowed_hosts)
        self._supervisor = Supervisor(vehicle.name, on_restart=self._task_restarted)
        self._attempts = attempts = TickParts(vehicle.name)
        self._parts = session_parts(
            vehicle.name,
            bus,
            observer=self,
            supervisor=self._supervisor,
            attempts=attempts,
            checks=checks,
            settings=ActiveSettings(settings or SettingsFile(None)),
            recordings=recordings,
            on_finished=on_finished,
            marks=marks,
            frame=self.frame,
            open_source=open_source,
            now=now,
            wall_ms=wall_ms,
        )
        self._tick = Tick(vehicle.name, self._parts, attempts, bus, server, now=now, wall_ms=wall_ms)
        self._restoration = Restoration(vehicle.name, bus, self._parts, now=now, wall_ms=wall_ms)
        self._commands = CommandHandler(
            vehicle.name, self._parts, self, self.frame, now=now, wall_ms=wall_ms, storage=storage
        )

    # -- life --------------------------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Begins to tick, and dials where the vehicle's address is known."""
        self._bus.serve(self.vehicle.name, log_context.keeping(self._commands.handle))
        self._tick.restart()
        self._parts.publisher.restart()
        self._supervisor.keep("judge", self._tick.loop)
        self._supervisor.keep("slow-down", self._parts.slow_down.sender.send_loop)
        self._supervisor.keep("heartbeat", self._parts.slow_down.heartbeat_loop)
        self._parts.recording.prepare()
        self._restoration.begin()
        if self.vehicle.address:
            self.connect(self.vehicle.address, by=None)

    async def stop(self) -> None:
        self._parts.connection.subscriptions.end()
        if self._parts.connection.link is not None:
            self._parts.connection.link.stop()
        await self._supervisor.stop()
        await self._parts.recording.stop()

    def note(self, change: str, text: str, *, by: str | None = None, **more: Unpack[EventDetails]) -> None:
        """Writes into the car's log what happened outside of this session."""
        self._parts.event_log.note(change, text, by=by, **more)

    def _task_restarted(self, name: str, why: str) -> None:
        self._parts.event_log.note("restarted", f"A part of the server failed and was restarted: {name} ({why}).")

    # -- what others see ---------------------------------------------------------------------------------------------

    @property
    def phase(self) -> str:
        """idle, connecting, failed, monitoring or lost; see docs/protocol.md."""
        return self._parts.connection.phase

    @property
    def configured(self) -> str | None:
        """The address of the car this session was started for, whatever has been dialled since."""
        return address.url_of(self.vehicle.address)

    @property
    def address_url(self) -> str | None:
        return self._parts.connection.address.url if self._parts.connection.address is not None else None

    @property
    def lag_s(self) -> float:
        """How late the newest tick was."""
        return self._tick.lag_s

    @property
    def judgement(self) -> Judgement:
        """What is known of the car and what was announced; to be read only."""
        return self._parts.judgement

    @property
    def limits(self) -> AllLimits:
        """The settings in force."""
        return self._parts.settings.limits

    @property
    def log_trouble(self) -> str | None:
        """Why the log is not kept on the disk, as a sentence; None: it is."""
        return self._tick.log_trouble

    def bridge_answers(self, now_s: float) -> bool:
        return self._parts.connection.bridge_answers(now_s)

    def vitals(self) -> Vitals:
        """The ages for the health check of this session."""
        now_s = self._now()
        return Vitals(
            tick_age_s=self._tick.age_s(now_s),
            state_age_s=self._parts.publisher.age_s,
            log_trouble=self.log_trouble,
            recorder=self._parts.recording.facts(now_s),
            task_problems=(*self._supervisor.problems(), *self._attempts.problems()),
        )

    def frame(self) -> LiveState:
        """The whole state, as `/api/state` answers it."""
        server, now_s = self._server(), self._now()  # in this order: what it holds is no older than its time of day
        self._tick.watch_link(now_s)
        found = facts.frame_facts(
            self.vehicle.name,
            self._parts,
            now_s,
            wall_ms=self._wall_ms(),
            configured=self.configured,
            held=self._restoration.held,
            log_trouble=self.log_trouble,
        )
        shown = state_frame(found, self._parts.judgement.state.snapshot(now_s), self._parts.judgement.monitor)
        return facts.live_state(shown, self._parts.departure.state(), server, self._tick.lag_s)

    def alarms_changed(self, transitions: Collection[Transition]) -> None:
        self._parts.event_log.log_transitions(transitions, self._now())
        self._parts.publisher.put_soon()
        self._tick.alarms_changed(self._now())

    # -- orders (SessionActions) -------------------------------------------------------------------------------------

    def connect(self, typed: str, *, by: str | None) -> None:
        """Dials what was typed, or the configured car where it is empty. Raises BadAddress."""
        target = address.parse(typed if typed.strip() else self.vehicle.address or "")
        address.demand_allowed(target, self._allowed_hosts)
        before = self._restoration.of(target.url)
        if before is None:
            self._end()
            self._parts.marks.begin_drive()
        else:
            self._parts.connection.drop()
            self._clear()
        self._parts.event_log.started(target.url, target.shown, by=by, resumes=before is not None)
        self._parts.departure.dialled(self._wall_ms(), resumed=before is not None, by=by)
        self._parts.connection.dial(target, LinkMarks(self._parts.judgement.transport, self._parts.intake.subscribed))
        if before is not None:
            self._parts.pause.go_on(self._parts.judgement.state, before, self._now(), self._wall_ms())
            self._parts.planned_stop.go_on(before.planned_stop, self._now(), self._wall_ms())
            if before.order is not None:
                self._parts.slow_down.resume(before.order)

    def disconnect(self, *, by: str) -> None:
        """Ends monitoring."""
        was = self.phase
        self._end()
        if was != "idle":
            self._parts.event_log.note("stopped", "Monitoring was stopped.", by=by)
            self._parts.departure.end_drive()

    def settings_changed(self, lines: Sequence[str], *, by: str | None) -> None:
        """New settings count from this moment on; only then are they logged."""
        self._parts.judgement.apply_settings()
        self._parts.connection.subscriptions.map_again()
        if lines:
            self._parts.event_log.settings("; ".join(lines), by=by)
            self._parts.recording.settings()
        self._parts.judgement.judge(self._now())

    def recording_ordered(self) -> None:
        self._tick.watch_recording(self._now())

    def slow_down_ordered(self) -> None:
        """The slow-down and the checks act on an order at once."""
        self._tick.slow_down_ordered(self._now())

    def attention_changed(self) -> None:
        self._tick.summary.put()

    def _end(self) -> None:
        """One car's monitoring is over: its alarms end in the log, and all that is known of it is forgotten."""
        self._parts.judgement.report(self._parts.judgement.monitor.end(self._now()))
        has_released = self._parts.slow_down.ended()
        self._parts.connection.drop(is_flushed=has_released)
        self._parts.recording.ended()
        self._parts.pause.forget()
        self._parts.planned_stop.end(": monitoring ended", by=None)
        self._clear()

    def _clear(self) -> None:
        """Forgets one connection's facts before another begins."""
        self._parts.judgement.reset()
        self._parts.intake.reset()
        self._parts.connection.reset()

    # -- what the connection reports (ConnectionObserver) ------------------------------------------------------------

    def connection_opened(self, link: LiveSource) -> None:
        self._parts.recording.link_opened(self.address_url)
        self._parts.recording.link(phase="monitoring", problem=None)
        self._parts.slow_down.link_opened(link)

    def connection_proved(self) -> None:
        target = self._parts.connection.address
        self._parts.event_log.note("connected", f"Connected to {target.shown if target else 'the car'}.")

    def connection_closed(self) -> None:
        self._parts.slow_down.link_closed()

    def connection_lost(self, problem: Problem) -> None:
        self._parts.event_log.note("lost", problem.title)
        self._parts.recording.link(phase="lost", problem=problem.title)
        self._parts.recording.link_lost()

    def connection_changed(self, now_s: float) -> None:
        self._tick.watch_link(now_s)
        self._parts.judgement.judge(now_s)
        self._parts.publisher.put()


class LinkMarks:
    """The `marks` of one car's link: those of its delay, and every subscription that is sent."""

    def __init__(self, delay: Marks, subscribed: Callable[[str], None]) -> None:
        """`subscribed(topic)` is called with each subscription that is sent, the first one or another."""
        self._delay = delay
        self._subscribed = subscribed

    def open(self, at_s: float) -> None:
        self._delay.open(at_s)

    def took(self, size: int) -> None:
        self._delay.took(size)

    def sent(self, at_s: float) -> None:
        self._delay.sent(at_s)

    def answered(self, sent_s: float, at_s: float) -> None:
        self._delay.answered(sent_s, at_s)

    def subscribe(self, topic: str, queue_length: int, throttle_s: float = 0.0) -> None:
        self._delay.subscribe(topic, queue_length, throttle_s)
        self._subscribed(topic)

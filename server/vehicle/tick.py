"""One tick of a session: each part receives what the others know, then every check is judged."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial

from monitor.state import LinkFacts
from server.bus.bus import SessionBus
from server.judge.pipeline import TICK_S
from server.protocol.state import ServerState
from server.recording.delay import LinkDelay
from server.slowdown.command_target import GUARD_STATE, target_of
from server.vehicle import departure_seen, facts
from server.vehicle.car_summary import SummaryPublisher
from server.vehicle.link_load import RESTORE_BELOW_S
from server.vehicle.session_parts import SessionParts
from server.vehicle.tick_parts import ClockWatch, LogKeeper, OpenFilesWatch, TickParts

log = logging.getLogger("catgraph.session")

FRAME_TICKS = 2  # a state is put on the bus with every second tick, ten a second
READ_UP_S = 0.1  # to read what waits after the loop stood still
LOG_STALL_S = 2.0  # a stall this long is logged, because pages were covered
SICK_LOOP_S = 0.25  # a loop later than this skips one heartbeat, which would otherwise hide the stall


class Tick:
    """Of one vehicle's session. `now` is its monotonic clock in s, `wall_ms` the time of day in ms since 1970."""

    def __init__(
        self,
        vehicle: str,
        parts: SessionParts,
        attempts: TickParts,
        bus: SessionBus,
        server: Callable[[], ServerState],
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
    ) -> None:
        self._vehicle = vehicle
        self._parts = parts
        self._attempts = attempts
        self._now = now
        self._count = 0
        self._ended_s = now()  # when the newest tick came to its end
        self.lag_s = 0.0  # how late the newest one began
        self._wall_ms = wall_ms
        self._part: object = None  # of the recording, that messages were recorded in
        self._log_keeper = LogKeeper(parts.event_log, bus)
        self._open_files = OpenFilesWatch()
        parts.recording.on_closing(parts.intake.settle)
        self._clock_watch = ClockWatch(parts.event_log, wall_ms=wall_ms)
        self.summary = SummaryPublisher(vehicle, parts, bus, server, now=now, wall_ms=wall_ms)

    @property
    def log_trouble(self) -> str | None:
        """Why the log is not kept on the disk, as a sentence; None: it is."""
        return self._log_keeper.trouble

    def restart(self) -> None:
        """The age counts from now."""
        self._ended_s = self._now()

    def age_s(self, now_s: float) -> float:
        """Since every check was last judged."""
        return now_s - self._ended_s

    async def loop(self) -> None:
        """Ticks until it is cancelled."""
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            self.lag_s = max(0.0, loop.time() - due_s)
            if self.lag_s > SICK_LOOP_S and self._parts.connection.phase == "monitoring":
                await self._catch_up()
            try:
                self._count += 1
                self.run(self._now(), put=self.lag_s <= SICK_LOOP_S and self._count % FRAME_TICKS == 0)
                self._ended_s = self._now()
            except Exception:  # the one net: a fault in a tick must not end the ticking
                log.exception("tick failed: vehicle=%s", self._vehicle)
            due_s = max(due_s + TICK_S, loop.time())
            await asyncio.sleep(due_s - loop.time())

    async def _catch_up(self) -> None:
        """After the loop stood still: what the car sent meanwhile waits to be read, and its silence was ours."""
        if self.lag_s > LOG_STALL_S:
            text = f"The server stalled for {self.lag_s:.1f} s: nothing was evaluated meanwhile."
            self._parts.event_log.note("stalled", text)
        await asyncio.sleep(READ_UP_S)

    def run(self, now_s: float, *, put: bool) -> None:
        """Time judges: freshness, silence, delays. `put`: then the pages get a state."""
        for part, work in (
            ("event log", self._log_keeper.tick),
            ("server's clock", self._clock_watch.tick),
            ("link load", self.watch_load),
            ("link", self.watch_link),
            ("files and connections", self._open_files.tick),
            ("recorder", self.watch_recording),
            ("control", self.watch_control),
            ("slow-down", self.watch_slow_down),
            ("planned stop", self.watch_planned_stop),
            ("departure check", self.watch_departure),
        ):
            self._attempts.attempt(part, partial(work, now_s))
        judgement, publisher = self._parts.judgement, self._parts.publisher
        self._attempts.attempt("ages", judgement.correct_ages)
        judgement.monitor.failed_parts = self._attempts.failed
        judgement.judge(now_s)
        self._attempts.attempt("driving", partial(self._parts.driving.tick, now_s))
        self._attempts.attempt("attention", partial(self.watch_attention, now_s))
        self._attempts.attempt("owners", self._parts.handover.watch_owners)
        if put:
            if not publisher.is_due:
                publisher.put()
            self.summary.tick(now_s)

    def watch_planned_stop(self, now_s: float) -> None:
        parts = self._parts
        if parts.planned_stop.tick(departure_seen.speed_of(parts, now_s)):
            parts.publisher.put_soon()
            self.summary.put()

    def watch_departure(self, now_s: float) -> None:
        parts, wall_ms = self._parts, self._wall_ms()
        parts.departure.watch_drive(departure_seen.speed_of(parts, now_s), now_s)
        parts.departure.tick(lambda: departure_seen.seen_of(parts, now_s, wall_ms), now_s, wall_ms)

    def slow_down_ordered(self, now_s: float) -> None:
        """The slow-down and the checks act on an order at once."""
        self._attempts.attempt("slow-down", partial(self.watch_slow_down, now_s))
        self._attempts.attempt("checks", partial(self._parts.judgement.judge, now_s))

    def alarms_changed(self, now_s: float) -> None:
        """The car may need a person, or nobody any more; pages of all cars are notified at once."""
        self._attempts.attempt("attention", partial(self._parts.attention.tick, now_s))
        self.summary.put()

    def watch_link(self, now_s: float) -> None:
        self._parts.judgement.state.link(self._link_facts(now_s))

    def _link_facts(self, now_s: float) -> LinkFacts:
        return facts.link_facts(self._parts, now_s, wall_ms=self._wall_ms(), log_trouble=self.log_trouble)

    def watch_load(self, now_s: float) -> None:
        """Over a slow link, reduce the subscriptions before judged signals become stale."""
        topics, transport = self._parts.connection.subscriptions, self._parts.judgement.transport
        if self._parts.connection.phase != "monitoring":
            return
        if topics.watch_load(transport.queued_s(now_s), transport.trip_s):
            late_s = transport.late_s(now_s)
            why = f"The link is slow, {late_s:.1f} s late" if late_s > RESTORE_BELOW_S else "The link is fast enough"
            self._parts.event_log.note(
                "reduced", f"{why}. {topics.table.load.level.text}.", step=topics.table.load.step
            )

    def watch_recording(self, now_s: float) -> None:
        """Pass the state of the subscriptions to the recorder, and that of the recorder to the subscriptions."""
        topics, recording = self._parts.connection.subscriptions, self._parts.recording
        recording.ros_version = topics.ros_version
        recording.missing = topics.missing
        self._parts.intake.tick(now_s)
        recording.tick(now_s)
        if self._parts.connection.phase == "monitoring":
            found = self._link_facts(now_s)
            link = LinkDelay(now_s, found.late_s, found.throttled, found.reduced)
            recording.delays(self._parts.judgement.transport.delays(), link)
        topics.record(recording.also)
        if recording.part != self._part:
            self._part = recording.part
            if self._part is not None:
                topics.table.renew_quiet()
        self._parts.judgement.state.recorder(recording.facts(now_s))

    def watch_control(self, now_s: float) -> None:
        authorization = self._parts.authorization
        is_changed = authorization.tick(now_s)
        if self._parts.handover.tick(now_s) or is_changed:
            self._parts.publisher.put_soon()
        self._parts.judgement.state.reach(authorization.facts(now_s))

    def watch_attention(self, now_s: float) -> None:
        if self._parts.attention.tick(now_s):
            self.summary.put()

    def watch_slow_down(self, now_s: float) -> None:
        """Pass the facts of the judge to the slow-down, and those of the slow-down to the judge."""
        parts, topics, slow_down = self._parts, self._parts.connection.subscriptions, self._parts.slow_down
        monitor = parts.judgement.monitor
        link, sources = parts.connection.link, topics.signals.sources
        refusal = None if link is None else link.command_problem
        target = target_of(phase=parts.connection.phase, sources=sources, offered=topics.offered, refusal=refusal)
        slow_down.limits = monitor.limits.slow_down
        slow_down.competing_publishers = topics.ros.publishers
        slow_down.car.is_steering_known = monitor.limits.steering.tyre_rad_per_unit != 0.0
        slow_down.watch_operators(parts.authorization.heard_s())
        is_paused = parts.pause.since_s is not None
        found = slow_down.tick(target, monitor.alarms, ros_version=topics.ros_version, is_paused=is_paused)
        parts.judgement.state.slow(found)
        topics.watch_commands(target.topic or None, guard=GUARD_STATE if target.has_guard else None)

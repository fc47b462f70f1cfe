"""The one owner and single writer of a vehicle's state: hears the link, lets the monitor judge, tells the bus."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import orjson

from monitor.catalog import AnyCheck
from monitor.load import AlarmLoad, RecentLoad
from monitor.runner import Monitor, Refused, Transition
from monitor.signal_limits import expected_rates
from monitor.state import LinkFacts, Phase, State
from monitor.transport import TransportDelay
from monitor.trends import Trends
from server import address, answers, commands, judging, open_files, past, phone, problems, wire
from server.address import BadAddress
from server.bus import LocalBus
from server.config import Vehicle
from server.conversation import Conversation
from server.frame import Facts, state_frame
from server.gate import Caller, Gate
from server.judging import TICK_S
from server.link import RosLink
from server.link_load import RESTORE_BELOW_S
from server.logbook import Logbook
from server.passing import CLIENT_COUNT
from server.past import Past
from server.pause import Pause
from server.problems import Problem
from server.raw_frame import RawFrame
from server.reception import Reception, Tally
from server.recording.delay import LinkDelay
from server.recording.folder import RecordingsFolder
from server.recording.recover import Recovered
from server.scan_feed import ScanFeed
from server.session_recording import SessionRecording
from server.settings import SettingsFile
from server.slowing.slowing import Slowing
from server.slowing.way import GUARD_STATE, way_of
from server.supervision import Supervisor
from server.tuning import Tuning
from server.vitals import Vitals

log = logging.getLogger("catgraph.session")

SAVE_AGAIN_S = 1.0  # the log is asked so often whether it is kept
READ_UP_S = 0.1  # to read what waits after the loop stood still
TELL_STALL_S = 2.0  # a page that was covered for so long is told why
SICK_LOOP_S = 0.25  # a loop later than this lets one heartbeat fall: a sign of life from a sick server is a lie
TRENDS_A_FRAME = 4  # steps of the trends in each state: so many frames in a row may be lost without a gap
EVENTS_FIRST_S = 0.002  # a page's writer is woken some turns of the loop after its events are there
PROOF_WITHIN_S = 4.0  # something that speaks WebSocket and no rosbridge is told apart by then
RECORDING = "recording of messages"  # its name where it fails
FLOWS_S = 2.0  # a message of the car so lately: data flow
BRIDGE_SILENT_S = 1.4  # the bridge answers a ping every 0.5 s


class Session:
    """One vehicle being monitored, shared by every page that looks at it. Runs on the loop it is started on.

    `now` is a monotonic clock in seconds, `wall_ms` the time of day in ms since 1970.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        bus: LocalBus,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        server: Callable[[], dict[str, Any]],
        allowed_hosts: Collection[str] = (),
        checks: Sequence[AnyCheck] | None = None,
        settings: SettingsFile | None = None,
        recordings: RecordingsFolder | None = None,
        on_finished: Callable[[Path], None] = lambda _: None,
    ) -> None:
        """`recordings` None: nothing is recorded. `on_finished` is told of each part that is."""
        self.vehicle = vehicle
        self._bus = bus
        self._now = now
        self._wall_ms = wall_ms
        self._server = server
        self._allowed_hosts = frozenset(allowed_hosts)
        self._tuning = Tuning(settings or SettingsFile(None))
        self._monitor = Monitor(checks, self._tuning.limits)
        self._recording = SessionRecording(
            vehicle.name,
            recordings,
            self._tuning,
            now=now,
            wall_ms=wall_ms,
            told=on_finished,
            unreadable=self.junk_received,
        )
        self._logbook = Logbook(vehicle.name, bus, self._tuning, wall_ms=wall_ms, also=self._recording.events)
        self._load = RecentLoad()
        self._held: Past | None = None  # what stood when the server ended, until a car is monitored again
        self._log_trouble: str | None = None
        self._saved_s = -SAVE_AGAIN_S
        self._files_counted_s = -SAVE_AGAIN_S
        self._files_trouble: OSError | None = None
        self._crashes_told: set[str] = set()
        self._supervisor = Supervisor(vehicle.name, on_restart=self._task_restarted)
        self._lag_s = 0.0
        self._failed_parts: dict[str, str] = {}  # parts of a tick that fail now, and how
        self._state_failure = ""  # why no state can be made, as last logged
        self._started_s = now()
        self._ticked_s: float | None = None  # the newest tick that came to its end; None: none yet
        self._put_s = now()  # the newest state for the pages
        self._state_is_due = False
        self._pause = Pause(self._logbook)
        self._gate = Gate(self._logbook.note, fence=bus.last_event(vehicle.name))
        self._slowing = Slowing(
            self._logbook.note,
            now=now,
            wall_ms=wall_ms,
            snapshot=lambda: self._state.snapshot(self._now()),
            record=lambda said: self._recording.own("commands", said),
            number=bus.last_event(vehicle.name),
        )
        self._rides: str | None = None  # the phone that rides in the car, as the operator in control says
        self._track_number = 0
        self._clear()

    def _clear(self) -> None:
        """Forgets one connection's facts before another begins."""
        self._phase: Phase = "idle"
        self._address: address.Address | None = None
        self._link: RosLink | None = None
        self._problem: Problem | None = None
        self._since_s = self._now()  # since when the phase is what it is
        self._dialled_s = self._now()
        self._connected_s: float | None = None
        self._last_message_s: float | None = None
        self._heard: set[str] = set()
        self._proved = False
        self._reception = Reception()
        self._transport = TransportDelay()
        self._state = State(expected_rates(self._tuning.limits))
        self._state.ride(self._rides, self._now())
        self._track_number += 1  # with the state begins another track
        self._scans = ScanFeed(self.vehicle.name, self._bus)
        self._trends = Trends(self._now())
        self._conversation = self._begin(None)

    def _begin(self, link: RosLink | None) -> Conversation:
        return Conversation(
            link,
            self._tuning,
            now=self._now,
            proved=self._prove,
            recognised=lambda title: self._tuned([f"Taken for: {title}"], by=None),
            learned=self._recording.learn,
            noted=lambda text: self._logbook.note("not_received", text),
            timed=lambda asked_s, ros_s: self._transport.clock.answered(asked_s, self._now(), ros_s),
        )

    # -- life --------------------------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Begins to tick, and dials where the vehicle's address is known."""
        self._bus.serve(self.vehicle.name, self.handle)
        self._started_s = self._put_s = self._now()
        self._supervisor.keep("judge", self._run)
        self._supervisor.keep("slow-down", self._slowing.speak)
        self._supervisor.keep("heartbeat", self._slowing.beat)
        self._recording.prepare()
        self._remember()
        if self.vehicle.address:
            self._connect(self.vehicle.address, by=None)

    async def stop(self) -> None:
        self._conversation.end()
        if self._link is not None:
            self._link.stop()
        await self._supervisor.stop()
        await self._recording.stop()

    def recovered(self, found: Recovered) -> None:
        """What became of a recording that the last run of the server left."""
        self._logbook.note("recovered", found.sentence, recording=found.id)

    def _task_restarted(self, name: str, why: str) -> None:
        self._logbook.note("restarted", f"A part of the server failed and was restarted: {name} ({why}).")

    def vitals(self) -> Vitals:
        """The ages that tell whether this session does its work."""
        now_s = self._now()
        return Vitals(
            tick_age_s=now_s - (self._started_s if self._ticked_s is None else self._ticked_s),
            state_age_s=now_s - self._put_s if self._bus.watched(self.vehicle.name) else None,
            log_trouble=self._log_trouble,
            recorder=self._recording.facts(now_s),
            task_problems=(
                *self._supervisor.problems(),
                *(f"The part “{part}” fails: {why}." for part, why in self._failed_parts.items()),
            ),
        )

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            self._lag_s = max(0.0, loop.time() - due_s)
            if self._lag_s > SICK_LOOP_S and self._phase == "monitoring":
                await self._catch_up()
            await self._slowing.go_first()
            try:
                self.tick(put=self._lag_s <= SICK_LOOP_S)
                self._ticked_s = self._now()
            except Exception:  # the one net: a fault in a tick must not end the ticking
                log.exception("a tick of %s failed", self.vehicle.name)
            due_s = max(due_s + TICK_S, loop.time())
            await asyncio.sleep(due_s - loop.time())

    async def _catch_up(self) -> None:
        """After we stood still ourselves: what the car said meanwhile waits to be read, and its silence was ours."""
        if self._lag_s > TELL_STALL_S:
            self._logbook.note(
                "stalled", f"The server stood still for {self._lag_s:.1f} s: nothing was judged meanwhile."
            )
        await asyncio.sleep(READ_UP_S)

    @property
    def phase(self) -> str:
        """idle, connecting, failed, monitoring or lost; docs/protocol.md says what they mean."""
        return self._phase

    @property
    def configured(self) -> str | None:
        """The address of the car this session was started for, whatever has been dialled since."""
        try:
            return address.parse(self.vehicle.address).url if self.vehicle.address else None
        except BadAddress:
            return None

    @property
    def address_url(self) -> str | None:
        return self._address.url if self._address is not None else None

    @property
    def lag_s(self) -> float:
        """How late the newest tick was."""
        return self._lag_s

    @property
    def phones(self) -> int:
        """How many phones tell their position, or why they cannot."""
        return self._state.phones(self._now())

    def tallies(self) -> dict[str, Tally]:
        """What was received and rejected, by signal, since connecting."""
        return self._reception.by_signal

    def tick(self, *, put: bool = True) -> None:
        """Time judges: freshness, silence, delays. Then the pages get a state, unless the loop is too late to be
        trusted."""
        now_s = self._now()
        for part, work in (
            ("event log", self._save_log),
            ("link load", self._watch_load),
            ("link", self._watch_link),
            ("files and connections", self._watch_open_files),
            ("recorder", self._watch_recording),
            ("control", self._watch_control),
            ("slow-down", self._watch_slowing),
        ):
            self._attempt(part, work, now_s)
        self._monitor.failed_parts = tuple(self._failed_parts)
        self._judge(now_s, None)
        if put and not self._state_is_due:
            self._put_state(now_s)

    def _attempt(self, part: str, work: Callable[[float], None], now_s: float) -> None:
        """One part of a tick. Its failure must not keep the checks from being judged; it is an alarm of its own."""
        try:
            work(now_s)
        except Exception as error:
            if part not in self._failed_parts:
                log.exception("the part %s of %s fails", part, self.vehicle.name)
            self._failed_parts[part] = f"{type(error).__name__}: {error}"[:200]
        else:
            self._failed_parts.pop(part, None)

    def _save_log(self, now_s: float) -> None:
        if now_s - self._saved_s >= SAVE_AGAIN_S:
            self._saved_s = now_s
            self._logbook.retry()
            self._log_trouble = self._logbook.trouble or self._bus.save_events()

    def _watch_open_files(self, now_s: float) -> None:
        if now_s - self._files_counted_s >= SAVE_AGAIN_S or self._files_trouble is not None:
            self._files_counted_s, self._files_trouble = now_s, None
            try:
                open_files.demand_free()
            except OSError as why:
                self._files_trouble = why
                raise

    def _watch_control(self, now_s: float) -> None:
        if self._gate.tick(now_s):
            self._put_state_soon()
        self._state.reach(self._gate.facts(now_s))

    def _watch_slowing(self, now_s: float) -> None:
        """What slows the car hears what the judge knows, and the other way round."""
        talk = self._conversation
        way = way_of(phase=self._phase, sources=talk.sources, offered=talk.offered)
        self._slowing.limits = self._monitor.limits.slow_down
        self._slowing.rivals = talk.publishers
        self._slowing.is_steering_known = self._monitor.limits.steering.tyre_rad_per_unit != 0.0
        self._slowing.watch_operators(self._gate.heard_s())
        is_paused = self._pause.since_s is not None
        self._state.slow(
            self._slowing.tick(way, self._monitor.alarms, ros_version=talk.ros_version, is_paused=is_paused)
        )
        talk.watch_commands(way.topic or None, guard=GUARD_STATE if way.has_guard else None)

    @property
    def alarm_load(self) -> AlarmLoad:
        """The alarms announced lately, of whichever car was monitored: it is one operator who bears them."""
        return self._load.at(self._now())

    @property
    def log_trouble(self) -> str | None:
        """Why the log is not kept on the disk, as a sentence; None: it is."""
        return self._log_trouble

    # -- the time before this run ------------------------------------------------------------------------------------

    def _recall(self) -> Past:
        return past.recall(self._bus, self.vehicle.name, now_s=self._now(), wall_ms=self._wall_ms())

    def _remember(self) -> None:
        """At the start: what stood when the server ended is held until a car is monitored again; numbers count on."""
        before = self._recall()
        self._monitor.number_on(before.transitions)
        self._load.add(before.recent)
        self._rides = past.phone_chosen(self._bus, self.vehicle.name)
        self._state.ride(self._rides, self._now())
        for sentence in (self._bus.log_complaint, self._tuning.complaint):
            if sentence:
                self._logbook.note("restarted", sentence)
        if self._tuning.number_on(before.settings_version):
            self._logbook.settings("The settings are not those that were last in force: they were lost.", by=None)
        if before.address is not None or before.standing:
            self._held = before
            self._logbook.note("restarted", before.words(self._monitor.alarms))

    def _come_back(self, target: address.Address) -> Past | None:
        """Before a car is dialled: the past of that very car, where the server ended while it was monitored. Whatever
        stood of another car ends."""
        if self._held is None:
            self._end()
            return None
        self._held = None
        before = self._recall()
        self._monitor.restore(before.transitions)
        if before.address != target.url:
            self._end()
            return None
        self._recording.remember(before.stood)
        self._drop_link()
        self._clear()
        return before

    # -- commands ----------------------------------------------------------------------------------------------------

    async def handle(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Answers a page's command, or what is asked of the session itself: state, refresh, signals, track."""
        if message.get("kind") == "state":
            return self.frame()
        if message.get("kind") == "refresh":
            self._put_state(self._now())
            return {"ok": True}
        if message.get("kind") == "signals":
            return answers.signals(self._conversation.unmapped, self._reception, self._conversation.offered)
        if message.get("kind") == "settings":
            return self._tuning.as_json() | {"toml": self._tuning.as_toml()}
        if message.get("kind") == "trends":
            return wire.trends(self._trends.piece(self._now(), after=message.get("after")))
        if message.get("kind") == "track":
            return answers.track(self._state.snapshot(self._now()))
        if message.get("kind") == "track_points":
            after = message.get("after")
            return answers.track_points(
                self._state.snapshot(self._now()),
                number=self._track_number,
                after=after if isinstance(after, int) else 0,
            )
        caller = Caller.of(message)
        by = caller.name
        try:
            command = commands.read(dict(message))
            if isinstance(command, commands.PresentWord):
                return self._present(command, caller)
            self._gate.admit(command, caller, self._now())
            if isinstance(command, commands.Import):  # a file may take a while to read, and control may pass meanwhile
                read = await asyncio.to_thread(self._tuning.read, command.toml)
                self._gate.admit(command, caller, self._now())
                self._tuned(self._tuning.replace(read), by=by)
                self._put_state(self._now())
            else:
                self._obey(command, caller)
            if isinstance(command, commands.Record):
                await self._recording.demand_settled()
        except answers.REFUSALS as why:
            if isinstance(why, BadAddress) and self._phase in ("idle", "failed"):
                self._phase, self._problem = "failed", problems.of_bad_address(why)
                self._put_state(self._now())
            refusal = answers.refusal(why)
            self._record_command(message, by=by, reason=refusal["reason"])
            return refusal
        self._record_command(message, by=by)
        version = {"version": self._tuning.settings.version} if commands.is_of_settings(command) else {}
        fence = self._gate.fence_of(caller)
        return {"ok": True} | version | ({} if fence is None else {"fence": fence})

    def _record_command(self, message: Mapping[str, Any], *, by: str, reason: str | None = None) -> None:
        """What was ordered is obeyed or refused by now: the answer says so, whether or not it can be recorded."""
        try:
            self._recording.asked(message, by=by, reason=reason)
        except Exception:
            log.exception("a command to %s could not be recorded", self.vehicle.name)

    def _present(self, word: commands.PresentWord, caller: Caller) -> dict[str, Any]:
        if self._gate.hear(word, caller, self._now()):
            self._put_state_soon()
        return {"ok": True}

    def _obey(self, command: commands.Command, caller: Caller) -> None:
        now_s, by = self._now(), caller.name
        match command:
            case commands.Connect():
                self._connect(command.address, by=by)
            case commands.Retry():
                if self._link is None:
                    raise Refused("There is no address to dial.")
                self._link.retry_now()
            case commands.Disconnect():
                self._disconnect(by=by)
            case commands.Pause():
                self._pause.begin(self._state, now_s, by=by)
            case commands.Resume():
                if self._pause.end(self._state, by=by):
                    self._judge(now_s, None)
            case commands.Record():
                self._recording.order(command.on, by=by)
                self._logbook.note("recording", f"Recording {'begins' if command.on else 'ends'}, by hand.", by=by)
                self._watch_recording(now_s)
            case commands.Acknowledge():
                self._tell(self._monitor.acknowledge(command.alarm, command.occurrence, by=by, now_s=now_s))
            case commands.Shelve():
                self._tell(
                    self._monitor.shelve(command.alarm, command.occurrence, minutes=command.minutes, by=by, now_s=now_s)
                )
            case commands.Unshelve():
                self._tell(self._monitor.unshelve(command.alarm, by=by, now_s=now_s))
            case commands.Set():
                lines = self._tuning.change(
                    values=command.values, topics=command.topics, profile=command.profile, version=command.version
                )
                self._tuned(lines, by=by)
            case commands.TakeControl():
                self._gate.obey(command, caller, now_s)
            case commands.Ride():
                self._ride(command.phone, now_s, by=by)
            case commands.Arm() | commands.Disarm() | commands.Decelerate() | commands.Release() | commands.Veto():
                self._slowing.obey(command, by=by)
                self._attempt("slow-down", self._watch_slowing, now_s)
                self._attempt("checks", lambda at_s: self._judge(at_s, None), now_s)
            case commands.Position():
                if self._phase == "idle":
                    raise Refused("No car is monitored: no position is needed.")
                self._state.hear_phone(phone.word(command, now_s, self._wall_ms(), by), now_s)
                return  # many phones may speak every second; the next tick judges and tells
        self._put_state(now_s)

    def _ride(self, phone_: str | None, now_s: float, *, by: str) -> None:
        """From now on this phone is compared with the car, whatever the others tell; it is kept over connections."""
        self._rides = phone_
        self._state.ride(phone_, now_s)
        self._judge(now_s, None)
        self._logbook.note("ride", phone.riding_words(self._state.snapshot(now_s), phone_), by=by, phone=phone_)

    def _tuned(self, lines: Sequence[str], *, by: str | None) -> None:
        """New settings count from this moment on; only then are they logged."""
        self._monitor.limits = self._tuning.limits
        self._state.expect(expected_rates(self._tuning.limits))
        self._conversation.map_again()
        if lines:
            self._logbook.settings("; ".join(lines), by=by)
            self._recording.settings()
        self._judge(self._now(), None)

    def _connect(self, typed: str, *, by: str | None) -> None:
        target = address.parse(typed if typed.strip() else self.vehicle.address or "")
        if self._allowed_hosts and target.host not in self._allowed_hosts and target.shown not in self._allowed_hosts:
            raise BadAddress(
                f"{target.shown} is not among the vehicles this server may dial.",
                "Ask whoever started the server.",
                code="not_allowed",
            )
        before = self._come_back(target)
        self._logbook.started(target.url, target.shown, by=by)
        self._phase, self._address = "connecting", target
        self._link = RosLink(target, self, now=self._now, take_unparsed=self.frame_received, marks=self._transport)
        self._conversation = self._begin(self._link)
        self._link.start()
        if before is not None:
            self._pause.go_on(self._state, before, self._now(), self._wall_ms())
            if before.order is not None:
                self._slowing.resume(before.order)

    def _disconnect(self, *, by: str) -> None:
        was = self._phase
        self._end()
        if was != "idle":
            self._logbook.note("stopped", "Monitoring was stopped.", by=by)

    def _end(self) -> None:
        """One car's monitoring is over: its alarms end in the log, and all that is known of it is forgotten."""
        self._tell(self._monitor.end(self._now()))
        said_farewell = self._slowing.ended()
        self._drop_link(has_last_word=said_farewell)
        self._recording.ended()
        self._pause.forget()
        self._clear()

    def _drop_link(self, *, has_last_word: bool = False) -> None:
        self._conversation.end()
        if self._link is not None:
            self._link.stop(has_last_word=has_last_word)
            self._link = None

    # -- what the link says (LinkListener) ---------------------------------------------------------------------------

    def link_opened(self) -> None:
        link = self._link
        assert link is not None
        if self._phase == "connecting" or not self._proved:
            self._supervisor.keep("proof", partial(self._demand_proof, link), may_end=True)
        if self._proved:
            self._reopened()
        self._supervisor.keep("subscriptions", self._conversation.go_on, may_end=True)

    def link_closed(self, problem: Problem) -> None:
        now_s = self._now()
        self._slowing.link_closed()
        if problem.code == problems.BRIDGE_SILENT:
            self._conversation.fell_silent()
        if self._proved:
            is_new = self._phase != "lost"
            self._problem = problem
            if is_new:
                self._phase, self._since_s = "lost", now_s
                self._logbook.note("lost", problem.title)
                self._recording.link(phase="lost", problem=problem.title)
                self._recording.link_lost()
        elif self._address is not None and self._phase != "failed":
            self._phase = "failed"
            software = self._link.server_software if self._link is not None else ""
            is_named = problem.code == problems.LOGIN_WANTED or software.startswith(problems.ROSBRIDGE_SERVERS)
            self._problem = problem if is_named else problems.not_rosbridge(self._address, "It closes the connection.")
        self._dialled_s = now_s
        self._after_link_change(now_s)

    def dial_failed(self, problem: Problem) -> None:
        now_s = self._now()
        if self._phase in ("connecting", "failed"):
            if self._phase == "connecting":
                self._since_s = now_s
            self._phase = "failed"
        elif problem.code == "not_rosbridge" and self._address is not None:
            problem = problems.bridge_silent(self._address)  # it was a rosbridge before: it hangs
        self._problem = problem
        self._after_link_change(now_s)

    def status_received(self, level: str, text: str) -> None:
        self._prove()
        log.info("the bridge of %s says: %s: %s", self.vehicle.name, level, text)
        if level == "error":
            self._conversation.bridge_complains(text)

    def junk_received(self, why: str) -> None:
        self._reception.junk(why)
        if why == "binary noise" and self._scans.is_empty:
            self._conversation.binary_noise()

    def large_skipped(self, topic: str | None, size: int) -> None:
        self._conversation.skipped(topic, size)

    def frame_received(self, frame: RawFrame) -> bool:
        """A message that is only recorded goes to the recorder as it came: parsing it is no work for the loop."""
        if frame.topic not in self._conversation.others or frame.topic in (GUARD_STATE, CLIENT_COUNT):
            return False
        self._conversation.heard(frame.topic)
        if self._recording.is_on:
            self._record(frame.topic, frame, self._now(), len(frame.payload))
        return True

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        """One message of the car: decoded, applied and judged in the same pass."""
        now_s = self._now()
        talk = self._conversation
        talk.heard(topic)
        if self._recording.is_on and self._link is not None:
            self._record(topic, message, now_s, self._link.frame_bytes)
        if self._slowing.heard(topic, message) or talk.took(topic, message):
            return
        if topic in talk.others:
            return  # heard to be recorded: what is judged must not depend on what is recorded
        sources = talk.by_topic.get(topic)
        if sources is None:
            self._reception.unasked += 1
            return
        self._prove()
        self._heard.add(topic)
        self._last_message_s = now_s
        changed = judging.receive(
            sources,
            message,
            now_s,
            note,
            reception=self._reception,
            state=self._state,
            profile=self._tuning.profile,
            tyre_rad_per_unit=self._monitor.limits.steering.tyre_rad_per_unit,
            transport=self._transport,
        )
        if changed:
            self._judge(now_s, changed)
            self._trends.hear(changed, self._state, now_s)
        if "scan" in changed:
            self._scans.count()
            if self._scans.is_due(now_s):
                self._scans.put(
                    self._state.snapshot(now_s),
                    self._monitor.limits.obstacle,
                    was_active="obstacle" in self._monitor.alarms and self._monitor.alarms["obstacle"].active,
                    kinds_kept=not isinstance(message["ranges"], list),
                )

    def _record(self, topic: str, message: Any, now_s: float, size: int) -> None:
        """A recording that fails must not keep the message from being judged."""
        try:
            self._recording.ros_version = self._conversation.ros_version  # a part begins with its first message
            self._recording.take(topic, self._conversation.type_of(topic), message, now_s, size)
        except Exception as error:
            if RECORDING not in self._failed_parts:
                log.exception("a message of %s could not be handed to the recorder", topic)
            self._failed_parts[RECORDING] = f"{type(error).__name__}: {error}"[:200]
        else:
            self._failed_parts.pop(RECORDING, None)

    # -- is it a rosbridge? ------------------------------------------------------------------------------------------

    async def _demand_proof(self, link: RosLink) -> None:
        """A WebSocket that says nothing of rosbridge's is not one."""
        await asyncio.sleep(PROOF_WITHIN_S)
        if link is self._link and link.is_open and not self._proved and self._address is not None:
            self._phase = "failed"
            self._problem = problems.not_proved(self._address, link.server_software, link.junk_count)
            link.abort()
            self._after_link_change(self._now())

    def _prove(self) -> None:
        """The first operation of rosbridge: this is one."""
        if not self._proved:
            self._proved = True
            self._connected_s = self._now()
            self._logbook.note("connected", f"Connected to {self._address.shown if self._address else 'the car'}.")
        if self._phase != "monitoring" and self._link is not None and self._link.is_open:
            self._reopened()

    def _reopened(self) -> None:
        now_s = self._now()
        self._phase, self._since_s, self._problem = "monitoring", now_s, None
        self._recording.link_opened(self.address_url)
        self._recording.link(phase="monitoring", problem=None)
        if self._link is not None:
            self._slowing.link_opened(self._link)
        self._after_link_change(now_s)

    # -- judging -----------------------------------------------------------------------------------------------------

    def _watch_link(self, now_s: float) -> None:
        self._state.link(self._facts(now_s))

    def _watch_load(self, now_s: float) -> None:
        """A slow link is asked for less before what is judged grows old."""
        if self._phase == "monitoring" and self._conversation.watch_load(self._transport.queued_s(now_s)):
            load, late_s = self._conversation.load, self._transport.late_s(now_s)
            why = f"The link is slow, {late_s:.1f} s late" if late_s > RESTORE_BELOW_S else "The link is in time"
            self._logbook.note("reduced", f"{why}. {load.level.words}.", step=load.step)

    def _watch_recording(self, now_s: float) -> None:
        """The recorder hears what the conversation knows, and the other way round."""
        self._recording.ros_version = self._conversation.ros_version
        self._recording.missing = self._conversation.missing
        self._recording.tick(now_s)
        if self._phase == "monitoring":
            facts = self._facts(now_s)
            link = LinkDelay(now_s, facts.late_s, facts.throttled, facts.reduced)
            self._recording.delays(self._transport.delays(), link)
        self._conversation.record(self._recording.also)
        self._state.recorder(self._recording.facts(now_s))

    def _facts(self, now_s: float) -> LinkFacts:
        link = self._link
        heard_s = link.heard_s if link is not None else None
        behind = self._behind(now_s)
        return LinkFacts(
            phase=self._phase,
            since_s=self._since_s,
            attempts=link.attempts if link is not None else 0,
            bridge_heard_s=heard_s,
            bridge_answers=self.bridge_answers(now_s),
            problem_title=self._problem.title if self._problem else None,
            problem_hint=self._problem.hint if self._problem else None,
            behind_title=behind.title if behind else None,
            behind_hint=behind.hint if behind else None,
            behind_mark=behind.mark if behind else None,
            topics_subscribed=self._conversation.judged,
            connected_s=self._connected_s,
            last_message_s=self._last_message_s,
            published=self._conversation.published(),
            log_trouble=self._log_trouble,
            late_s=self._transport.late_s(now_s) if self._phase == "monitoring" else None,
            throttled=self._conversation.load.throttled(now_s),
            reduced=f"{self._conversation.load.level.words}." if self._conversation.load.step else None,
            wall_zero_s=self._wall_ms() / 1000 - now_s,
        )

    def bridge_answers(self, now_s: float) -> bool:
        link = self._link
        return link is not None and link.is_open and link.heard_s is not None and now_s - link.heard_s < BRIDGE_SILENT_S

    def _behind(self, now_s: float) -> Problem | None:
        """The part that failed behind the open bridge, whether or not messages still come."""
        if self._phase != "monitoring":
            return None
        flows = self._last_message_s is not None and now_s - self._last_message_s < FLOWS_S
        return self._conversation.problem(now_s, flows=flows)

    def _after_link_change(self, now_s: float) -> None:
        self._watch_link(now_s)
        self._judge(now_s, None)
        self._put_state(now_s)

    def _judge(self, now_s: float, changed: tuple[str, ...] | None) -> None:
        transitions = judging.judge(self._monitor, self._state, now_s, changed)
        if self._monitor.crashes:
            self._log_crashes()
        if transitions:
            self._tell(transitions)
            self._put_state_soon()

    def _log_crashes(self) -> None:
        """Each failing check once; the page says "monitoring impaired" as long as it fails."""
        for crash in self._monitor.crashes.values():
            if crash.check_id not in self._crashes_told:
                self._crashes_told.add(crash.check_id)
                log.error("check %s failed: %s\n%s", crash.check_id, crash.error, crash.where)

    def _tell(self, transitions: Collection[Transition]) -> None:
        self._load.add(transitions)
        self._logbook.tell(transitions, self._monitor.alarms, self._now())

    # -- frames ------------------------------------------------------------------------------------------------------

    def frame(self) -> dict[str, Any]:
        """The whole state, as `/api/state` answers it."""
        now_s = self._now()
        self._watch_link(now_s)
        facts = Facts(
            vehicle=self.vehicle.name,
            server=self._server() | {"loop_lag_ms": round(self._lag_s * 1000, 1)},
            now_s=now_s,
            wall_ms=self._wall_ms(),
            phase=self._phase,
            address=self._address,
            configured=self.configured,
            ros_version=self._conversation.ros_version,
            connected_s=self._connected_s,
            paused_since_s=self._pause.since_s,
            paused_by=self._pause.by,
            held=self._held,
            load=self.alarm_load,
            log_trouble=self._log_trouble,
            profile=self._tuning.profile.title,
            settings_version=self._tuning.settings.version,
            since_s=self._since_s,
            dialled_s=self._dialled_s,
            problem=self._problem,
            link=self._link,
            last_message_s=self._last_message_s,
            ros_answered_s=self._conversation.ros_answered_s,
            ros_alive=self._conversation.ros_alive,
            offers_nothing=self._conversation.offers_nothing,
            behind=self._behind(now_s),
            bridge_answers=self.bridge_answers(now_s),
            reception=self._reception,
            sources=self._conversation.sources,
            topics_heard=len(self._heard),
            topics_judged=self._conversation.judged,
            recording=self._recording.frame(now_s),
            trends=self._trends.piece(now_s, at_most=TRENDS_A_FRAME),
            track_number=self._track_number,
            operators=self._gate.as_json(now_s, self._wall_ms()),
            decelerate=self._slowing.frame(),
        )
        return state_frame(facts, self._state.snapshot(now_s), self._monitor)

    def _put_state_soon(self) -> None:
        """Once the events have gone out: they must not wait until a state is made. Several changes make one state."""
        if not self._state_is_due:
            self._state_is_due = True
            asyncio.get_running_loop().call_later(EVENTS_FIRST_S, self._put_due_state)

    def _put_due_state(self) -> None:
        if self._state_is_due:  # else one was put meanwhile
            self._put_state(self._now())

    def _put_state(self, now_s: float) -> None:
        """Never raises: an order that was obeyed is not answered with an error because no state can be made. Pages
        that get none cover their values."""
        self._state_is_due = False
        try:
            if self._bus.watched(self.vehicle.name):
                self._bus.put(self.vehicle.name, "state", orjson.dumps(self.frame()).decode())
        except Exception as error:
            if self._state_failure != (failure := f"{type(error).__name__}: {error}"):
                self._state_failure = failure
                log.exception("no state of %s can be made", self.vehicle.name)
        else:
            self._state_failure, self._put_s = "", now_s

"""The one owner and single writer of a vehicle's state: hears the link, lets the monitor judge, tells the bus."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import orjson

from monitor.catalog import AnyCheck
from monitor.runner import Monitor, Refused, Transition
from monitor.signal_limits import expected_rates
from monitor.signals import SIGNALS
from monitor.state import LinkFacts, Phase, State
from monitor.values import LaserScan
from server import address, commands, discovery, judging, problems, wire
from server.address import BadAddress
from server.bus import LocalBus
from server.config import Vehicle
from server.frame import Facts, state_frame
from server.judging import TICK_S
from server.link import LinkDown, RosLink, Subscription
from server.problems import Problem
from server.reception import Reception, Tally
from server.settings import BadSetting, Conflict, SettingsFile
from server.topics import BY_SIGNAL, TOPICS, Source, map_signals
from server.tuning import Tuning

log = logging.getLogger("catgraph.session")

SCAN_FRAME_S = 0.05  # pages are offered at most 20 scans a second
SICK_LOOP_S = 0.25  # a loop later than this lets one heartbeat fall: a sign of life from a sick server is a lie
PROOF_WITHIN_S = 4.0  # something that speaks WebSocket and no rosbridge is told apart by then
ALIVE_EVERY_S = 1.0
LOOK_AGAIN_S = 5.0  # the car's software may start after its bridge
BRIDGE_SILENT_S = 1.4  # the bridge answers a ping every 0.5 s
CBOR_TRIES = 5  # unreadable binary frames before scans are asked for as JSON


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
    ) -> None:
        self.vehicle = vehicle
        self._bus = bus
        self._now = now
        self._wall_ms = wall_ms
        self._server = server
        self._allowed_hosts = frozenset(allowed_hosts)
        self._tuning = Tuning(settings or SettingsFile(None))
        self._monitor = Monitor(checks, self._tuning.limits)
        self._crashes_told: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._lag_s = 0.0
        self._state_is_due = False
        self._paused_since_s: float | None = None
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
        self._ros_alive: bool | None = None
        self._ros_alive_s: float | None = None
        self._ros_version: int | None = None
        self._sources: dict[str, Source] = {}
        self._by_topic: dict[str, tuple[Source, ...]] = {}
        self._unmapped: dict[str, str] = {}
        self._heard: set[str] = set()
        self._proved = False
        self._looked = False
        self._offers_nothing = False
        self._reception = Reception()
        self._state = State(expected_rates(self._tuning.limits))
        self._offer: discovery.Offer | None = None
        self._scan_number = 0
        self._scan_kept = False
        self._scan_put_s = -1.0
        self._cbor_failed = False  # then scans come as JSON
        self._cbor_noise = 0

    # -- life --------------------------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Begins to tick, and dials where the vehicle's address is known."""
        self._bus.serve(self.vehicle.name, self.handle)
        self._spawn(self._run(), "tick")
        if self._tuning.complaint:
            self._note("settings", self._tuning.complaint)
        if self.vehicle.address:
            self._connect(self.vehicle.address)

    async def stop(self) -> None:
        if self._link is not None:
            self._link.stop()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _spawn(self, work: Any, name: str) -> asyncio.Task[None]:
        task = asyncio.get_running_loop().create_task(work, name=f"{self.vehicle.name} {name}")
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and task.exception() is not None:
            log.error("%s failed", task.get_name(), exc_info=task.exception())

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            self._lag_s = max(0.0, loop.time() - due_s)
            try:
                self.tick(put=self._lag_s <= SICK_LOOP_S)
            except Exception:  # the one net: a fault in a tick must not end the ticking
                log.exception("a tick of %s failed", self.vehicle.name)
            due_s = max(due_s + TICK_S, loop.time())
            await asyncio.sleep(due_s - loop.time())

    @property
    def phase(self) -> str:
        """idle, connecting, failed, monitoring or lost; docs/protocol.md says what they mean."""
        return self._phase

    @property
    def address_url(self) -> str | None:
        return self._address.url if self._address is not None else None

    @property
    def lag_s(self) -> float:
        """How late the newest tick was."""
        return self._lag_s

    def tallies(self) -> dict[str, Tally]:
        """What was received and rejected, by signal, since connecting."""
        return self._reception.by_signal

    def tick(self, *, put: bool = True) -> None:
        """Time judges: freshness, silence, delays. Then the pages get a state, unless the loop is too late to be
        trusted."""
        now_s = self._now()
        self._watch_link(now_s)
        self._judge(now_s, None)
        if put:
            self._put_state(now_s)

    # -- commands ----------------------------------------------------------------------------------------------------

    async def handle(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Answers a page's command, or what is asked of the session itself: state, refresh, signals, track."""
        if message.get("kind") == "state":
            return self.frame()
        if message.get("kind") == "refresh":
            self._put_state(self._now())
            return {"ok": True}
        if message.get("kind") == "signals":
            return self._signals()
        if message.get("kind") == "settings":
            return self._tuning.as_json() | {"toml": self._tuning.as_toml()}
        if message.get("kind") == "track":
            return self._track()
        try:
            command = commands.read(dict(message))
            self._obey(command)
        except commands.NotUnderstood as why:
            return {"ok": False, "reason": str(why)}
        except BadAddress as error:
            problem = problems.of_bad_address(error)
            if self._phase in ("idle", "failed"):
                self._phase, self._problem = "failed", problem
                self._put_state(self._now())
            return {
                "ok": False,
                "reason": f"{problem.title} {problem.hint}".strip(),
                "problem": problem.as_json() | {"suggestion": error.suggestion},
            }
        except Refused as why:
            return {"ok": False, "reason": why.reason}
        except BadSetting as why:
            return {"ok": False, "reason": str(why), "field": why.field}
        except Conflict as why:
            return {"ok": False, "reason": str(why), "conflict": True}
        except OSError as why:
            return {"ok": False, "reason": f"The settings cannot be kept: {why.strerror or why}."}
        return {"ok": True}

    def _obey(self, command: commands.Command) -> None:
        now_s = self._now()
        match command:
            case commands.Connect():
                self._connect(command.address)
            case commands.Retry():
                if self._link is None:
                    raise Refused("There is no address to dial.")
                self._link.retry_now()
            case commands.Disconnect():
                self._disconnect()
            case commands.Pause():
                self._pause(now_s)
            case commands.Resume():
                self._resume(now_s)
            case commands.Acknowledge():
                self._tell(self._monitor.acknowledge(command.alarm, command.occurrence, by="operator", now_s=now_s))
            case commands.Shelve():
                self._tell(
                    self._monitor.shelve(
                        command.alarm, command.occurrence, minutes=command.minutes, by="operator", now_s=now_s
                    )
                )
            case commands.Unshelve():
                self._tell(self._monitor.unshelve(command.alarm, by="operator", now_s=now_s))
            case commands.Set():
                lines = self._tuning.change(
                    values=command.values, topics=command.topics, profile=command.profile, version=command.version
                )
                self._tuned(lines, by="operator")
            case commands.Import():
                self._tuned(self._tuning.replace(command.toml), by="operator")
        self._put_state(now_s)

    def _tuned(self, lines: Sequence[str], *, by: str | None) -> None:
        """New settings count from this moment on."""
        if lines:
            self._note("settings", "; ".join(lines), by=by)
        self._monitor.limits = self._tuning.limits
        self._state.expect(expected_rates(self._tuning.limits))
        if self._offer is not None:
            self._map(self._offer)
        self._judge(self._now(), None)

    def _connect(self, typed: str) -> None:
        target = address.parse(typed)
        if self._allowed_hosts and target.host not in self._allowed_hosts and target.shown not in self._allowed_hosts:
            raise BadAddress(
                f"{target.shown} is not among the vehicles this server may dial.",
                "Ask whoever started the server.",
                code="not_allowed",
            )
        self._end()
        self._phase, self._address = "connecting", target
        self._link = RosLink(target, self, now=self._now)
        self._link.start()

    def _disconnect(self) -> None:
        was = self._phase
        self._end()
        if was != "idle":
            self._note("stopped", "Monitoring was stopped.")

    def _end(self) -> None:
        """One car's monitoring is over: its alarms end in the log, and all that is known of it is forgotten."""
        self._tell(self._monitor.end(self._now()))
        self._drop_link()
        self._paused_since_s = None
        self._clear()

    def _drop_link(self) -> None:
        if self._link is not None:
            self._link.stop()
            self._link = None

    def _pause(self, now_s: float) -> None:
        if self._paused_since_s is None:
            self._paused_since_s = now_s
            self._state.set_paused(True)
            self._note("paused", "Monitoring is paused: no alarm will come.")

    def _resume(self, now_s: float) -> None:
        if self._paused_since_s is not None:
            self._paused_since_s = None
            self._state.set_paused(False)
            self._note("resumed", "Monitoring goes on.")
            self._judge(now_s, None)

    # -- what the link says (LinkListener) ---------------------------------------------------------------------------

    def link_opened(self) -> None:
        link = self._link
        assert link is not None
        if self._phase == "connecting" or not self._proved:
            self._spawn(self._demand_proof(link), "proof")
        if self._proved:
            self._reopened()
        self._spawn(self._converse(link), "conversation")

    def link_closed(self, problem: Problem) -> None:
        now_s = self._now()
        if self._proved:
            if self._phase != "lost":
                self._phase, self._since_s = "lost", now_s
                self._note("lost", problem.title)
            self._problem = problem
        elif self._address is not None and self._phase != "failed":
            self._phase = "failed"
            self._problem = problems.not_rosbridge(self._address, "It closes the connection.")
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
        if level == "error" and "cbor" in text.lower() and "compression" in text.lower() and not self._cbor_failed:
            self._cbor_failed = True  # an old bridge: scans come as JSON from now on
            self._subscribe()

    def junk_received(self, why: str) -> None:
        self._reception.junk(why)
        if why == "binary noise" and not self._scan_number and not self._cbor_failed:
            self._cbor_noise += 1
            if self._cbor_noise >= CBOR_TRIES:
                self._cbor_failed = True
                self._subscribe()

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        """One message of the car: decoded, applied and judged in the same pass."""
        now_s = self._now()
        sources = self._by_topic.get(topic)
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
        )
        if changed:
            self._judge(now_s, changed)
        if "scan" in changed:
            self._scan_kept = not isinstance(message["ranges"], list)
            self._scan_number += 1
            self._put_scan(now_s)

    # -- conversation with the bridge --------------------------------------------------------------------------------

    async def _demand_proof(self, link: RosLink) -> None:
        """A WebSocket that says nothing of rosbridge's is not one."""
        await asyncio.sleep(PROOF_WITHIN_S)
        if link is self._link and link.is_open and not self._proved and self._address is not None:
            self._phase = "failed"
            self._problem = problems.not_rosbridge(self._address, "It speaks WebSocket, but not rosbridge's protocol.")
            link.abort()
            self._after_link_change(self._now())

    def _prove(self) -> None:
        """The first operation of rosbridge: this is one."""
        if not self._proved:
            self._proved = True
            self._connected_s = self._now()
            self._note("connected", f"Connected to {self._address.shown if self._address else 'the car'}.")
        if self._phase != "monitoring" and self._link is not None and self._link.is_open:
            self._reopened()

    def _reopened(self) -> None:
        now_s = self._now()
        self._phase, self._since_s, self._problem = "monitoring", now_s, None
        self._after_link_change(now_s)

    async def _converse(self, link: RosLink) -> None:
        """While this opening lasts: looks at what the car offers, and asks whether ROS behind the bridge lives."""
        looked_s = -LOOK_AGAIN_S
        while link is self._link and link.is_open:
            try:
                if self._now() - looked_s >= (LOOK_AGAIN_S if self._sources else 1.0):
                    looked_s = self._now()
                    await self._look(link)
                alive = await discovery.ask_alive(link)
            except LinkDown:
                return
            if link is not self._link:
                return
            if alive:
                self._ros_alive_s = self._now()
                self._prove()
            self._ros_alive = alive if self._ros_alive_s is not None else None
            await asyncio.sleep(ALIVE_EVERY_S)

    async def _look(self, link: RosLink) -> None:
        offer = await discovery.ask_topics(link)
        if link is not self._link:
            return
        if offer is None:
            if not self._looked and not self._sources:
                self._subscribe_by_name(link)  # no rosapi: try the names we know
            return
        self._looked = True
        self._prove()
        self._ros_version = offer.ros or self._ros_version
        self._offer = offer
        if self._tuning.recognise(offer.topics, offer.ros):
            self._tuned([f"Taken for: {self._tuning.profile.title}"], by=None)
        self._map(offer)

    def _map(self, offer: discovery.Offer) -> None:
        """Chooses the topic of each signal and subscribes to them."""
        sources = map_signals(offer.topics, self._tuning.settings.topics)
        gone = {
            s: source for s, source in self._sources.items() if s not in sources and source.topic not in offer.topics
        }
        self._sources = gone | sources  # a topic that vanished stays subscribed: it may come back
        mapped = {source.topic for source in self._sources.values()}
        self._unmapped = {name: kind for name, kind in offer.topics.items() if name not in mapped}
        self._offers_nothing = not self._sources
        self._subscribe()

    def _subscribe(self) -> None:
        link = self._link
        if link is None:
            return
        self._by_topic = judging.by_topic(self._sources.values())
        wanted = {}
        for topic, sources in self._by_topic.items():
            rows = [BY_SIGNAL[source.signal] for source in sources if source.decode is not None]
            if rows:
                wanted[topic] = Subscription(
                    topic=topic,
                    type=sources[0].type,
                    compression="cbor" if rows[0].compression == "cbor" and not self._cbor_failed else "none",
                    queue_length=min(row.queue_length for row in rows),
                )
        for row in link.subscriptions:
            if row.topic not in wanted:
                link.unsubscribe(row.topic)
        for subscription in wanted.values():
            link.subscribe(subscription)

    def _subscribe_by_name(self, link: RosLink) -> None:
        """Without rosapi: every name of the table, its type left to the bridge."""
        by_topic: dict[str, tuple[Source, ...]] = {}
        for row in TOPICS:
            for name in row.names:
                source = Source(
                    signal=row.signal,
                    topic=name,
                    type=None,
                    decode=row.types[row.expected_type],
                    note="subscribed by name: the bridge has no rosapi",
                )
                by_topic[name] = (source,)
                link.subscribe(Subscription(topic=name, type=None, queue_length=row.queue_length))
        self._by_topic = by_topic

    # -- judging -----------------------------------------------------------------------------------------------------

    def _watch_link(self, now_s: float) -> None:
        self._state.link(self._facts(now_s))

    def _facts(self, now_s: float) -> LinkFacts:
        link = self._link
        heard_s = link.heard_s if link is not None else None
        return LinkFacts(
            phase=self._phase,
            since_s=self._since_s,
            attempts=link.attempts if link is not None else 0,
            bridge_heard_s=heard_s,
            bridge_answers=self.bridge_answers(now_s),
            problem_title=self._problem.title if self._problem else None,
            problem_hint=self._problem.hint if self._problem else None,
            topics_subscribed=len(link.subscriptions) if link is not None else 0,
            connected_s=self._connected_s,
            last_message_s=self._last_message_s,
            published=judging.published(self._sources.values()),
        )

    def bridge_answers(self, now_s: float) -> bool:
        link = self._link
        return link is not None and link.is_open and link.heard_s is not None and now_s - link.heard_s < BRIDGE_SILENT_S

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
        at_ms = self._wall_ms()
        self._bus.append(
            self.vehicle.name,
            [
                wire.event(t, self._monitor.alarms[t.alarm_id], at_ms, self._tuning.settings.version)
                for t in transitions
            ],
        )

    def _note(self, change: str, text: str, *, by: str | None = None) -> None:
        self._bus.append(
            self.vehicle.name, [{"at_ms": self._wall_ms(), "alarm": None, "change": change, "text": text, "by": by}]
        )

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
            ros_version=self._ros_version,
            connected_s=self._connected_s,
            paused_since_s=self._paused_since_s,
            profile=self._tuning.profile.title,
            settings_version=self._tuning.settings.version,
            since_s=self._since_s,
            dialled_s=self._dialled_s,
            problem=self._problem,
            link=self._link,
            last_message_s=self._last_message_s,
            ros_answered_s=self._ros_alive_s,
            ros_alive=self._ros_alive,
            offers_nothing=self._offers_nothing,
            bridge_answers=self.bridge_answers(now_s),
            reception=self._reception,
            sources=self._sources,
            topics_heard=len(self._heard),
        )
        return state_frame(facts, self._state.snapshot(now_s), self._monitor)

    def _put_state_soon(self) -> None:
        """Once the events have gone out: they must not wait until a state is made. Several changes make one state."""
        if not self._state_is_due:
            self._state_is_due = True
            asyncio.get_running_loop().call_soon(self._put_due_state)

    def _put_due_state(self) -> None:
        if self._state_is_due:  # else one was put meanwhile
            self._put_state(self._now())

    def _put_state(self, now_s: float) -> None:
        self._state_is_due = False
        if self._bus.watched(self.vehicle.name):
            self._bus.put(self.vehicle.name, "state", orjson.dumps(self.frame()).decode())

    def _put_scan(self, now_s: float) -> None:
        if now_s - self._scan_put_s < SCAN_FRAME_S or not self._bus.wanted(self.vehicle.name, "scan"):
            return
        reading = self._state.snapshot(now_s).get("scan")
        if reading is not None and isinstance(reading.value, LaserScan):
            self._scan_put_s = now_s
            frame = wire.scan_frame(
                reading.value,
                number=self._scan_number,
                age_s=now_s - reading.received_s,
                kinds_kept=self._scan_kept,
            )
            self._bus.put(self.vehicle.name, "scan", frame)

    def _track(self) -> dict[str, Any]:
        """The positions since connecting, thinned, as a GeoJSON LineString (longitude, latitude; WGS84)."""
        snapshot = self._state.snapshot(self._now())
        points = [[round(p.lon_deg, 7), round(p.lat_deg, 7)] for p in snapshot.track]
        return {
            "type": "Feature",
            "geometry": {"type": "LineString", "coordinates": points},
            "properties": {"length_m": wire.plain(snapshot.track_m, 1)},
        }

    def _signals(self) -> dict[str, Any]:
        """Topics beyond the signals, and what came that was no message."""
        return {
            "topics": [{"topic": name, "type": kind} for name, kind in sorted(self._unmapped.items())],
            "rejected": {
                SIGNALS[name].label: dict(tally.reasons)
                for name, tally in self._reception.by_signal.items()
                if tally.rejected
            },
            "unreadable_frames": dict(self._reception.frames.reasons),
            "unasked": self._reception.unasked,
        }

"""One way through a recording: every message and every tick up to a moment, judged as the drive itself was."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from monitor.alarm import Alarm, Transition
from monitor.check import Verdict
from monitor.load import RecentLoad
from monitor.phones import PhoneWord
from monitor.restoring import restore
from monitor.runner import Monitor
from monitor.signal_limits import expected_rates
from monitor.state import LinkFacts, State
from monitor.trends import Trends
from server import judging, wire
from server.bridge.names import BadName, canonical_name
from server.frame import Facts, state_frame
from server.judging import TICK_S
from server.playback.slowed import SlowDownTold, Slowed
from server.playback.told import NewSettings, Pause, Told
from server.reception import Reception
from server.recording.delay import LinkDelay, RecordedDelay
from server.recording.read import Recording
from server.rehearsal.thresholds import Wishes, tuning_for
from server.scan_feed import judged
from server.settings import BadSetting, from_toml
from server.source import Message
from server.topics import Source, map_signals
from server.tuning import Tuning

SILENCE_S = 600.0  # after so long without a message nothing new can be said: the judge is not stepped through the rest
LOOK_EVERY = 24  # steps between two looks at the clock: some 2 ms
TRENDS_A_FRAME = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Ways:
    """How a recording is judged under one version of the settings."""

    tuning: Tuning
    sources: Mapping[str, Source]  # by signal
    listeners: Mapping[str, tuple[Source, ...]]  # by topic as the recording spells it

    @property
    def published(self) -> frozenset[str]:
        return judging.published(self.sources.values())


@dataclass(slots=True, kw_only=True)
class Known:
    """All that a run has made of what it read: with it, it goes on from there."""

    state: State
    monitor: Monitor
    trends: Trends
    opened_s: float
    at_s: float
    told: dict[str, Alarm]  # as the recording tells them
    reception: Reception = field(default_factory=Reception)
    load: RecentLoad = field(default_factory=RecentLoad)
    heard: set[str] = field(default_factory=set)
    ticks: int = 0  # done
    words: int = 0  # of the recording's own, taken
    ways: int = 0  # how many changes of the settings have come
    scans: int = 0
    kinds_kept: bool = True
    last_message_s: float | None = None
    paused_s: float | None = None
    paused_by: str | None = None
    slowed: Slowed = field(default_factory=Slowed)


class Drive:
    """What does not change while a recording is run through, however often: its topics, its words, its settings."""

    def __init__(self, recording: Recording, told: Told, settings: str) -> None:
        """`settings`: the file of all settings that count where the recording does not say which were in force."""
        self.told = told
        self.start_s = recording.start_s
        self.length_s = recording.duration_s
        self.ros_version = recording.ros_version
        self.notes: list[str] = [*recording.notes, *told.notes]
        delay = RecordedDelay(recording)
        self.delay = delay if delay.is_known else None
        self._names: dict[str, str] = {}  # as the recording spells a topic → as a bridge would offer it
        for topic in recording.topics:
            with contextlib.suppress(BadName):
                self._names[topic] = canonical_name(topic)
        self._offered = {name: recording.topics[topic].type for topic, name in self._names.items()}
        self.settings_from_recording = told.settings is not None
        self.ways: list[Ways] = [self._ways(told.settings if told.settings is not None else settings)]
        self.ways += [self._ways(word.toml) for _, word in told.words if isinstance(word, NewSettings)]
        self.topics = frozenset(topic for ways in self.ways for topic in ways.listeners)

    def _ways(self, toml: str) -> Ways:
        try:
            read = from_toml(toml)
            wishes = Wishes(values=read.values, topics=read.topics, profile=read.profile)
            tuning = tuning_for(wishes, self._offered, self.ros_version)
        except BadSetting as why:
            self.notes.append(f"The settings cannot be used, so the defaults are: {why}")
            tuning = tuning_for(Wishes(), self._offered, self.ros_version)
        sources = map_signals(self._offered, tuning.settings.topics)
        by_topic = judging.by_topic(sources.values())
        found = {topic: by_topic.get(name, ()) for topic, name in self._names.items()}
        listeners = {
            topic: sources for topic, sources in found.items() if any(source.decode is not None for source in sources)
        }
        return Ways(tuning=tuning, sources=sources, listeners=listeners)


class Run:
    """Goes forward only; for another moment begin another, or go on from what was known. Times are seconds since the
    beginning of the recording."""

    def __init__(
        self,
        recording: Recording,
        drive: Drive,
        *,
        from_s: float = 0.0,
        known: Known | None = None,
        on_told: Callable[[Sequence[Transition]], None] = lambda _: None,
        on_judged: Callable[[Sequence[Transition]], None] = lambda _: None,
        on_changed: Callable[[tuple[str, ...], State, float], None] = lambda *_: None,
        on_message: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Begins at `from_s` knowing nothing, or goes on from what is `known`."""
        self.drive = drive
        self._recording = recording
        self._on_told, self._on_judged, self._on_changed, self._on_message = on_told, on_judged, on_changed, on_message
        is_new = known is None
        self.known = self._begin(from_s) if known is None else known
        self._ways = drive.ways[self.known.ways]
        self._teller = Monitor(limits=self._ways.tuning.limits)  # sorts what the recording tells, and judges nothing
        self._messages = self._read()
        self._next: Message | None = next(self._messages, None)
        if is_new:
            self._skip_words(from_s)

    def _begin(self, from_s: float) -> Known:
        ways = self.drive.ways[0]
        limits = ways.tuning.limits
        monitor = Monitor(limits=limits)
        return Known(
            state=State(expected_rates(limits)),
            monitor=monitor,
            trends=Trends(from_s),
            opened_s=from_s,
            at_s=from_s,
            told=Monitor(limits=limits).alarms,
        )

    @property
    def at_s(self) -> float:
        """Everything up to here is in it."""
        return self.known.at_s

    @property
    def is_at_end(self) -> bool:
        return self._next is None and self.known.at_s >= self.drive.length_s

    def advance(self, until_s: float, is_over: Callable[[], bool] = lambda: False) -> bool:
        """Takes all there is up to a moment, that moment included. False: the time given was over before.

        Raises RecordingUnreadable.
        """
        known, words = self.known, self.drive.told.words
        steps = 0
        while True:
            message = self._next
            message_s = message.at_s - self.drive.start_s if message is not None else math.inf
            tick_s = self._tick_s(message_s)
            word_s = words[known.words][0] if known.words < len(words) else math.inf
            moment_s = min(message_s, tick_s, word_s)
            if moment_s > until_s:
                known.at_s = max(known.at_s, until_s)
                return True
            if word_s <= moment_s:
                known.words += 1
                self._hear(words[known.words - 1][1], word_s)
            elif tick_s <= moment_s:
                known.ticks += 1
                self._judge(tick_s, None)
            elif message is not None:
                self._receive(message, message_s)
                self._next = next(self._messages, None)
            known.at_s = max(known.at_s, moment_s)
            steps += 1
            if steps % LOOK_EVERY == 0 and is_over():
                return False

    def _read(self) -> Iterator[Message]:
        """What has not been taken yet. The same sum decides as while reading on, so no message is taken twice."""
        at_s, start_s = self.known.at_s, self.drive.start_s
        is_begun = self.known.ticks > 0 or self.known.reception.received > 0
        for message in self._recording.messages(max(0.0, at_s - 0.001), self.drive.topics):
            behind_s = message.at_s - start_s
            if behind_s > at_s or (behind_s == at_s and not is_begun):
                yield message

    def _tick_s(self, message_s: float) -> float:
        known = self.known
        tick_s = known.opened_s + known.ticks * TICK_S
        heard_s = known.opened_s if known.last_message_s is None else known.last_message_s
        if tick_s - heard_s > SILENCE_S and min(message_s, self.drive.length_s) - tick_s > 1.0:
            until_s = min(message_s, self.drive.length_s)
            known.ticks = max(known.ticks, math.floor((until_s - known.opened_s) / TICK_S) - 5)
            tick_s = known.opened_s + known.ticks * TICK_S
        return tick_s

    # -- what comes --------------------------------------------------------------------------------------------------

    def _receive(self, message: Message, now_s: float) -> None:
        known = self.known
        sources = self._ways.listeners.get(message.topic)
        self._on_message(now_s)
        if sources is None:
            return
        known.heard.add(message.topic)
        known.last_message_s = now_s
        changed = judging.receive(
            sources,
            message.message,
            now_s,
            None,
            reception=known.reception,
            state=known.state,
            profile=self._ways.tuning.profile,
            tyre_rad_per_unit=self._ways.tuning.limits.steering.tyre_rad_per_unit,
            transport=self.drive.delay,
        )
        if changed:
            self._tell(judging.judge(known.monitor, known.state, now_s, changed))
            known.trends.hear(changed, known.state, now_s)
            self._on_changed(changed, known.state, now_s)
        if "scan" in changed:
            known.scans += 1
            known.kinds_kept = not isinstance(message.message["ranges"], list)

    def _judge(self, now_s: float, changed: tuple[str, ...] | None) -> None:
        known = self.known
        known.state.link(self._link(now_s))
        known.state.slow(known.slowed.facts(now_s, self._ways.tuning.limits.slow_down))
        self._tell(judging.judge(known.monitor, known.state, now_s, changed))

    def _tell(self, transitions: tuple[Transition, ...]) -> None:
        if transitions:
            if not self.drive.told.has_alarms:
                self.known.load.add(transitions)
            self._on_judged(transitions)

    def _hear(self, word: object, now_s: float) -> None:
        known = self.known
        match word:
            case Transition():
                self._restore([word])
                known.load.add([word])
                self._on_told([word])
            case Pause():
                known.paused_s, known.paused_by = (now_s, word.by) if word.is_paused else (None, None)
                known.state.set_paused(word.is_paused, known.paused_s)
            case SlowDownTold():
                known.slowed = known.slowed.after(word, now_s)
            case PhoneWord():
                known.state.hear_phone(word, now_s)
            case NewSettings():
                known.ways += 1
                self._ways = self.drive.ways[known.ways]
                limits = self._ways.tuning.limits
                known.monitor.limits = limits
                known.state.expect(expected_rates(limits))

    def _restore(self, transitions: Sequence[Transition]) -> None:
        self.known.told = restore(self.known.told, transitions)

    def _skip_words(self, from_s: float) -> None:
        """A run that begins in the middle knows what was told before: what stood, who paused, which settings."""
        words, known = self.drive.told.words, self.known
        before: list[Transition] = []
        while known.words < len(words) and words[known.words][0] < from_s:
            at_s, word = words[known.words]
            known.words += 1
            if isinstance(word, Transition):
                before.append(word)
                known.load.add([word])
            elif not isinstance(word, PhoneWord):
                self._hear(word, at_s)
        if before:
            self._restore(before)

    def _link(self, now_s: float) -> LinkFacts:
        """A link that opened with the first message and answers as long as there is something to read."""
        known = self.known
        delay = self.drive.delay.link(now_s) if self.drive.delay is not None else LinkDelay()
        return LinkFacts(
            late_s=delay.late_s,
            throttled=delay.throttled,
            reduced=delay.reduced,
            phase="monitoring",
            since_s=known.opened_s,
            bridge_heard_s=now_s,
            bridge_answers=True,
            topics_subscribed=len(self._ways.published),
            connected_s=known.opened_s,
            last_message_s=known.last_message_s,
            published=self._ways.published,
            wall_zero_s=self.drive.start_s,
        )

    # -- what is shown -----------------------------------------------------------------------------------------------

    def frame(self, *, vehicle: str, name: str, settings_version: int, track_number: int) -> dict[str, Any]:
        """The state of docs/protocol.md at this moment, without `server`, `replay` and `live`. Looking changes nothing
        of what is judged later."""
        known, ways = self.known, self._ways
        now_s = known.at_s
        wall_ms = round((self.drive.start_s + now_s) * 1000)
        facts = Facts(
            vehicle=vehicle,
            server={},
            now_s=now_s,
            wall_ms=wall_ms,
            phase="monitoring",
            address=None,
            ros_version=self.drive.ros_version,
            connected_s=0.0,
            paused_since_s=known.paused_s,
            paused_by=known.paused_by,
            held=None,
            load=known.load.at(now_s),
            log_trouble=None,
            profile=ways.tuning.profile.title,
            settings_version=settings_version,
            since_s=0.0,
            dialled_s=0.0,
            problem=None,
            link=None,
            last_message_s=known.last_message_s,
            ros_answered_s=now_s,
            ros_alive=True,
            behind=None,
            offers_nothing=False,
            bridge_answers=True,
            reception=known.reception,
            sources=ways.sources,
            topics_heard=len(known.heard),
            trends=known.trends.piece(now_s, at_most=TRENDS_A_FRAME),
            track_number=track_number,
        )
        frame = state_frame(facts, known.state.glance(now_s), known.monitor)
        del frame["server"]
        frame["session"]["name"] = name
        # Whatever is not in the file is nobody's silence: the band tells of it, and each value keeps its age.
        frame["link"] |= {"cut": None, "since_ms": None, "problem": None, "topics_subscribed": len(ways.published)}
        frame["decelerate"] = known.slowed.as_json(now_s, self.drive.start_s, ways.tuning.limits.slow_down)
        if self.drive.told.has_alarms:
            frame["alarms"] = [wire.alarm(alarm, now_s, wall_ms) for alarm in self._told_standing()]
        return frame

    def _told_standing(self) -> list[Alarm]:
        """The original alarms, each with the re-evaluated finding of its check."""
        findings = self.known.monitor.findings
        self._teller.alarms = self.known.told
        shown = self._teller.standing()
        return [
            replace(alarm, finding=findings[alarm.id])
            if alarm.active and alarm.id in findings and findings[alarm.id].verdict is Verdict.FAULT
            else alarm
            for alarm in shown
        ]

    def scan_bytes(self) -> bytes | None:
        """The newest scan as the page gets it; None before the first."""
        known = self.known
        snapshot = known.state.glance(known.at_s)
        reading = snapshot.get("scan")
        if reading is None:
            return None
        obstacle = known.monitor.alarms.get("obstacle")
        return wire.scan_frame(
            reading.value,
            number=known.scans,
            age_s=reading.age_s(known.at_s),
            kinds_kept=known.kinds_kept,
            judged=judged(
                reading.value,
                snapshot,
                known.monitor.limits.obstacle,
                was_active=obstacle is not None and obstacle.active,
            ),
        )

"""Judges a recording as live would have judged the drive, in virtual time."""

from __future__ import annotations

import contextlib
import gc
import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from monitor.alarm import Transition
from monitor.quick import maker
from monitor.runner import ASKED_EVERY, Crash, Monitor
from monitor.signal_limits import expected_rates
from monitor.state import LinkFacts, Snapshot, State
from server import judging
from server.bridge.names import BadName, canonical_name
from server.judging import TICK_S
from server.reception import Reception
from server.recording.delay import LinkDelay, RecordedDelay
from server.recording.read import Recording, RecordingUnreadable, Row
from server.rehearsal.episodes import Diary, Episode
from server.rehearsal.faults import Faults, Laid
from server.rehearsal.load import Load, load_of
from server.rehearsal.ribbons import Coverage, Ribbon, Ribbons, Unchecked
from server.rehearsal.thresholds import Wishes, tuning_for
from server.rehearsal.traces import Traces
from server.rehearsal.would_slow import Slowed, WouldSlow
from server.simulator.scenarios import Planned
from server.source import Message
from server.topics import Source, map_signals
from server.tuning import Tuning

SAMPLE_TICKS = ASKED_EVERY  # what every check says is known then, without asking any again
_link_facts = maker(LinkFacts)  # one for each tick
_NO_DELAY = LinkDelay()
SILENCE_S = 600.0  # after so long without a message nothing new can be said: the judge is not stepped through the rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Extract:
    """Which part of a recording is judged, in seconds since its beginning."""

    start_s: float = 0.0
    duration_s: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Rehearsed:
    """All that one run found. Times are seconds since the beginning of the recording."""

    tuning: Tuning
    wishes: Wishes
    from_s: float  # the first message judged
    to_s: float  # the last
    took_s: float  # of our own time
    messages: int
    sources: Mapping[str, Source]  # by signal
    other_topics: Mapping[str, str]  # topic → type, what fills no signal
    reception: Reception
    snapshot: Snapshot  # at the end
    episodes: Sequence[Episode]
    transitions: Sequence[Transition]
    titles: Mapping[str, str]  # of every alarm, by id
    ribbons: Sequence[Ribbon]
    unchecked: Sequence[Unchecked]
    load: Load
    crashes: Sequence[Crash]
    faults: Sequence[Laid]
    traces: Traces | None
    slowed: Sequence[Slowed] = ()  # orders that the rules would have given
    notes: Sequence[str] = field(default_factory=list)
    broke_off: str | None = None  # why the recording could not be read to its end
    damage: Sequence[str] = ()  # what within it could not be read

    @property
    def judged_s(self) -> float:
        return self.to_s - self.from_s


def rehearse(
    recording: Recording,
    *,
    wishes: Wishes | None = None,
    extract: Extract | None = None,
    faults: Sequence[Planned] = (),
    with_traces: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> Rehearsed:
    """Runs the judge over a recording. `on_progress` is told now and then up to which second it has come.

    Raises RecordingUnreadable where not even a first message can be read, CannotInject, and BadSetting where the wishes
    contradict the car's profile.
    """
    with _fewer_collections():
        return _Run(recording, wishes or Wishes(), extract or Extract(), faults, with_traces, on_progress).run()


class _Run:
    def __init__(
        self,
        recording: Recording,
        wishes: Wishes,
        extract: Extract,
        faults: Sequence[Planned],
        with_traces: bool,
        on_progress: Callable[[float], None] | None,
    ) -> None:
        self._began_s = time.perf_counter()
        self._recording = recording
        self._wishes = wishes
        self._extract = extract
        self._faults = Faults(faults)
        self._on_progress = on_progress
        self.notes: list[str] = list(recording.notes)
        self._topics = self._offered()
        self._tuning = tuning_for(wishes, self._topics, recording.ros_version)
        self._sources = map_signals(self._topics, self._tuning.settings.topics)
        for signal, topic in self._tuning.settings.topics.items():
            if topic not in self._topics:
                self.notes.append(f"{topic}, chosen for {signal}, is not in the recording.")
        self._monitor = Monitor(limits=self._tuning.limits)
        self._state = State(expected_rates(self._tuning.limits))
        self._reception = Reception()
        delay = RecordedDelay(recording)
        self._delay = delay if delay.is_known else None
        self._published = judging.published(self._sources.values())
        self._last_message_s: float | None = None
        self._opened_s = 0.0
        self._diary = Diary()
        self._ribbons = Ribbons()
        self._coverage = Coverage()
        self._traces = Traces() if with_traces else None
        self._would_slow = WouldSlow(self._tuning.limits.slow_down)
        self._crashes: dict[str, Crash] = {}
        self._ticks = 0
        self._broke_off: str | None = None

    def run(self) -> Rehearsed:
        messages, from_s, to_s = self._judge_all()
        if messages:
            self._sample(to_s)
        snapshot = self._state.snapshot(to_s)
        self._note_rejected()
        alarms = self._monitor.alarms
        return Rehearsed(
            tuning=self._tuning,
            wishes=self._wishes,
            from_s=from_s,
            to_s=to_s,
            took_s=time.perf_counter() - self._began_s,
            messages=messages,
            sources=self._sources,
            other_topics=self._others(),
            reception=self._reception,
            snapshot=snapshot,
            episodes=self._diary.episodes(alarms, to_s),
            transitions=self._diary.transitions,
            titles={alarm_id: alarm.spec.title for alarm_id, alarm in alarms.items()},
            ribbons=self._ribbons.finish(to_s) if messages else (),
            unchecked=self._coverage.unchecked(self._monitor),
            load=load_of(self._diary.transitions, to_s - from_s, sum(alarm.active for alarm in alarms.values())),
            crashes=tuple(self._crashes.values()),
            faults=self._faults.laid,
            traces=self._traces,
            slowed=self._would_slow.slowed,
            notes=self.notes,
            broke_off=self._broke_off,
            damage=self._recording.damage,
        )

    def _judge_all(self) -> tuple[int, float, float]:
        """How many messages there were, and when the first and the last came."""
        origin_s, until_s = self._recording.start_s, self._extract.start_s + self._extract.duration_s
        state, reception, monitor = self._state, self._reception, self._monitor
        profile, traces = self._tuning.profile, self._traces
        listeners = self._listeners()
        count = 0
        from_s = at_s = self._extract.start_s
        tick_s = math.inf
        try:
            for message_s, topic, _, message in self._rows(listeners):
                now_s = message_s - origin_s
                if count == 0:
                    from_s = self._opened_s = now_s
                    self._judge(now_s, None)
                    tick_s = from_s + TICK_S
                elif now_s > until_s:
                    break
                if now_s >= tick_s:
                    tick_s = self._tick_until(now_s, at_s)
                if now_s > at_s:
                    at_s = now_s
                count += 1
                sources = listeners.get(topic)
                if sources is None:
                    continue
                self._last_message_s = now_s
                changed = judging.receive(
                    sources,
                    message,
                    now_s,
                    None,
                    reception=reception,
                    state=state,
                    profile=profile,
                    tyre_rad_per_unit=monitor.limits.steering.tyre_rad_per_unit,
                    transport=self._delay,
                )
                if changed:
                    transitions = judging.judge(monitor, state, now_s, changed)
                    if transitions:
                        self._diary.note(transitions, monitor.alarms)
                    if traces is not None:
                        traces.take(changed, state.get, now_s)
        except RecordingUnreadable as error:
            if count == 0:
                raise
            self._broke_off = str(error)  # it is judged up to there
        return count, from_s, at_s

    def _rows(self, listeners: Collection[str]) -> Iterator[Row]:
        """The messages, with the faults laid over."""
        start_s = self._extract.start_s
        if not self._faults.laid:
            return self._recording.rows(start_s, listeners)
        messages = self._recording.messages(start_s, listeners)
        laid = self._faults.over(messages, self._recording.start_s, self._signal_of())
        return ((message.at_s, message.topic, message.type, message.message) for message in laid)

    def _tick_until(self, now_s: float, heard_s: float) -> float:
        """All ticks up to a moment; answers when the next one is due. `heard_s`: when the last message came."""
        first_s = self._opened_s
        tick_s = first_s + (self._ticks + 1) * TICK_S
        while tick_s <= now_s:
            self._ticks += 1
            self._judge(tick_s, None)
            if (self._ticks + 1) % SAMPLE_TICKS == 0:  # the first judgement came with the first message
                self._sample(tick_s)
                if self._on_progress is not None:
                    self._on_progress(tick_s)
            if tick_s - heard_s > SILENCE_S and now_s - tick_s > 1.0:
                self.notes.append(f"Nothing was recorded for {now_s - heard_s:.0f} s from {heard_s:.1f} s on.")
                self._ticks = max(self._ticks, math.floor((now_s - first_s) / TICK_S) - 5)
                heard_s = now_s
            tick_s = first_s + (self._ticks + 1) * TICK_S
        return tick_s

    def _judge(self, now_s: float, changed: tuple[str, ...] | None) -> None:
        monitor, state = self._monitor, self._state
        state.link(self._faults.link(self._link(now_s), now_s))
        transitions = judging.judge(monitor, state, now_s, changed)
        if transitions:
            self._diary.note(transitions, monitor.alarms)
        self._would_slow.look(monitor.alarms, now_s)
        if monitor.crashes:
            self._crashes |= {name: crash for name, crash in monitor.crashes.items() if name not in self._crashes}
        if self._traces is not None:
            self._traces.judged(monitor, now_s)

    def _link(self, now_s: float) -> LinkFacts:
        """A link that opened with the first message and answers as long as there is something to read."""
        delay = self._delay.link(now_s) if self._delay is not None else _NO_DELAY
        return _link_facts(
            late_s=delay.late_s,
            throttled=delay.throttled,
            reduced=delay.reduced,
            phase="monitoring",
            since_s=self._opened_s,
            bridge_heard_s=now_s,
            bridge_answers=True,
            topics_subscribed=len(self._published),
            connected_s=self._opened_s,
            last_message_s=self._last_message_s,
            published=self._published,
            wall_zero_s=self._recording.start_s,
        )

    def _sample(self, now_s: float) -> None:
        self._ribbons.sample(self._monitor, now_s)
        self._coverage.sample(self._monitor)

    def _offered(self) -> dict[str, str]:
        """Topic → type as a bridge that plays the recording offers them."""
        offered: dict[str, str] = {}
        for topic, info in self._recording.topics.items():
            try:
                offered[canonical_name(topic)] = info.type
            except BadName:
                self.notes.append(f"{topic[:60]!r} is no name that a topic can have: it is left out.")
        return offered

    def _listeners(self) -> dict[str, tuple[Source, ...]]:
        """Topic as the recording spells it → the signals it fills; only topics that live would subscribe to."""
        by_topic = judging.by_topic(self._sources.values())
        found: dict[str, tuple[Source, ...]] = {}
        for topic in self._recording.topics:
            with contextlib.suppress(BadName):
                sources = by_topic.get(canonical_name(topic), ())
                if any(source.decode is not None for source in sources):
                    found[topic] = sources
        return found

    def _signal_of(self) -> Callable[[Message], str | None]:
        signals = {topic: sources[0].signal for topic, sources in self._listeners().items()}
        return lambda message: signals.get(message.topic)

    def _others(self) -> dict[str, str]:
        mapped = {source.topic for source in self._sources.values()}
        return {topic: kind for topic, kind in sorted(self._topics.items()) if topic not in mapped}

    def _note_rejected(self) -> None:
        for topic, count in sorted(self._recording.rejected.items()):
            self.notes.append(f"{count} messages on {topic} left out: {self._recording.why_rejected[topic]}.")
        self.notes += [f"{sentence}." for sentence in self._recording.damage]
        for crash in self._crashes.values():
            self.notes.append(f"The check {crash.check_id} fails: {crash.error}.")
        for laid in self._faults.laid:
            if not laid.touched:
                self.notes.append(
                    f"{laid.name}, injected at {laid.from_s:g} s, changed nothing: the recording has no message for it."
                )


@contextlib.contextmanager
def _fewer_collections() -> Iterator[None]:
    """The judge makes many short-lived values and hardly a circle: looking for circles 20 times a second is in vain."""
    before = gc.get_threshold()
    gc.set_threshold(100_000, 50, 100)
    try:
        yield
    finally:
        gc.set_threshold(*before)

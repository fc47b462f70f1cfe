"""Judges a recording as a live session would have judged the drive, in virtual time."""

from __future__ import annotations

import contextlib
import gc
import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from monitor.alarm import Alarm, Transition
from monitor.checks.slow_down import SlowDownLimits
from monitor.runner import Crash, Monitor
from monitor.state import LinkFacts, Snapshot, State
from monitor.triggers import COUNTDOWN_S, Due, Triggers, is_any_on
from server.analysis.episodes import Diary, Episode, Load, load_of
from server.analysis.faults import Faults, Laid
from server.analysis.traces import CheckTimeline, CheckTimelines, Coverage, Traces, Unchecked
from server.judge.active_settings import ActiveSettings, SettingsOverride
from server.judge.drive import Drive, MessageSource, Row, SettingsEpoch
from server.judge.offline import Observer, OfflineRun
from server.judge.pipeline import TICK_S
from server.judge.reception_stats import Reception
from server.judge.topics import Source
from server.judge.unit_watch import unit_sentences
from server.protocol.questions import Question
from server.recording.delay import recorded_delay
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import Recording, RecordingUnreadable
from server.simulator.scenarios import Planned

SAMPLE_TICKS = round(1.0 / TICK_S)  # between two samples of what every check finds
AS_RECORDED = "as recorded"


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedOrder:
    """One order that would have been given. Times are seconds since the beginning of the recording."""

    trigger: str
    title: str
    text: str  # text of the check when the count-down began
    countdown_s: float
    at_s: float


class SimulatedSlowDown:
    """Follows the rules over one drive. A recorded car drives on as it did, so a rule whose order was given once is not
    due again until its fault has gone."""

    def __init__(self, limits: SlowDownLimits) -> None:
        self._limits = limits
        self._is_on = is_any_on(limits)
        self._triggers = Triggers()
        self._counting: tuple[Due, float] | None = None
        self.orders: list[SimulatedOrder] = []

    def judged(self, alarms: Mapping[str, Alarm], now_s: float) -> None:
        """Call with each tick, after the alarms were judged."""
        if not self._is_on:
            return
        counts = None if self._counting is None else self._counting[0].trigger.id
        due = self._triggers.look(alarms, self._limits, now_s, counting=counts)
        if self._counting is None:
            self._counting = (due, now_s) if due is not None else None
            return
        counting, began_s = self._counting
        if due is None or due.trigger.id != counting.trigger.id:
            self._counting = None
        elif now_s - began_s >= COUNTDOWN_S:
            self._counting = None
            self._triggers.veto(counting.trigger.id)
            self.orders.append(
                SimulatedOrder(
                    trigger=counting.trigger.id,
                    title=counting.trigger.title,
                    text=counting.text,
                    countdown_s=began_s,
                    at_s=began_s + COUNTDOWN_S,
                )
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Extract:
    """Which part of a recording is judged, in seconds since its beginning."""

    start_s: float = 0.0
    duration_s: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Rehearsed:
    """All results of one run. Times are seconds since the beginning of the recording."""

    tuning: ActiveSettings  # at the end
    override: SettingsOverride
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
    timelines: Sequence[CheckTimeline]
    unchecked: Sequence[Unchecked]
    load: Load
    crashes: Sequence[Crash]
    faults: Sequence[Laid]
    traces: Traces | None
    simulated_orders: Sequence[SimulatedOrder] = ()  # orders that the rules would have given
    notes: Sequence[str] = field(default_factory=list)
    broke_off: str | None = None  # why the recording could not be read to its end
    damage: Sequence[str] = ()  # what within it could not be read
    undecided: Mapping[str, str] = field(default_factory=dict)  # signal → why none of its topics is taken
    refused: frozenset[str] = frozenset()  # those of them where there is nothing to choose from
    questions: Sequence[Question] = ()  # which topics to choose from

    @property
    def judged_s(self) -> float:
        return self.to_s - self.from_s


def rehearse(
    recording: Recording,
    *,
    override: SettingsOverride | None = None,
    extract: Extract | None = None,
    faults: Sequence[Planned] = (),
    with_traces: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> Rehearsed:
    """Judge a recording as the session judged it: with the recorded phones, pauses, orders, topic choices and settings.

    `override` replaces the recorded settings. `on_progress` receives the second that has been reached, once a second.
    Raises RecordingUnreadable where not even a first message can be read, CannotInject, and BadSetting where
    `override` contradicts the car's profile.
    """
    with _fewer_collections():
        return _Rehearsal(recording, override, extract or Extract(), faults, with_traces, on_progress).run()


class _Injected:
    """A recording with faults laid over its messages."""

    def __init__(self, recording: Recording, faults: Faults, drive: Drive) -> None:
        self.start_s, self.duration_s = recording.start_s, recording.duration_s
        self.ros_version, self.notes, self.topics = recording.ros_version, recording.notes, recording.topics
        self.rejected = recording.rejected
        self._recording = recording
        self._faults = faults
        self._signals = {
            topic: sources[0].signal
            for topic, sources in drive.epochs[0].listeners.items()
            if sources[0].carries  # what carries a signal comes first
        }

    def rows(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Row]:
        """As those of the recording."""
        messages = self._recording.messages(start_s, topics)
        found = self._faults.over(messages, self.start_s, lambda message: self._signals.get(message.topic))
        return ((message.at_s, message.topic, message.type, message.message) for message in found)

    def only(self, topics: Collection[str]) -> Iterator[Row]:
        """As those of the recording."""
        return self._recording.only(topics)


class _Rehearsal(Observer):
    """Collects the results of a run through a recording."""

    def __init__(
        self,
        recording: Recording,
        override: SettingsOverride | None,
        extract: Extract,
        faults: Sequence[Planned],
        with_traces: bool,
        on_progress: Callable[[float], None] | None,
    ) -> None:
        self._began_s = time.perf_counter()
        self._recording = recording
        self._extract = extract
        self._faults = Faults(faults)
        self._on_progress = on_progress
        self._drive = Drive(
            recording, read_recorded_events(recording), delay=recorded_delay(recording), override=override
        )
        is_recorded = self._drive.settings_from_recording
        self._override = override or SettingsOverride(name=AS_RECORDED if is_recorded else "")
        self._messages = 0
        self._last_s = extract.start_s
        self._diary = Diary()
        self._timelines = CheckTimelines()
        self._coverage = Coverage()
        self._traces = Traces() if with_traces else None
        self._simulated = SimulatedSlowDown(self._drive.epochs[0].tuning.limits.slow_down)
        self._crashes: dict[str, Crash] = {}
        self._ticks = 0
        self._broke_off: str | None = None
        self._alarms: dict[str, Alarm] = {}
        self.notes: list[str] = self._drive.notes
        for signal, topic in self._drive.epochs[0].tuning.settings.topics.items():
            if topic not in self._drive.offered:
                self.notes.append(f"{topic}, chosen for {signal}, is not in the recording.")

    def run(self) -> Rehearsed:
        """Judge all of it."""
        source: MessageSource = self._recording
        if self._faults.laid:
            source = _Injected(self._recording, self._faults, self._drive)
        run = OfflineRun(source, self._drive, from_s=self._extract.start_s, opens_with_message=True, observer=self)
        self._alarms = run.run_state.monitor.alarms
        try:
            run.advance(self._extract.start_s + self._extract.duration_s, to_last_message=True)
        except RecordingUnreadable as error:
            if not self._messages:
                raise
            self._broke_off = str(error)  # it is judged up to there
        if self._messages:
            self._sample(run.run_state.monitor, self._last_s)
        frames = run.run_state.frames or self._drive.frames
        self.notes += [note for note in frames.notes if note not in self.notes]
        self.notes += unit_sentences(run.run_state.reception.units, run.epoch.sources)
        self._note_rejected()
        return self._found(run)

    def _found(self, run: OfflineRun) -> Rehearsed:
        state, to_s = run.run_state, self._last_s
        from_s = state.opened_s
        alarms = state.monitor.alarms
        return Rehearsed(
            tuning=run.epoch.tuning,
            override=self._override,
            from_s=from_s,
            to_s=to_s,
            took_s=time.perf_counter() - self._began_s,
            messages=self._messages,
            sources=run.epoch.sources,
            other_topics=self._others(run.epoch),
            reception=state.reception,
            snapshot=state.state.snapshot(to_s),
            episodes=self._diary.episodes(alarms, to_s),
            transitions=self._diary.transitions,
            titles={alarm_id: alarm.spec.title for alarm_id, alarm in alarms.items()},
            timelines=self._timelines.finish(to_s) if self._messages else (),
            unchecked=self._coverage.unchecked(state.monitor),
            load=load_of(self._diary.transitions, to_s - from_s, sum(alarm.active for alarm in alarms.values())),
            crashes=tuple(self._crashes.values()),
            faults=self._faults.laid,
            traces=self._traces,
            simulated_orders=self._simulated.orders,
            notes=self.notes,
            broke_off=self._broke_off,
            damage=self._recording.damage,
            undecided=run.epoch.choice.undecided,
            refused=run.epoch.choice.refused,
            questions=run.epoch.choice.questions,
        )

    # -- the observer of the run -------------------------------------------------------------------------------------

    def message_received(self, topic: str, now_s: float) -> None:
        """Counts it."""
        self._messages += 1
        self._last_s = max(self._last_s, now_s)

    def signals_changed(self, changed: tuple[str, ...], state: State, now_s: float) -> None:
        """Draws the curves of the signals."""
        if self._traces is not None:
            self._traces.take(changed, state.get, now_s)

    def judged(self, transitions: Sequence[Transition], now_s: float) -> None:
        """Record the transitions of alarms."""
        self._diary.note(transitions, self._alarms)

    def ticked(self, run: OfflineRun, now_s: float) -> None:
        """Draws the curves of the checks, and once a second takes a sample of what each of them finds."""
        monitor = run.run_state.monitor
        self._simulated.judged(monitor.alarms, now_s)
        if monitor.crashes:
            self._crashes |= {name: crash for name, crash in monitor.crashes.items() if name not in self._crashes}
        if self._traces is not None:
            self._traces.judged(monitor, now_s)
        self._ticks += 1
        if self._ticks % SAMPLE_TICKS == 0:
            self._sample(monitor, now_s)
            if self._on_progress is not None:
                self._on_progress(now_s)

    def skipped(self, from_s: float, to_s: float) -> None:
        """Notes the gap."""
        self.notes.append(f"Nothing was recorded for {to_s - from_s:.0f} s from {from_s:.1f} s on.")

    def link(self, facts: LinkFacts, now_s: float) -> LinkFacts:
        """The link with the faults laid over it."""
        return self._faults.link(facts, now_s)

    def _sample(self, monitor: Monitor, now_s: float) -> None:
        self._timelines.sample(monitor, now_s)
        self._coverage.sample(monitor)

    def _others(self, epoch: SettingsEpoch) -> dict[str, str]:
        mapped = {source.topic for source in epoch.sources.values()}
        return {topic: kind for topic, kind in sorted(self._drive.offered.items()) if topic not in mapped}

    def _note_rejected(self) -> None:
        for topic, count in sorted(self._recording.rejected.items()):
            self.notes.append(
                f"{count} messages on {topic} left out: {self._recording.why_rejected.get(topic, 'not JSON')}."
            )
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
    """Collect garbage less often: the judge makes many short-lived values and hardly any reference cycles."""
    before = gc.get_threshold()
    gc.set_threshold(100_000, 50, 100)
    try:
        yield
    finally:
        gc.set_threshold(*before)

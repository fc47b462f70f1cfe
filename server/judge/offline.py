"""The one loop over a recording: messages, ticks and the recording's own events in order, judged as a session does."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from copy import deepcopy
from typing import Any

from monitor.alarm import Transition
from monitor.checks.signal_slow import expected_rates
from monitor.phones import PhoneReport
from monitor.restoring import restore
from monitor.runner import Monitor, Refused
from monitor.state import LinkFacts, State
from monitor.trends import Trends
from server.judge import pipeline
from server.judge.drive import Drive, MessageSource, Row, SettingsEpoch
from server.judge.pipeline import TICK_S
from server.judge.reception_stats import Reception
from server.judge.recorded_events import (
    ChosenPhone,
    NewSettings,
    OwnerChange,
    Pause,
    SlowDownEvent,
    StopChange,
    answered,
)
from server.judge.run_state import RunState
from server.judge.unit_watch import UnitWatch
from server.judge.units import Unit

SILENCE_S = 600.0  # after so long without a message no result can change: the judge skips the rest
QUIET_S, QUIET_TICKS = 60.0, 20  # after so long without a message, every check is judged at one tick in so many
STEPS_PER_CLOCK_READ = 24  # some 2 ms


class Observer:
    """Receives what happens in a run. Times are seconds since the beginning of the recording."""

    def message_received(self, topic: str, now_s: float) -> None:
        """A message of any topic came."""

    def value_decoded(self, signal: str, value: Any, now_s: float, stamp_s: float | None) -> None:
        """A message holds this value; `stamp_s`: by its header, on the car's clock."""

    def number_decoded(
        self, signal: str, number: float, unit: Unit | None, now_s: float, stamp_s: float | None
    ) -> None:
        """A message holds a number whose unit is not known (None), or cannot be converted."""

    def signals_changed(self, changed: tuple[str, ...], state: State, now_s: float) -> None:
        """A message changed these signals; what comes of it was judged."""

    def judged(self, transitions: Sequence[Transition], now_s: float) -> None:
        """Alarms changed."""

    def ticked(self, run: OfflineRun, now_s: float) -> None:
        """Every check was judged."""

    def alarms_recorded(self, transitions: Sequence[Transition]) -> None:
        """The recording holds these transitions at this moment."""

    def skipped(self, from_s: float, to_s: float) -> None:
        """Nothing was recorded for so long that it was not stepped through."""

    def link(self, facts: LinkFacts, now_s: float) -> LinkFacts:
        """The link to judge by in place of `facts`."""
        return facts


class OfflineRun:
    """One run through a recording, forward only; to seek, start another run or continue from a RunState.

    Times are seconds since the beginning of the recording.
    """

    def __init__(
        self,
        source: MessageSource,
        drive: Drive,
        *,
        from_s: float = 0.0,
        opens_with_message: bool = False,
        run_state: RunState | None = None,
        observer: Observer | None = None,
        with_checks: bool = True,
    ) -> None:
        """Start at `from_s` with an empty state, or continue from `run_state`.

        `opens_with_message`: the link opens with the first message from `from_s` on, and not at `from_s`.
        `with_checks` False: messages are decoded and change the state, but there are no ticks and nothing is judged.
        Raises RecordingUnreadable.
        """
        self.drive = drive
        self._source = source
        self._with_checks = with_checks
        self._observer = Observer() if observer is None else observer
        is_new = run_state is None
        self.run_state = self._begin(from_s) if run_state is None else run_state
        self._epoch = drive.epochs[self.run_state.epoch]
        self._frames = drive.frames if self.run_state.frames is None else self.run_state.frames
        self._names: set[bytes] = set()  # of frames whose transforms count
        self._frames.note_needed(self._names)
        self._rows = self._read()
        self._next: Row | None = next(self._rows, None)
        if is_new:
            if opens_with_message and self._next is not None:
                from_s = self.run_state.opened_s = self._next[0] - drive.start_s
            self._skip_events(from_s)

    def _begin(self, from_s: float) -> RunState:
        epoch = self.drive.epochs[0]
        limits = epoch.tuning.limits
        return RunState(
            state=State(expected_rates(limits)),
            monitor=Monitor(limits=limits),
            trends=Trends(from_s),
            opened_s=from_s,
            at_s=from_s,
            recorded_alarms={},
            reception=Reception(units=UnitWatch(deepcopy(self.drive.unit_evidence))),
            frames=deepcopy(self.drive.frames) if self.drive.moving_transforms else None,
        )

    @property
    def epoch(self) -> SettingsEpoch:
        """The settings in force now, and the topics that they choose."""
        return self._epoch

    @property
    def at_s(self) -> float:
        """Everything up to here was judged."""
        return self.run_state.at_s

    @property
    def next_s(self) -> float:
        """When the next message comes; infinite where there is none."""
        return math.inf if self._next is None else self._next[0] - self.drive.start_s

    @property
    def is_at_end(self) -> bool:
        """Whether nothing is left."""
        return self._next is None and self.run_state.at_s >= self.drive.length_s

    def advance(
        self, until_s: float, is_over: Callable[[], bool] = lambda: False, *, to_last_message: bool = False
    ) -> bool:
        """Judge all there is up to a moment, that moment included. False: `is_over` ended it before.

        `to_last_message`: not beyond the last message that is not after `until_s`. Raises RecordingUnreadable.
        """
        run_state, events = self.run_state, self.drive.recorded.events
        steps = 0
        while True:
            message_s = self.next_s
            if to_last_message and (self._next is None or message_s > until_s):
                return True
            tick_s = self._tick_s(message_s)
            event_s = events[run_state.events_taken][0] if run_state.events_taken < len(events) else math.inf
            moment_s = min(message_s, tick_s, event_s)
            if moment_s > until_s:
                run_state.at_s = max(run_state.at_s, until_s)
                return True
            if event_s <= moment_s:
                run_state.events_taken += 1
                self._apply(events[run_state.events_taken - 1][1], event_s)
            elif tick_s <= moment_s:
                run_state.ticks += 1
                self._tick(tick_s)
            elif self._next is not None:
                self._receive(self._next, message_s)
                self._next = next(self._rows, None)
            run_state.at_s = max(run_state.at_s, moment_s)
            steps += 1
            if steps % STEPS_PER_CLOCK_READ == 0 and is_over():
                return False

    def _read(self) -> Iterator[Row]:
        """What has not been taken yet. The same sum decides as while reading on, so no message is taken twice."""
        at_s, start_s = self.run_state.at_s, self.drive.start_s
        is_begun = self.run_state.ticks > 0 or self.run_state.reception.received > 0
        topics = dict.fromkeys(self.drive.topics) | dict.fromkeys(self.drive.moving_transforms, self._names)
        for row in self._source.rows(max(0.0, at_s - 0.001), topics):
            behind_s = row[0] - start_s
            if behind_s > at_s or (behind_s == at_s and not is_begun):
                yield row

    def _tick_s(self, message_s: float) -> float:
        run_state = self.run_state
        if not self._with_checks:
            return math.inf
        tick_s = run_state.opened_s + run_state.ticks * TICK_S
        received_s = run_state.opened_s if run_state.last_message_s is None else run_state.last_message_s
        until_s = min(message_s, self.drive.length_s)
        if tick_s - received_s <= QUIET_S or until_s - tick_s <= 1.0:
            return tick_s
        if tick_s - received_s > SILENCE_S:
            run_state.ticks = max(run_state.ticks, math.floor((until_s - run_state.opened_s) / TICK_S) - 5)
            tick_s = run_state.opened_s + run_state.ticks * TICK_S
            self._observer.skipped(received_s, until_s)
        else:
            run_state.ticks = -(-run_state.ticks // QUIET_TICKS) * QUIET_TICKS
            tick_s = run_state.opened_s + run_state.ticks * TICK_S
        return tick_s

    # -- what comes --------------------------------------------------------------------------------------------------

    def _receive(self, row: Row, now_s: float) -> None:
        run_state = self.run_state
        _, topic, _, message = row
        self._observer.message_received(topic, now_s)
        if topic in self.drive.moving_transforms:
            if message:
                self._frames.receive(topic, message)
            self._frames.note_needed(self._names)
            return
        sources = self._epoch.listeners.get(topic)
        if sources is None:
            if topic in self._epoch.competing:
                run_state.last_message_s = now_s  # the car sends, though nothing of it can be judged
            return
        if sources[0].carries:  # what carries a signal comes first
            run_state.topics_received.add(topic)
        run_state.last_message_s = now_s
        changed = pipeline.receive(
            sources,
            message,
            now_s,
            None,
            reception=run_state.reception,
            state=run_state.state,
            profile=self._epoch.tuning.profile,
            tyre_rad_per_unit=run_state.monitor.limits.steering.tyre_rad_per_unit,
            units=self._epoch.tuning.settings.units,
            transport=self.drive.delay,
            frames=self._frames,
            limits=run_state.monitor.limits,
            on_value=self._observer.value_decoded,
            on_number=self._observer.number_decoded,
            steady_stamp=self._steady_stamp(topic, now_s) if self.drive.clock_steps else None,
        )
        if changed:
            if self._with_checks:
                self._report(pipeline.judge(run_state.monitor, run_state.state, now_s, changed), now_s)
            run_state.trends.receive(changed, run_state.state, now_s)
            self._observer.signals_changed(changed, run_state.state, now_s)
            if "scan" in changed:
                run_state.scans += 1
                run_state.kinds_kept = not isinstance(message["ranges"], list)

    def _steady_stamp(self, topic: str, now_s: float) -> Callable[[float], float]:
        steps = self.drive.clock_steps
        return lambda stamp_s: self.run_state.stamps.corrected(topic, stamp_s, now_s, steps)

    def _tick(self, now_s: float) -> None:
        run_state = self.run_state
        facts = _link(self.drive, self._epoch, run_state, now_s)
        run_state.state.link(self._observer.link(facts, now_s))
        run_state.state.slow(run_state.slow_down.facts(now_s, self._epoch.tuning.limits.slow_down))
        self._report(pipeline.judge(run_state.monitor, run_state.state, now_s, None), now_s)
        run_state.minute.note(run_state.monitor.findings, now_s)
        self._observer.ticked(self, now_s)

    def _report(self, transitions: tuple[Transition, ...], now_s: float) -> None:
        if transitions:
            if not self.drive.recorded.has_alarms:
                self.run_state.load.add(transitions)
            self._observer.judged(transitions, now_s)

    def _apply(self, event: object, now_s: float) -> None:
        run_state = self.run_state
        match event:
            case Transition():
                self._restore([event])
                run_state.load.add([event])
                self._observer.alarms_recorded([event])
                if self._with_checks and event.by is not None:
                    self._respond(event, now_s)
            case Pause():
                run_state.pause(event, now_s)
            case StopChange():
                run_state.planned_stop = event.stop
            case OwnerChange():
                run_state.note_owner(event)
            case SlowDownEvent():
                run_state.slow_down = run_state.slow_down.after(event, now_s)
            case PhoneReport():
                run_state.state.receive_phone(event, now_s)
            case ChosenPhone():
                run_state.state.ride(event.phone, now_s)
            case NewSettings():
                run_state.epoch += 1
                self._epoch = self.drive.epochs[run_state.epoch]
                run_state.monitor.limits = self._epoch.tuning.limits
                run_state.state.expect(expected_rates(run_state.monitor.limits))

    def _respond(self, event: Transition, now_s: float) -> None:
        """What an operator did about an alarm counts where the alarm is raised now as it was then."""
        with suppress(Refused):
            self._report(answered(self.run_state.monitor, event, now_s), now_s)

    def _restore(self, transitions: Sequence[Transition]) -> None:
        self.run_state.recorded_alarms = restore(self.run_state.recorded_alarms, transitions)

    def _skip_events(self, from_s: float) -> None:
        """Restore what was recorded before a run that begins in the middle: alarms, pauses, settings."""
        events, run_state = self.drive.recorded.events, self.run_state
        before: list[Transition] = []
        while run_state.events_taken < len(events) and events[run_state.events_taken][0] < from_s:
            at_s, event = events[run_state.events_taken]
            run_state.events_taken += 1
            if isinstance(event, Transition):
                before.append(event)
                run_state.load.add([event])
            elif not isinstance(event, PhoneReport):
                self._apply(event, at_s)
        self._restore(before)


def _link(drive: Drive, epoch: SettingsEpoch, run_state: RunState, now_s: float) -> LinkFacts:
    """A link that opened with the first message and answers as long as there is something to read."""
    found = drive.delay.link(now_s) if drive.delay is not None else None
    return LinkFacts(
        late_s=found.late_s if found is not None else None,
        throttled=found.throttled if found is not None else frozenset(),
        reduced=found.reduced if found is not None else None,
        phase="monitoring",
        since_s=run_state.opened_s,
        bridge_heard_s=now_s,
        bridge_answers=True,
        topics_subscribed=len(epoch.published),
        connected_s=run_state.opened_s,
        last_message_s=run_state.last_message_s,
        published=epoch.published,
        carriers=epoch.carriers,
        compared=epoch.compared,
        undecided=epoch.undecided,
        wall_zero_s=drive.wall_zero_s,
    )

"""The one loop over a recording: messages, ticks and the recording's own events in order, judged as a session does."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from monitor.alarm import Transition
from monitor.phones import PhoneWord
from monitor.restoring import restore
from monitor.runner import Monitor
from monitor.signal_limits import expected_rates
from monitor.state import LinkFacts, State
from monitor.trends import Trends
from server.judge import pipeline
from server.judge.drive import Drive, MessageSource, Row, SettingsEpoch
from server.judge.pipeline import TICK_S
from server.judge.recorded_events import NewSettings, Pause
from server.judge.recorded_slowdown import SlowDownTold
from server.judge.run_state import RunState

SILENCE_S = 600.0  # after so long without a message nothing new can be said: the judge is not stepped through the rest
LOOK_EVERY = 24  # steps between two looks at the clock: some 2 ms


class Observer:
    """Receives what happens in a run. Times are seconds since the beginning of the recording."""

    def message_received(self, topic: str, now_s: float) -> None:
        """A message of any topic came."""

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
    """One run through a recording. It goes forward only; for another moment begin another, or go on from a RunState.

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
    ) -> None:
        """Begins at `from_s` without any knowledge, or goes on from `run_state`.

        `opens_with_message`: the link opens with the first message from `from_s` on, and not at `from_s`. Raises
        RecordingUnreadable.
        """
        self.drive = drive
        self._source = source
        self._observer = Observer() if observer is None else observer
        is_new = run_state is None
        self.run_state = self._begin(from_s) if run_state is None else run_state
        self._epoch = drive.epochs[self.run_state.epoch]
        self._rows = self._read()
        self._next: Row | None = next(self._rows, None)
        if is_new:
            if opens_with_message and self._next is not None:
                from_s = self.run_state.opened_s = self._next[0] - drive.start_s
            self._skip_words(from_s)

    def _begin(self, from_s: float) -> RunState:
        epoch = self.drive.epochs[0]
        limits = epoch.tuning.limits
        monitor = Monitor(limits=limits)
        return RunState(
            state=State(expected_rates(limits)),
            monitor=monitor,
            trends=Trends(from_s),
            opened_s=from_s,
            at_s=from_s,
            recorded_alarms=Monitor(limits=limits).alarms,
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
        run_state, words = self.run_state, self.drive.recorded.words
        steps = 0
        while True:
            message_s = self.next_s
            if to_last_message and (self._next is None or message_s > until_s):
                return True
            tick_s = self._tick_s(message_s)
            word_s = words[run_state.words][0] if run_state.words < len(words) else math.inf
            moment_s = min(message_s, tick_s, word_s)
            if moment_s > until_s:
                run_state.at_s = max(run_state.at_s, until_s)
                return True
            if word_s <= moment_s:
                run_state.words += 1
                self._apply(words[run_state.words - 1][1], word_s)
            elif tick_s <= moment_s:
                run_state.ticks += 1
                self._tick(tick_s)
            elif self._next is not None:
                self._receive(self._next, message_s)
                self._next = next(self._rows, None)
            run_state.at_s = max(run_state.at_s, moment_s)
            steps += 1
            if steps % LOOK_EVERY == 0 and is_over():
                return False

    def _read(self) -> Iterator[Row]:
        """What has not been taken yet. The same sum decides as while reading on, so no message is taken twice."""
        at_s, start_s = self.run_state.at_s, self.drive.start_s
        is_begun = self.run_state.ticks > 0 or self.run_state.reception.received > 0
        for row in self._source.rows(max(0.0, at_s - 0.001), self.drive.topics):
            behind_s = row[0] - start_s
            if behind_s > at_s or (behind_s == at_s and not is_begun):
                yield row

    def _tick_s(self, message_s: float) -> float:
        run_state = self.run_state
        tick_s = run_state.opened_s + run_state.ticks * TICK_S
        heard_s = run_state.opened_s if run_state.last_message_s is None else run_state.last_message_s
        if tick_s - heard_s > SILENCE_S and min(message_s, self.drive.length_s) - tick_s > 1.0:
            until_s = min(message_s, self.drive.length_s)
            run_state.ticks = max(run_state.ticks, math.floor((until_s - run_state.opened_s) / TICK_S) - 5)
            tick_s = run_state.opened_s + run_state.ticks * TICK_S
            self._observer.skipped(heard_s, until_s)
        return tick_s

    # -- what comes --------------------------------------------------------------------------------------------------

    def _receive(self, row: Row, now_s: float) -> None:
        run_state = self.run_state
        _, topic, _, message = row
        self._observer.message_received(topic, now_s)
        sources = self._epoch.listeners.get(topic)
        if sources is None:
            return
        run_state.heard.add(topic)
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
            transport=self.drive.delay,
        )
        if changed:
            self._report(pipeline.judge(run_state.monitor, run_state.state, now_s, changed), now_s)
            run_state.trends.hear(changed, run_state.state, now_s)
            self._observer.signals_changed(changed, run_state.state, now_s)
            if "scan" in changed:
                run_state.scans += 1
                run_state.kinds_kept = not isinstance(message["ranges"], list)

    def _tick(self, now_s: float) -> None:
        run_state = self.run_state
        run_state.state.link(self._observer.link(self._link(now_s), now_s))
        run_state.state.slow(run_state.slowed.facts(now_s, self._epoch.tuning.limits.slow_down))
        self._report(pipeline.judge(run_state.monitor, run_state.state, now_s, None), now_s)
        self._observer.ticked(self, now_s)

    def _report(self, transitions: tuple[Transition, ...], now_s: float) -> None:
        if transitions:
            if not self.drive.recorded.has_alarms:
                self.run_state.load.add(transitions)
            self._observer.judged(transitions, now_s)

    def _apply(self, word: object, now_s: float) -> None:
        run_state = self.run_state
        match word:
            case Transition():
                self._restore([word])
                run_state.load.add([word])
                self._observer.alarms_recorded([word])
            case Pause():
                run_state.paused_s, run_state.paused_by = (now_s, word.by) if word.is_paused else (None, None)
                run_state.state.set_paused(word.is_paused, run_state.paused_s)
            case SlowDownTold():
                run_state.slowed = run_state.slowed.after(word, now_s)
            case PhoneWord():
                run_state.state.hear_phone(word, now_s)
            case NewSettings():
                run_state.epoch += 1
                self._epoch = self.drive.epochs[run_state.epoch]
                limits = self._epoch.tuning.limits
                run_state.monitor.limits = limits
                run_state.state.expect(expected_rates(limits))

    def _restore(self, transitions: Sequence[Transition]) -> None:
        self.run_state.recorded_alarms = restore(self.run_state.recorded_alarms, transitions)

    def _skip_words(self, from_s: float) -> None:
        """A run that begins in the middle knows what was recorded before: what stood, who paused, which settings."""
        words, run_state = self.drive.recorded.words, self.run_state
        before: list[Transition] = []
        while run_state.words < len(words) and words[run_state.words][0] < from_s:
            at_s, word = words[run_state.words]
            run_state.words += 1
            if isinstance(word, Transition):
                before.append(word)
                run_state.load.add([word])
            elif not isinstance(word, PhoneWord):
                self._apply(word, at_s)
        if before:
            self._restore(before)

    def _link(self, now_s: float) -> LinkFacts:
        """A link that opened with the first message and answers as long as there is something to read."""
        run_state, delay = self.run_state, self.drive.delay
        found = delay.link(now_s) if delay is not None else None
        return LinkFacts(
            late_s=found.late_s if found is not None else None,
            throttled=found.throttled if found is not None else frozenset(),
            reduced=found.reduced if found is not None else None,
            phase="monitoring",
            since_s=run_state.opened_s,
            bridge_heard_s=now_s,
            bridge_answers=True,
            topics_subscribed=len(self._epoch.published),
            connected_s=run_state.opened_s,
            last_message_s=run_state.last_message_s,
            published=self._epoch.published,
            wall_zero_s=self.drive.start_s,
        )

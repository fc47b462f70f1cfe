"""One way through a recording: every message and every tick up to a moment, judged as the drive itself was."""

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
from server.judge.message import Message
from server.judge.pipeline import TICK_S
from server.recording.delay import LinkDelay
from server.recording.read.read import Recording
from server.replay.drive import Drive, SettingsEpoch
from server.replay.recorded_events import NewSettings, Pause
from server.replay.recorded_slowdown import SlowDownTold
from server.replay.run_state import RunState

SILENCE_S = 600.0  # after so long without a message nothing new can be said: the judge is not stepped through the rest
LOOK_EVERY = 24  # steps between two looks at the clock: some 2 ms


class Run:
    """Goes forward only; for another moment begin another, or go on from what was known. Times are seconds since the
    beginning of the recording."""

    def __init__(
        self,
        recording: Recording,
        drive: Drive,
        *,
        from_s: float = 0.0,
        run_state: RunState | None = None,
        on_told: Callable[[Sequence[Transition]], None] = lambda _: None,
        on_judged: Callable[[Sequence[Transition]], None] = lambda _: None,
        on_changed: Callable[[tuple[str, ...], State, float], None] = lambda *_: None,
        on_message: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Begins at `from_s` knowing nothing, or goes on from `run_state`."""
        self.drive = drive
        self._recording = recording
        self._on_told, self._on_judged, self._on_changed, self._on_message = on_told, on_judged, on_changed, on_message
        is_new = run_state is None
        self.run_state = self._begin(from_s) if run_state is None else run_state
        self._epoch = drive.epochs[self.run_state.epoch]
        self._messages = self._read()
        self._next: Message | None = next(self._messages, None)
        if is_new:
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
        """How it is judged now."""
        return self._epoch

    @property
    def at_s(self) -> float:
        """Everything up to here is in it."""
        return self.run_state.at_s

    @property
    def is_at_end(self) -> bool:
        return self._next is None and self.run_state.at_s >= self.drive.length_s

    def advance(self, until_s: float, is_over: Callable[[], bool] = lambda: False) -> bool:
        """Takes all there is up to a moment, that moment included. False: the time given was over before.

        Raises RecordingUnreadable.
        """
        run_state, words = self.run_state, self.drive.recorded.words
        steps = 0
        while True:
            message = self._next
            message_s = message.at_s - self.drive.start_s if message is not None else math.inf
            tick_s = self._tick_s(message_s)
            word_s = words[run_state.words][0] if run_state.words < len(words) else math.inf
            moment_s = min(message_s, tick_s, word_s)
            if moment_s > until_s:
                run_state.at_s = max(run_state.at_s, until_s)
                return True
            if word_s <= moment_s:
                run_state.words += 1
                self._hear(words[run_state.words - 1][1], word_s)
            elif tick_s <= moment_s:
                run_state.ticks += 1
                self._judge(tick_s, None)
            elif message is not None:
                self._receive(message, message_s)
                self._next = next(self._messages, None)
            run_state.at_s = max(run_state.at_s, moment_s)
            steps += 1
            if steps % LOOK_EVERY == 0 and is_over():
                return False

    def _read(self) -> Iterator[Message]:
        """What has not been taken yet. The same sum decides as while reading on, so no message is taken twice."""
        at_s, start_s = self.run_state.at_s, self.drive.start_s
        is_begun = self.run_state.ticks > 0 or self.run_state.reception.received > 0
        for message in self._recording.messages(max(0.0, at_s - 0.001), self.drive.topics):
            behind_s = message.at_s - start_s
            if behind_s > at_s or (behind_s == at_s and not is_begun):
                yield message

    def _tick_s(self, message_s: float) -> float:
        run_state = self.run_state
        tick_s = run_state.opened_s + run_state.ticks * TICK_S
        heard_s = run_state.opened_s if run_state.last_message_s is None else run_state.last_message_s
        if tick_s - heard_s > SILENCE_S and min(message_s, self.drive.length_s) - tick_s > 1.0:
            until_s = min(message_s, self.drive.length_s)
            run_state.ticks = max(run_state.ticks, math.floor((until_s - run_state.opened_s) / TICK_S) - 5)
            tick_s = run_state.opened_s + run_state.ticks * TICK_S
        return tick_s

    # -- what comes --------------------------------------------------------------------------------------------------

    def _receive(self, message: Message, now_s: float) -> None:
        run_state = self.run_state
        sources = self._epoch.listeners.get(message.topic)
        self._on_message(now_s)
        if sources is None:
            return
        run_state.heard.add(message.topic)
        run_state.last_message_s = now_s
        changed = pipeline.receive(
            sources,
            message.message,
            now_s,
            None,
            reception=run_state.reception,
            state=run_state.state,
            profile=self._epoch.tuning.profile,
            tyre_rad_per_unit=self._epoch.tuning.limits.steering.tyre_rad_per_unit,
            transport=self.drive.delay,
        )
        if changed:
            self._tell(pipeline.judge(run_state.monitor, run_state.state, now_s, changed))
            run_state.trends.hear(changed, run_state.state, now_s)
            self._on_changed(changed, run_state.state, now_s)
        if "scan" in changed:
            run_state.scans += 1
            run_state.kinds_kept = not isinstance(message.message["ranges"], list)

    def _judge(self, now_s: float, changed: tuple[str, ...] | None) -> None:
        run_state = self.run_state
        run_state.state.link(self._link(now_s))
        run_state.state.slow(run_state.slowed.facts(now_s, self._epoch.tuning.limits.slow_down))
        self._tell(pipeline.judge(run_state.monitor, run_state.state, now_s, changed))

    def _tell(self, transitions: tuple[Transition, ...]) -> None:
        if transitions:
            if not self.drive.recorded.has_alarms:
                self.run_state.load.add(transitions)
            self._on_judged(transitions)

    def _hear(self, word: object, now_s: float) -> None:
        run_state = self.run_state
        match word:
            case Transition():
                self._restore([word])
                run_state.load.add([word])
                self._on_told([word])
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
        """A run that begins in the middle knows what was told before: what stood, who paused, which settings."""
        words, run_state = self.drive.recorded.words, self.run_state
        before: list[Transition] = []
        while run_state.words < len(words) and words[run_state.words][0] < from_s:
            at_s, word = words[run_state.words]
            run_state.words += 1
            if isinstance(word, Transition):
                before.append(word)
                run_state.load.add([word])
            elif not isinstance(word, PhoneWord):
                self._hear(word, at_s)
        if before:
            self._restore(before)

    def _link(self, now_s: float) -> LinkFacts:
        """A link that opened with the first message and answers as long as there is something to read."""
        run_state = self.run_state
        delay = self.drive.delay.link(now_s) if self.drive.delay is not None else LinkDelay()
        return LinkFacts(
            late_s=delay.late_s,
            throttled=delay.throttled,
            reduced=delay.reduced,
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

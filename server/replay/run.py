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
from server.replay.run_state import Known

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
        self._epoch = drive.epochs[self.known.epoch]
        self._messages = self._read()
        self._next: Message | None = next(self._messages, None)
        if is_new:
            self._skip_words(from_s)

    def _begin(self, from_s: float) -> Known:
        epoch = self.drive.epochs[0]
        limits = epoch.tuning.limits
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
    def epoch(self) -> SettingsEpoch:
        """How it is judged now."""
        return self._epoch

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
        sources = self._epoch.listeners.get(message.topic)
        self._on_message(now_s)
        if sources is None:
            return
        known.heard.add(message.topic)
        known.last_message_s = now_s
        changed = pipeline.receive(
            sources,
            message.message,
            now_s,
            None,
            reception=known.reception,
            state=known.state,
            profile=self._epoch.tuning.profile,
            tyre_rad_per_unit=self._epoch.tuning.limits.steering.tyre_rad_per_unit,
            transport=self.drive.delay,
        )
        if changed:
            self._tell(pipeline.judge(known.monitor, known.state, now_s, changed))
            known.trends.hear(changed, known.state, now_s)
            self._on_changed(changed, known.state, now_s)
        if "scan" in changed:
            known.scans += 1
            known.kinds_kept = not isinstance(message.message["ranges"], list)

    def _judge(self, now_s: float, changed: tuple[str, ...] | None) -> None:
        known = self.known
        known.state.link(self._link(now_s))
        known.state.slow(known.slowed.facts(now_s, self._epoch.tuning.limits.slow_down))
        self._tell(pipeline.judge(known.monitor, known.state, now_s, changed))

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
                known.epoch += 1
                self._epoch = self.drive.epochs[known.epoch]
                limits = self._epoch.tuning.limits
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
            topics_subscribed=len(self._epoch.published),
            connected_s=known.opened_s,
            last_message_s=known.last_message_s,
            published=self._epoch.published,
            wall_zero_s=self.drive.start_s,
        )

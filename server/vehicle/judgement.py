"""State and checks of one car: input are messages and time, output are alarm transitions."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from typing import Any

from monitor.alarm import AlarmMarks, Transition
from monitor.catalog import AnyCheck
from monitor.checks.signal_slow import expected_rates
from monitor.drive_trends import DriveTrends
from monitor.load import AlarmLoad, RecentLoad
from monitor.runner import Monitor
from monitor.state import Snapshot, State
from monitor.transport import TransportDelay
from monitor.trends import CheckMinute, Trends
from server.judge import pipeline
from server.judge.active_settings import ActiveSettings
from server.judge.frames import Frames
from server.judge.pipeline import Delays
from server.judge.reception_stats import Reception
from server.judge.topics import Source

log = logging.getLogger("catgraph.session")


class Aged:
    """The delay of a message whose age is known [s]."""

    def __init__(self, age_s: float) -> None:
        self._age_s = age_s

    def receive(self, topic: str, at_s: float, stamp_s: float | None = None) -> float:
        """As of `Delays`."""
        return self._age_s


class Judgement:
    """The state of a car and its monitor. `now` is a monotonic clock in seconds.

    `on_transitions` is called with what happened to alarms, at the moment it happens.
    """

    def __init__(
        self,
        checks: Sequence[AnyCheck] | None,
        tuning: ActiveSettings,
        *,
        now: Callable[[], float],
        on_transitions: Callable[[Collection[Transition]], None],
    ) -> None:
        """`checks` None: all there are."""
        self._tuning = tuning
        self._now = now
        self._on_transitions = on_transitions
        self._crashes_logged: set[str] = set()
        self._load = RecentLoad()
        self.monitor = Monitor(checks, tuning.limits)
        self.phone_in_car: str | None = None  # the phone in the car, chosen by the operator in control
        self.track_number = 0  # of this run of the server; another number is another track
        self.reset()

    def reset(self) -> None:
        """Another car is to be judged: nothing is known of it. The monitor keeps its alarms until `end`."""
        self.reception = Reception()
        self.transport = TransportDelay()
        self.frames = Frames()
        self.state = State(expected_rates(self._tuning.limits))
        self.state.ride(self.phone_in_car, self._now())
        self.trends = Trends(self._now())
        self.drive_trends = DriveTrends(self._now())
        self.drive_trends.set_limits(self._tuning.limits, self._now())
        self.marks = AlarmMarks()
        self.minute = CheckMinute()
        self.track_number += 1  # with the state begins another track
        self.topics: set[str] = set()  # that came and carry signals
        self._filled: dict[str, tuple[Source, ...]] = {}  # topic → where its newest message went to
        self.last_message_s: float | None = None  # of a signal
        self.other_message_s: float | None = None  # of a topic that is only recorded

    @property
    def load(self) -> AlarmLoad:
        """The alarms announced lately, of whichever car was monitored: the load is that of one operator."""
        return self._load.at(self._now())

    def add_load(self, transitions: Collection[Transition]) -> None:
        """Counts transitions of before this run."""
        self._load.add(transitions)

    def snapshot(self) -> Snapshot:
        return self.state.snapshot(self._now())

    def receive(
        self, sources: tuple[Source, ...], topic: str, message: Any, note: str | None, now_s: float
    ) -> tuple[str, ...]:
        """Decodes, applies and judges one message in one pass; the signals that changed."""
        self.topics.add(topic)
        self.last_message_s = now_s
        return self._apply(sources, topic, message, note, now_s, self.transport)

    def receive_again(
        self, sources: tuple[Source, ...], topic: str, message: Any, note: str | None, now_s: float, *, came_s: float
    ) -> tuple[str, ...]:
        """Count a message that the bridge sent again, and that came first at `came_s`. It is not new to the signals
        that have it; any other signal takes it at its age."""
        filled = self._filled.get(topic, ())
        others = tuple(source for source in sources if source not in filled)
        changed = self._apply(others, topic, message, note, now_s, Aged(now_s - came_s)) if others else ()
        for source in (one for one in sources if one.carries):
            self.reception.tally(source.signal).repeats += 1
        self._filled[topic] = sources
        return changed

    def correct_ages(self) -> None:
        """Follow what becomes known of the age of topics' first messages."""
        for topic, (at_s, age_s) in self.transport.older().items():
            for source in self._filled.get(topic, ()):
                if source.carries:
                    self.state.age(source.signal, at_s, age_s)

    def _apply(
        self, sources: tuple[Source, ...], topic: str, message: Any, note: str | None, now_s: float, delays: Delays
    ) -> tuple[str, ...]:
        changed = pipeline.receive(
            sources,
            message,
            now_s,
            note,
            reception=self.reception,
            state=self.state,
            profile=self._tuning.profile,
            tyre_rad_per_unit=self.monitor.limits.steering.tyre_rad_per_unit,
            units=self._tuning.settings.units,
            transport=delays,
            frames=self.frames,
            limits=self.monitor.limits,
        )
        self._filled[topic] = sources
        if changed:
            self.judge(now_s, changed)
            self.trends.receive(changed, self.state, now_s)
            self.drive_trends.receive(changed, self.state, now_s)
        return changed

    def judge(self, now_s: float, changed: tuple[str, ...] | None = None) -> None:
        """Judges what changed; None: time passed, everything."""
        transitions = pipeline.judge(self.monitor, self.state, now_s, changed)
        if self.monitor.crashes:
            self._log_crashes()
        self.report(transitions)
        if changed is None:
            self.minute.note(self.monitor.findings, now_s)

    def report(self, transitions: Collection[Transition]) -> None:
        """Transitions that an operator or the end of monitoring brought about are counted and reported likewise."""
        if transitions:
            self._load.add(transitions)
            for one in transitions:
                self.marks.add(one, one.at_s)
            self._on_transitions(transitions)

    def ride(self, phone: str | None, now_s: float) -> None:
        """From now on this phone is compared with the car, whatever the others report; it is kept over connections."""
        self.phone_in_car = phone
        self.state.ride(phone, now_s)

    def apply_settings(self) -> None:
        """The limits in force are those of the settings from this moment on."""
        self.monitor.limits = self._tuning.limits
        self.state.expect(expected_rates(self._tuning.limits))
        self.drive_trends.set_limits(self._tuning.limits, self._now())

    def _log_crashes(self) -> None:
        """Log each failing check once; the alarm "monitoring impaired" lasts as long as it fails."""
        for crash in self.monitor.crashes.values():
            if crash.check_id not in self._crashes_logged:
                self._crashes_logged.add(crash.check_id)
                log.error("check failed: check=%s error=%s\n%s", crash.check_id, crash.error, crash.where)

"""A recording as the values of its signals, decoded as they were live, under the settings in force at each moment."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

from server.judge.drive import Drive
from server.judge.offline import Observer, OfflineRun
from server.judge.pipeline import OnNumber
from server.judge.profiles import Profile
from server.judge.reception_stats import Reception
from server.judge.topics import Source
from server.judge.units import Unit
from server.recording.event_channels import read_recorded_events
from server.recording.export.export_format import Progress, nothing
from server.recording.read.read import Recording

REPORT_EVERY = 1000  # messages

OnValue = Callable[[str, Any, float, float | None], None]


class DecodedDrive:
    """What a recording holds of the car. `reception` counts what was read and rejected."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.reception = Reception()
        self._recorded = read_recorded_events(recording)
        self._drive = Drive(recording, self._recorded)

    @property
    def settings_toml(self) -> str | None:
        """The settings in force at the start; None: not recorded."""
        return self._recorded.settings

    @property
    def profile(self) -> Profile:
        """The kind of car at the beginning."""
        return self._drive.epochs[0].tuning.profile

    @property
    def sources(self) -> Mapping[str, Source]:
        """The topic of each signal at the beginning."""
        return self._drive.epochs[0].sources

    def read(
        self,
        on_value: OnValue,
        *,
        on_number: OnNumber | None = None,
        signals: Collection[str] | None = None,
        progress: Progress = nothing,
    ) -> None:
        """Reads all values of the signals (None: of all) in the order of their reception.

        `on_value` receives signal, value, seconds since 1970 and the stamp by the car; `on_number` signal, number as it
        was published, its unit and the same times, where the unit is not known or cannot be converted. Raises
        RecordingUnreadable.
        """
        recording = self.recording
        drive = self._drive if signals is None else self._of(signals)
        run = OfflineRun(recording, drive, observer=_Values(drive, on_value, on_number, progress), with_checks=False)
        self.reception = run.run_state.reception
        run.advance(math.inf, to_last_message=True)

    def _of(self, signals: Collection[str]) -> Drive:
        return Drive(self.recording, self._recorded, signals=signals, evidence=self._drive.evidence)

    def other_topics(self) -> dict[str, tuple[str, int]]:
        """Topic → type and count, of what fills no signal."""
        used, topics = self._drive.topics - self._drive.moving_transforms, self.recording.topics
        return {topic: (info.type, info.count) for topic, info in sorted(topics.items()) if topic not in used}

    def not_measured(self) -> list[str]:
        """What the car declared as not measured, in sentences; complete once all was read."""
        return [
            f"{tally.not_measured} of {tally.received} messages for {signal}: "
            f"{tally.why_not_measured or 'not measured'}."
            for signal, tally in sorted(self.reception.by_signal.items())
            if tally.not_measured
        ]

    def losses(self) -> list[str]:
        """What was read and could not be used, in sentences; complete once all was read."""
        recording = self.recording
        return [
            *(
                f"{tally.rejected} of {tally.received} messages for {signal} were invalid: {tally.last_reason}."
                for signal, tally in sorted(self.reception.by_signal.items())
                if tally.rejected
            ),
            *(
                f"{count} messages on {topic} could not be decoded: {recording.why_rejected.get(topic, 'not JSON')}."
                for topic, count in sorted(recording.rejected.items())
            ),
            *(f"{sentence}." for sentence in recording.damage),
        ]


class _Values(Observer):
    """Reports the values of a run with their time of day."""

    def __init__(self, drive: Drive, on_value: OnValue, on_number: OnNumber | None, progress: Progress) -> None:
        self._start_s, self._length_s = drive.start_s, max(drive.length_s, 1e-9)
        self._on_value, self._on_number = on_value, on_number
        self._progress = progress
        self._messages = 0

    def message_received(self, topic: str, now_s: float) -> None:
        """Reports progress."""
        if self._messages % REPORT_EVERY == 0:
            self._progress(min(1.0, now_s / self._length_s))
        self._messages += 1

    def value_decoded(self, signal: str, value: Any, now_s: float, stamp_s: float | None) -> None:
        """Reports the value."""
        self._on_value(signal, value, self._start_s + now_s, stamp_s)

    def number_decoded(
        self, signal: str, number: float, unit: Unit | None, now_s: float, stamp_s: float | None
    ) -> None:
        """Reports the number."""
        if self._on_number is not None:
            self._on_number(signal, number, unit, self._start_s + now_s, stamp_s)

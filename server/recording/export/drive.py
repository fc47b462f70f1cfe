"""A recording read as what it says of the car: each message decoded by the road that live goes, under the settings that
were in force when it began."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

from monitor.values import Steering
from server.judge.active_settings import PERCENT_A_RAD, ActiveSettings
from server.judge.message_fields import stamp_s
from server.judge.profiles import load as load_profiles
from server.judge.reception_stats import Reception
from server.judge.ros_names import BadName, canonical_name
from server.judge.settings import AUTO, Settings, SettingsFile, salvage
from server.judge.topics import Source, map_signals
from server.recording.export.outcome import Progress, nothing
from server.recording.read.read import Recording

_TOLD_EVERY = 1000  # messages


@dataclass(frozen=True, slots=True)
class Said:
    """One signal's value at one moment."""

    at_s: float  # since 1970, when it was received
    stamp_s: float | None  # by the message's own header, on the car's clock
    signal: str
    value: Any


class Drive:
    """What a recording says. `reception` counts what was read and rejected while it is read."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.settings_toml = settings_at_start(recording)
        self.settings = _settings(self.settings_toml)
        self.reception = Reception()
        offered = _offered(recording)
        tuning = ActiveSettings(SettingsFile(None))
        tuning.recognise(offered, recording.ros_version)
        if self.settings.profile != AUTO:
            tuning.change(values={}, topics={}, profile=self.settings.profile, version=None)
        self.profile = tuning.profile
        self.sources = map_signals(offered, self.settings.topics)

    def values(self, signals: Collection[str] | None = None, progress: Progress = nothing) -> Iterator[Said]:
        """All values of the signals (None: of all) in the order of their reception. Raises RecordingUnreadable."""
        recording, reception = self.recording, self.reception
        by_topic = self._sources_by_topic(signals)
        is_angle = self.profile.steering == "tyre_angle"
        length_s = max(recording.duration_s, 1e-9)
        for count, message in enumerate(recording.messages(topics=by_topic)):
            if count % _TOLD_EVERY == 0:
                progress(min(1.0, (message.at_s - recording.start_s) / length_s))
            for source in by_topic.get(message.topic, ()):
                value = reception.read(source, message.message, None)
                if value is None:
                    continue
                if is_angle and type(value) is Steering:
                    value = Steering(percent=value.percent * PERCENT_A_RAD)
                yield Said(message.at_s, stamp_s(message.message), source.signal, value)

    def other_topics(self) -> dict[str, tuple[str, int]]:
        """Topic → type and count, of what fills no signal."""
        used = set(self._sources_by_topic(None))
        return {
            topic: (info.type, info.count) for topic, info in sorted(self.recording.topics.items()) if topic not in used
        }

    def losses(self) -> list[str]:
        """What was read and could not be used, in sentences; complete once all was read."""
        recording = self.recording
        return [
            *(
                f"{tally.rejected} of {tally.received} messages for {signal} were no proper ones: {tally.last_reason}."
                for signal, tally in sorted(self.reception.by_signal.items())
                if tally.rejected
            ),
            *(
                f"{count} messages on {topic} could not be decoded: {recording.why_rejected.get(topic, 'not JSON')}."
                for topic, count in sorted(recording.rejected.items())
            ),
            *(f"{sentence}." for sentence in recording.damage),
        ]

    def _sources_by_topic(self, signals: Collection[str] | None) -> dict[str, tuple[Source, ...]]:
        """Topic as the recording spells it → the signals it fills."""
        wanted: dict[str, tuple[Source, ...]] = {}
        for source in self.sources.values():
            if source.decode is not None and (signals is None or source.signal in signals):
                wanted[source.topic] = (*wanted.get(source.topic, ()), source)
        found: dict[str, tuple[Source, ...]] = {}
        for topic in self.recording.topics:
            name = _name(topic)
            if name in wanted:
                found[topic] = wanted[name]
        return found


def settings_at_start(recording: Recording) -> str | None:
    """The settings in force when the recording began, as TOML; None where it does not say."""
    for _, told in recording.own("/catgraph/settings"):
        text = told.get("toml")
        if isinstance(text, str):
            return text
    return recording.metadata.get("settings") or None


def _settings(toml: str | None) -> Settings:
    return Settings() if toml is None else salvage(toml, load_profiles())[0]


def _offered(recording: Recording) -> dict[str, str]:
    """Topic → type as a bridge offers them."""
    named = ((_name(topic), info.type) for topic, info in recording.topics.items())
    return {name: kind for name, kind in named if name is not None}


def _name(topic: str) -> str | None:
    try:
        return canonical_name(topic)
    except BadName:
        return None

"""What of a recording does not change while it is replayed: its topics, its own events, its settings."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass

from server.analysis.thresholds import Wishes, tuning_for
from server.judge import pipeline
from server.judge.active_settings import Tuning
from server.judge.ros_names import BadName, canonical_name
from server.judge.settings import BadSetting, from_toml
from server.judge.topics import Source, map_signals
from server.recording.delay import RecordedDelay
from server.recording.read.read import Recording
from server.replay.recorded_events import NewSettings, RecordedEvents


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsEpoch:
    """How a recording is judged under one version of the settings."""

    tuning: Tuning
    sources: Mapping[str, Source]  # by signal
    listeners: Mapping[str, tuple[Source, ...]]  # by topic as the recording spells it

    @property
    def published(self) -> frozenset[str]:
        return pipeline.published(self.sources.values())


class Drive:
    """What does not change while a recording is run through, however often: its topics, its words, its settings."""

    def __init__(self, recording: Recording, recorded: RecordedEvents, settings: str) -> None:
        """`settings`: the file of all settings that count where the recording does not say which were in force."""
        self.recorded = recorded
        self.start_s = recording.start_s
        self.length_s = recording.duration_s
        self.ros_version = recording.ros_version
        self.notes: list[str] = [*recording.notes, *recorded.notes]
        delay = RecordedDelay(recording)
        self.delay = delay if delay.is_known else None
        self._names: dict[str, str] = {}  # as the recording spells a topic → as a bridge would offer it
        for topic in recording.topics:
            with contextlib.suppress(BadName):
                self._names[topic] = canonical_name(topic)
        self._offered = {name: recording.topics[topic].type for topic, name in self._names.items()}
        self.settings_from_recording = recorded.settings is not None
        self.epochs: list[SettingsEpoch] = [
            self._epoch(recorded.settings if recorded.settings is not None else settings)
        ]
        self.epochs += [self._epoch(word.toml) for _, word in recorded.words if isinstance(word, NewSettings)]
        self.topics = frozenset(topic for epoch in self.epochs for topic in epoch.listeners)

    def _epoch(self, toml: str) -> SettingsEpoch:
        try:
            read = from_toml(toml)
            wishes = Wishes(values=read.values, topics=read.topics, profile=read.profile)
            tuning = tuning_for(wishes, self._offered, self.ros_version)
        except BadSetting as why:
            self.notes.append(f"The settings cannot be used, so the defaults are: {why}")
            tuning = tuning_for(Wishes(), self._offered, self.ros_version)
        sources = map_signals(self._offered, tuning.settings.topics)
        by_topic = pipeline.by_topic(sources.values())
        found = {topic: by_topic.get(name, ()) for topic, name in self._names.items()}
        listeners = {
            topic: sources for topic, sources in found.items() if any(source.decode is not None for source in sources)
        }
        return SettingsEpoch(tuning=tuning, sources=sources, listeners=listeners)

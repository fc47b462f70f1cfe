"""What of a recording does not change while it is judged: its topics, its own events, its settings."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from server.judge import pipeline
from server.judge.active_settings import ActiveSettings
from server.judge.message import Json, RosVersion
from server.judge.recorded_events import NewSettings, RecordedEvents
from server.judge.ros_names import BadName, canonical_name
from server.judge.settings import BadSetting
from server.judge.settings_override import SettingsOverride, recorded_override, tuning_for
from server.judge.stamp_steps import ClockStep
from server.judge.topics import Source, map_signals

Row = tuple[float, str, str, Json]  # seconds since 1970, topic, type, message


class HasType(Protocol):
    """A topic of a recording."""

    @property
    def type(self) -> str: ...


class MessageSource(Protocol):
    """Messages with their times: a recording, or whatever else can be judged without its car."""

    start_s: float  # since 1970, of the first message
    duration_s: float
    ros_version: RosVersion
    notes: list[str]

    @property
    def topics(self) -> Mapping[str, HasType]: ...

    def rows(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Row]:
        """From `start_s` after the beginning on, in time order; messages of topics not named may be empty."""
        ...


class LinkState(Protocol):
    """What is known of the link at one moment."""

    @property
    def late_s(self) -> float | None: ...
    @property
    def throttled(self) -> frozenset[str]: ...
    @property
    def reduced(self) -> str | None: ...


class LinkHistory(pipeline.Delays, Protocol):
    """The delay of the link over a drive."""

    def link(self, now_s: float) -> LinkState: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsEpoch:
    """How a recording is judged under one version of the settings."""

    tuning: ActiveSettings
    sources: Mapping[str, Source]  # by signal
    listeners: Mapping[str, tuple[Source, ...]]  # by topic as the recording spells it

    @property
    def published(self) -> frozenset[str]:
        """The signals that the car has in a form that can be read."""
        return pipeline.published(self.sources.values())


class Drive:
    """The constant part of a run through a recording. Times are seconds since its beginning.

    `override` replaces all settings that the recording holds; without it they count, and where there are none
    `fallback`, a file of all settings, does. `signals`: those that are decoded; None: all.
    """

    def __init__(
        self,
        source: MessageSource,
        recorded: RecordedEvents,
        *,
        delay: LinkHistory | None = None,
        override: SettingsOverride | None = None,
        fallback: str = "",
        signals: Collection[str] | None = None,
    ) -> None:
        self._signals = signals
        self.start_s = source.start_s
        self.length_s = source.duration_s
        self.ros_version = source.ros_version
        self.delay = delay
        self.clock_steps: Sequence[ClockStep] = getattr(source, "clock_steps", ())  # what is no file has none
        self.notes: list[str] = [*getattr(source, "clock_notes", ()), *source.notes, *recorded.notes]
        self._names: dict[str, str] = {}  # as the recording spells a topic → as a bridge would offer it
        for topic in source.topics:
            try:
                self._names[topic] = canonical_name(topic)
            except BadName:
                self.notes.append(f"{topic[:60]!r} is not a valid topic name and is ignored.")
        self.offered = {name: source.topics[topic].type for topic, name in self._names.items()}
        self.settings_from_recording = override is None and recorded.settings is not None
        if override is not None:
            events = tuple(event for event in recorded.events if not isinstance(event[1], NewSettings))
            self.recorded = replace(recorded, events=events, settings=None)
            self.epochs = [self._epoch(override)]
        else:
            self.recorded = recorded
            self.epochs = [self._recorded_epoch(recorded.settings if recorded.settings is not None else fallback)]
            self.epochs += [
                self._recorded_epoch(event.toml) for _, event in recorded.events if isinstance(event, NewSettings)
            ]
        self.topics = frozenset(topic for epoch in self.epochs for topic in epoch.listeners)

    def _recorded_epoch(self, toml: str) -> SettingsEpoch:
        override, left_out = recorded_override(toml)
        self.notes += left_out
        try:
            return self._epoch(override)
        except BadSetting as why:
            self.notes.append(f"The settings cannot be used, so the defaults are: {why}")
            return self._epoch(SettingsOverride())

    def _epoch(self, override: SettingsOverride) -> SettingsEpoch:
        """Raises BadSetting."""
        tuning = tuning_for(override, self.offered, self.ros_version)
        sources = map_signals(self.offered, tuning.settings.topics)
        wanted = self._signals
        by_topic = pipeline.by_topic(one for one in sources.values() if wanted is None or one.signal in wanted)
        found = {topic: by_topic.get(name, ()) for topic, name in self._names.items()}
        listeners = {
            topic: sources for topic, sources in found.items() if any(source.decode is not None for source in sources)
        }
        return SettingsEpoch(tuning=tuning, sources=sources, listeners=listeners)

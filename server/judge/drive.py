"""What of a recording does not change while it is judged: its topics, its own events, its settings."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import Protocol

from server.judge import pipeline
from server.judge.active_settings import ActiveSettings
from server.judge.body_axes import TYPES
from server.judge.frames import Frames, is_static, is_transforms
from server.judge.message import Json, RosVersion
from server.judge.message_fields import text
from server.judge.recorded_events import NewSettings, RecordedEvents
from server.judge.ros_names import BadName, canonical_name
from server.judge.settings import BadSetting
from server.judge.settings_override import SettingsOverride, recorded_override, tuning_for
from server.judge.topics import Source, map_signals
from server.judge.transforms import Contradiction

MOST_STATIC = 1_000  # messages: a static transform that is sent again and again is read so often
FIRST_MOVING = 200  # messages of those that move, from which a run knows where the laser is when it begins

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

    def only(self, topics: Collection[str]) -> Iterator[Row]:
        """From the beginning on, in time order, nothing but messages of these topics."""
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
        self.notes: list[str] = [*source.notes, *recorded.notes]
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
        listened = frozenset(topic for epoch in self.epochs for topic in epoch.listeners)
        self.frames = Frames()
        self.moving_transforms: frozenset[str] = frozenset()  # topics to be followed: a laser is placed by them
        self.moving_transforms = self._read_transforms(source)
        self.topics = listened | self.moving_transforms

    def _read_transforms(self, source: MessageSource) -> frozenset[str]:
        """Reads the static transforms, wherever in the recording they are: a latched message is only at the beginning,
        and what it says holds for the whole drive. The topics of those that move are returned if a laser's frame is
        placed by them alone; they are then followed."""
        scans = {
            topic: one.topic
            for epoch in self.epochs
            for topic, sources in epoch.listeners.items()
            for one in sources
            if one.signal == "scan"
        }
        found = {topic for topic, name in self._names.items() if is_transforms(name, source.topics[topic].type)}
        heard = {one.type for epoch in self.epochs for sources in epoch.listeners.values() for one in sources}
        if not found or not (scans or heard & TYPES):
            return frozenset()
        moving = frozenset(topic for topic in found if not is_static(topic))
        self._learn_frames(source, found - moving, MOST_STATIC)
        if moving and not all(self._is_placed(source, topic, name) for topic, name in scans.items()):
            self._learn_frames(source, moving, FIRST_MOVING)
        else:
            moving = frozenset()
        self.notes += self.frames.notes
        return moving

    def _learn_frames(self, source: MessageSource, topics: Collection[str], most: int) -> None:
        for _, topic, _, message in islice(source.only(topics) if topics else (), most):
            self.frames.receive(self._names[topic], message)

    def _is_placed(self, source: MessageSource, topic: str, name: str) -> bool:
        """Whether the static transforms place the laser of a topic, by the frame of its first message."""
        for _, _, _, message in source.only({topic}):
            try:
                return self.frames.locate(name, text(message, "header", "frame_id")) is not None
            except Contradiction:
                return True  # moving ones do not resolve it
        return True

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

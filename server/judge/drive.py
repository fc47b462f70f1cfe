"""What of a recording does not change while it is judged: its topics, its own events, its settings."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

from server.judge import pipeline
from server.judge.active_settings import NO_CHOICES, ActiveSettings, SettingsOverride, recorded_override, tuning_for
from server.judge.comparisons import comparison_sources, offers
from server.judge.message import Json, RosVersion
from server.judge.recorded_events import NewSettings, RecordedEvents
from server.judge.recording_survey import RecordedTransforms, Surveyed, survey
from server.judge.ros_names import BadName, canonical_name
from server.judge.run_state import ClockStep
from server.judge.settings import BadSetting
from server.judge.sources.candidates import follow
from server.judge.sources.choice import Choice, choose
from server.judge.sources.evidence import Evidence, gather
from server.judge.topics import Source
from server.judge.unit_evidence import Evidence as UnitEvidence
from server.judge.unit_watch import Key, UnitBasis
from server.protocol.questions import Question, TopicOffer

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
    rejected: dict[str, int]  # topic → messages that could not be decoded

    @property
    def topics(self) -> Mapping[str, HasType]: ...

    def rows(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Row]:
        """From `start_s` after the beginning on, in time order; messages of topics not named may be empty, and with a
        mapping, those that contain none of the byte strings given for their topic (None: any)."""
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
    choice: Choice
    listeners: Mapping[str, tuple[Source, ...]]  # by topic as the recording spells it
    carriers: Mapping[str, str]  # signal → the topic that carries it
    compared: Mapping[str, tuple[str, ...]]  # signal → further topics of it
    published: frozenset[str]  # the signals that the car has in a form that can be read
    competing: frozenset[str] = frozenset()  # topics as the recording spells them, of signals that none carries yet

    @property
    def sources(self) -> Mapping[str, Source]:
        """By signal."""
        return self.choice.sources

    @property
    def undecided(self) -> Mapping[str, str]:
        """Why no topic carries a signal though there are some, by signal."""
        return self.choice.undecided

    @property
    def questions(self) -> Sequence[Question]:
        """The questions to the operator."""
        return self.choice.questions


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
        evidence: Evidence | None = None,
        choices: SettingsOverride = NO_CHOICES,
    ) -> None:
        """`evidence`: of the same recording, where it was gathered already. `choices`: topics and units that are chosen
        now, before those that were recorded."""
        self._choices = choices
        self._fallback = fallback
        self._signals = signals
        self._source = source
        self.evidence = evidence  # None: no topics compete, or not gathered yet
        self.start_s = source.start_s
        self.length_s = source.duration_s
        self.ros_version = source.ros_version
        self.delay = delay
        self.clock_steps: Sequence[ClockStep] = getattr(source, "clock_steps", ())  # what is no file has none
        # The time of day at the beginning; None: one that was set proves nothing.
        self.wall_zero_s = None if self.clock_steps or recorded.clock_was_set else source.start_s
        self.notes: list[str] = [*getattr(source, "clock_notes", ()), *source.notes, *recorded.notes]
        self._names: dict[str, str] = {}  # as the recording spells a topic → as a bridge would offer it
        for topic in source.topics:
            try:
                self._names[topic] = canonical_name(topic)
            except BadName:
                self.notes.append(f"{topic[:60]!r} is not a valid topic name and is ignored.")
        self.offered = {name: source.topics[topic].type for topic, name in self._names.items()}
        self._transforms = RecordedTransforms(source, self._names, self.offered)
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
        # Topics of transforms to be followed: what is measured is placed by them.
        self.moving_transforms = self._transforms.follow({topic: self._names[topic] for topic in sorted(listened)})
        self.frames = self._transforms.frames
        self.notes += self.frames.notes
        self.topics = listened | self.moving_transforms

    @cached_property
    def unit_evidence(self) -> dict[Key, UnitEvidence]:
        """What the whole recording shows of the units of its topics. Reads them, where a unit is in doubt."""
        return survey(self._source, [self._surveyed(epoch) for epoch in self.epochs])

    def _surveyed(self, epoch: SettingsEpoch) -> Surveyed:
        by_topic = pipeline.by_topic(epoch.sources.values())
        return Surveyed(
            listeners=epoch.listeners,
            all_listeners={topic: by_topic.get(name, ()) for topic, name in self._names.items()},
            basis=UnitBasis(
                profile=epoch.tuning.profile,
                chosen=epoch.tuning.settings.units,
                tyre_rad_per_unit=epoch.tuning.limits.steering.tyre_rad_per_unit,
            ),
        )

    def _recorded_epoch(self, toml: str) -> SettingsEpoch:
        override, left_out = recorded_override(toml)
        self.notes += left_out
        topics, units = {**override.topics, **self._choices.topics}, {**override.units, **self._choices.units}
        try:
            epoch = self._epoch(replace(override, topics=topics, units=units))
            later = self._chosen_later(epoch)
            return self._epoch(replace(override, topics=topics | later, units=units)) if later else epoch
        except BadSetting as why:
            self.notes.append(f"The settings cannot be used, so the defaults are: {why}")
            return self._epoch(SettingsOverride())

    def _chosen_later(self, epoch: SettingsEpoch) -> dict[str, str]:
        """Signal → topic that the operator chose since, of what the recorded settings leave open."""
        if not epoch.undecided or not self._fallback:
            return {}
        chosen = recorded_override(self._fallback)[0].topics
        return {
            signal: topic
            for signal, topic in chosen.items()
            if signal in epoch.undecided and signal not in epoch.tuning.settings.topics and topic in self.offered
        }

    def offers(self, epoch: SettingsEpoch) -> dict[str, list[TopicOffer]]:
        """Signal → the topics that can carry it, with what is known of each."""
        return offers(self.offered, epoch.choice.reasons, self.evidence or Evidence())

    def _epoch(self, override: SettingsOverride) -> SettingsEpoch:
        """Raises BadSetting."""
        tuning = tuning_for(override, self.offered, self.ros_version)
        choice = choose(self.offered, tuning.settings.topics, evidence=self._evidence_for(tuning.settings.topics))
        decoded, wanted = (*choice.sources.values(), *comparison_sources(self.offered, choice.sources)), self._signals
        by_topic = pipeline.by_topic(one for one in decoded if wanted is None or one.signal in wanted)
        found = {topic: by_topic.get(name, ()) for topic, name in self._names.items()}
        listeners = {
            topic: sources for topic, sources in found.items() if any(source.decode is not None for source in sources)
        }
        return SettingsEpoch(
            tuning=tuning,
            choice=choice,
            listeners=listeners,
            carriers=pipeline.carriers(choice.sources.values()),
            compared=pipeline.compared(source for sources in by_topic.values() for source in sources),
            published=pipeline.published(choice.sources.values()),
            competing=frozenset(topic for topic, name in self._names.items() if name in choice.competing),
        )

    def _evidence_for(self, picked: Mapping[str, str]) -> Evidence | None:
        """What the recording shows of the topics that compete for a signal; read once, and only where some do."""
        if self.evidence is None:
            evidence, found = Evidence(self._transforms.looks_ahead), self._source.topics
            # Of all that could compete: with the next settings others may.
            follow(evidence, self.offered, {})
            follow(evidence, self.offered, picked)
            evidence.silent = frozenset(
                name for topic, name in self._names.items() if getattr(found[topic], "count", 1) == 0
            )
            if evidence.is_to_gather:
                self.evidence = gather(self._source, self._names, evidence)
        return self.evidence

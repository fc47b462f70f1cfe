"""What is read of a recording before it is judged: its transforms, and topics whose unit the values decide."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any, Protocol

from monitor.values import LaserScan
from server.judge.body_axes import TYPES
from server.judge.frames import Frames, is_static, is_transforms
from server.judge.message_fields import has_fields, text
from server.judge.topic import FLOATS
from server.judge.topics import Source, plain_type
from server.judge.unit_evidence import Evidence, new_evidence
from server.judge.unit_watch import PLACES, Key, UnitBasis, number_of, read
from server.judge.units import UnitRule, rule_for

MOST_STATIC = 1_000  # messages: a static transform that is sent again and again is read so often
FIRST_MOVING = 200  # messages of those that move, which give the laser's pose at the beginning of a run
FIRST_MEASURED = 20  # messages of each topic: the parts of a sweep may come from several lasers
PLACED = {plain_type(kind) for kind in TYPES} | {"sensor_msgs/LaserScan"}  # types of what has a place on the car

MOST_VALUES = 500_000  # of the surveyed topics; what comes later is taken as it comes
MOST_ROWS = 1_000_000  # of all topics: some seconds
MOST_FOR_SPEED = 4_000  # messages of a speed in m/s by its definition, and of what it is compared with
REFERENCES = ("odometry", "position")


class Rows(Protocol):
    """Messages of a recording."""

    def only(self, topics: Collection[str]) -> Iterator[tuple[float, str, str, Any]]: ...


class RecordedTransforms:
    """The transforms of a recording: read before it is judged, wherever in it they are.

    A latched message is only at the beginning, and its content holds for the whole drive.
    """

    def __init__(self, source: Rows, names: Mapping[str, str], types: Mapping[str, str]) -> None:
        """`names`: topic as the recording spells it → as a bridge would offer it; `types`: that → type."""
        self._source = source
        self._names = names
        self._types = types
        found = {topic for topic, name in names.items() if is_transforms(name, types[name])}
        if not any(plain_type(kind) in PLACED for kind in types.values()):
            found = set()
        self._moving = frozenset(topic for topic in found if not is_static(names[topic]))
        self.frames = Frames()
        self._static = found - self._moving
        self._learn(self.frames, self._static, MOST_STATIC)

    def looks_ahead(self, topic: str, scan: LaserScan) -> bool | None:
        """Whether the laser of a topic, as a bridge would offer it, looks ahead; None: no transform gives it."""
        found = self.frames.looks_ahead(topic, scan)
        return self._with_moving.looks_ahead(topic, scan) if found is None and self._moving else found

    def follow(self, listened: Mapping[str, str]) -> frozenset[str]:
        """The topics of transforms that move if anything of the topics `listened` to (as the recording spells one → as
        a bridge would) is placed on the car: a run has to follow them, since they may place it, or contradict what does
        at any time; `frames` then has their first messages."""
        measured = [(name, frame) for topic, name in listened.items() for frame in self._frames_of(topic, name)]
        if measured and self._moving:
            self.frames = self._with_moving
        for name, frame in measured:
            self.frames.ask(name, frame)
        return self._moving if measured else frozenset()

    @cached_property
    def _with_moving(self) -> Frames:
        frames = deepcopy(self.frames)
        self._learn(frames, self._moving, FIRST_MOVING)
        return frames

    def _learn(self, frames: Frames, topics: Collection[str], most: int) -> None:
        for _, topic, _, message in islice(self._source.only(topics) if topics else (), most):
            frames.receive(self._names[topic], message)

    def _frames_of(self, topic: str, name: str) -> set[str]:
        """The frames of what a topic measures, by its first messages; none of what has no place on the car."""
        if plain_type(self._types[name]) not in PLACED or not (self._static or self._moving):
            return set()
        return {_frame(message) for _, _, _, message in islice(self._source.only({topic}), FIRST_MEASURED)}


def _frame(message: Any) -> str:
    """The frame whose place counts: of an Odometry the one below."""
    if has_fields(message) and "child_frame_id" in message:
        return text(message, "child_frame_id")
    return text(message, "header", "frame_id")


class UnitRows(Protocol):
    """Messages of a recording."""

    @property
    def start_s(self) -> float: ...
    @property
    def rejected(self) -> dict[str, int]: ...

    def rows(
        self, start_s: float = 0.0, topics: Collection[str] | None = None
    ) -> Iterator[tuple[float, str, str, Any]]: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Surveyed:
    """What is read under one version of the settings: topic as the recording spells it → what it fills."""

    listeners: Mapping[str, Sequence[Source]]  # of the signals that are wanted
    all_listeners: Mapping[str, Sequence[Source]]
    basis: UnitBasis


@dataclass(frozen=True, slots=True, kw_only=True)
class _Target:
    source: Source
    rule: UnitRule
    evidence: Evidence


@dataclass(slots=True)
class _Progress:
    """How far a recording was read."""

    until_s: float = -math.inf  # since its beginning


def survey(recording: UnitRows, epochs: Sequence[Surveyed]) -> dict[Key, Evidence]:
    """Reads those topics of a recording whose unit the values decide.

    The evidence of the whole drive, by signal and topic as a bridge spells it; nothing is read where nothing is in
    doubt. What cannot be read ends it: the run that follows reports that.
    """
    targets = _targets(epochs)
    if not targets:
        return {}
    speeds = [target for rows in targets.values() for target in rows if target.rule.by_way]
    references = _references(epochs) if speeds else {}
    is_short = all(_has_unit(target) for rows in targets.values() for target in rows)
    if is_short and not references:
        return {}
    counted = dict(recording.rejected)
    is_over, progress = False, _Progress()
    with suppress(Exception):
        is_over = _read(
            recording, targets, references, speeds, MOST_FOR_SPEED if is_short else MOST_VALUES, is_short, progress
        )
    recording.rejected.clear()
    recording.rejected.update(counted)  # they are counted when they are judged
    found = {}
    for rows in targets.values():
        for target in rows:
            target.evidence.is_whole = is_over
            target.evidence.until_s = progress.until_s
            found[target.source.signal, target.source.topic] = target.evidence
    return found


def _targets(epochs: Sequence[Surveyed]) -> dict[str, list[_Target]]:
    found: dict[str, list[_Target]] = {}
    known: set[Key] = set()
    for epoch in epochs:
        for topic, sources in epoch.listeners.items():
            for source in sources:
                rule = rule_for(source.signal, plain_type(source.type or ""))
                key = (source.signal, source.topic)
                if rule is None or source.decode is None or key in known:
                    continue
                if epoch.basis.unit_of(source.signal) is None:
                    known.add(key)
                    target = _Target(source=source, rule=rule, evidence=new_evidence(source.signal, rule))
                    found.setdefault(topic, []).append(target)
    return found


def _references(epochs: Sequence[Surveyed]) -> dict[str, list[Source]]:
    return {
        topic: [source for source in sources if source.signal in REFERENCES and source.decode is not None]
        for epoch in epochs
        for topic, sources in epoch.all_listeners.items()
        if any(source.signal in REFERENCES and source.decode is not None for source in sources)
    }


def _has_unit(target: _Target) -> bool:
    """By its definition: only its way could contradict it."""
    return target.rule.by_way and plain_type(target.source.type or "") not in FLOATS


def _read(
    recording: UnitRows,
    targets: Mapping[str, Sequence[_Target]],
    references: Mapping[str, Sequence[Source]],
    speeds: Sequence[_Target],
    most: int,
    is_short: bool,
    progress: _Progress,
) -> bool:
    """Whether everything was read."""
    taken = 0
    compared = {source.signal for sources in references.values() for source in sources}
    for row, (row_s, topic, _, message) in enumerate(recording.rows(0.0, frozenset((*targets, *references)))):
        if row >= MOST_ROWS:
            return False
        here, there = targets.get(topic, ()), references.get(topic, ())
        if not here and not there:
            continue
        taken += 1
        if taken > most:
            return False
        at_s = progress.until_s = row_s - recording.start_s
        for target in here:
            number = number_of(read(target.source, message))
            if number is not None:
                target.evidence.add(number, target.rule.units)
                if target.evidence.ways is not None:
                    target.evidence.ways.add_speed(number, at_s)
        for source in there:
            place = read(source, message)
            for target in speeds:
                if target.evidence.ways is not None and isinstance(place, PLACES):
                    target.evidence.ways.add_place(source.signal, place, at_s)
            if is_short and all(t.evidence.ways is not None and t.evidence.ways.compared >= compared for t in speeds):
                return False
    return True

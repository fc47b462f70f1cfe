"""The transforms of a recording: read before it is judged, wherever in it they are."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from copy import deepcopy
from functools import cached_property
from itertools import islice
from typing import Any, Protocol

from monitor.values import LaserScan
from server.judge.body_axes import TYPES
from server.judge.frames import Frames, is_static, is_transforms
from server.judge.message_fields import has_fields, text
from server.judge.topics import plain_type

MOST_STATIC = 1_000  # messages: a static transform that is sent again and again is read so often
FIRST_MOVING = 200  # messages of those that move, from which a run knows where the laser is when it begins
FIRST_MEASURED = 20  # messages of each topic: the parts of a sweep may come from several lasers
PLACED = {plain_type(kind) for kind in TYPES} | {"sensor_msgs/LaserScan"}  # types of what has a place on the car


class Rows(Protocol):
    """Messages of a recording."""

    def only(self, topics: Collection[str]) -> Iterator[tuple[float, str, str, Any]]: ...


class RecordedTransforms:
    """A latched message is only at the beginning, and what it says holds for the whole drive."""

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
        """Whether the laser of a topic, as a bridge would offer it, looks ahead; None: no transform says."""
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

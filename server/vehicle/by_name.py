"""The topics of a car whose bridge does not name them: those of the usual names of which messages come."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from server.judge.shapes import type_of
from server.judge.topics import Source

ALL_CAME_S = 2.0  # after the first message: what is slower is no candidate at first
MOST_TOPICS = 200
NOTE = "subscribed by name: the bridge has no rosapi"


class TopicsByName:
    """Of one car. Times are on a monotonic clock, in seconds."""

    def __init__(self) -> None:
        self.found: dict[str, str] = {}  # topic → type, by the fields of its first message
        self._first_s: float | None = None
        self.is_used = False  # `found` was mapped

    def receive(self, topic: str, message: Any, picked: Mapping[str, str], now_s: float) -> bool:
        """A message of a topic that was subscribed to by its name; whether its topics are to be mapped by it."""
        if topic in self.found or len(self.found) >= MOST_TOPICS:
            return self.is_due(now_s)
        signal = next((signal for signal, name in picked.items() if name == topic), None)
        self.found[topic] = type_of(message, topic, signal)
        if self._first_s is None:
            self._first_s = now_s
        return self.is_used or signal is not None

    def is_due(self, now_s: float) -> bool:
        """Whether the topics are to be mapped for the first time."""
        return not self.is_used and self._is_complete(now_s)

    def offered(self, picked: Mapping[str, str], now_s: float) -> Mapping[str, str]:
        """The topics as a bridge would offer them (topic → type); while more may come within a moment only those that
        are compared with no others."""
        self.is_used = self.is_used or self._is_complete(now_s)
        chosen = picked.values()
        return self.found if self.is_used else {name: kind for name, kind in self.found.items() if name in chosen}

    def _is_complete(self, now_s: float) -> bool:
        return self._first_s is not None and now_s - self._first_s >= ALL_CAME_S

    def beside(self, used: Mapping[str, object]) -> dict[str, Source]:
        """The topics that are not used: what they send is not judged, and was asked for."""
        return {
            topic: Source(signal="", topic=topic, type=kind or None, decode=None, carries=False)
            for topic, kind in self.found.items()
            if topic not in used
        }

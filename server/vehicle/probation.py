"""Recorded topics under suspicion of delaying the bridge: each is tried alone, and left if it delays the bridge again.

A ROS 2 bridge does nothing else while it encodes a message. One of 40 MB delays all others by a second or more, or the
bridge answers no ping and the link is closed. Such a topic must cost neither the judged signals nor the recording of
the other topics. Pure: time is an argument.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field

STEADY_S = 4.0  # the link holds for so long before the first of them is tried, and with each one before the next
LEFT_AFTER = 2  # times that the link fell silent while a topic was tried


@dataclass(slots=True)
class Probation:
    """Of one car, over all openings of its link."""

    left: set[str] = field(default_factory=set)  # not tried any more
    _waiting: dict[str, int] = field(default_factory=dict)  # topic → how often the link fell silent with it alone
    _tried: str | None = None
    _since_s: float = math.inf  # since when the link holds, or the one is tried

    def opened(self, now_s: float) -> None:
        """The link was opened: first all the others are subscribed to."""
        self._tried, self._since_s = None, now_s

    def silent(self, suspects: Collection[str]) -> list[str]:
        """Returns the topics that are left from now on, after the bridge stopped answering or fell behind. `suspects`:
        subscribed topics of which no message ever came."""
        tried, self._tried, self._since_s = self._tried, None, math.inf
        if tried is not None:
            self._waiting[tried] += 1
            if self._waiting[tried] >= LEFT_AFTER:
                del self._waiting[tried]
                self.left.add(tried)
                return [tried]
            return []
        for topic in suspects:
            self._waiting.setdefault(topic, 0)
        return []

    @property
    def is_trying(self) -> bool:
        """Whether one of them is subscribed to now, to see what it does."""
        return self._tried is not None

    def heard(self, topic: str) -> None:
        """A message of it came: it is not this one."""
        if self._waiting.pop(topic, None) is not None and topic == self._tried:
            self._tried = None

    def look(self, now_s: float) -> bool:
        """Whether others are held back than before."""
        if now_s - self._since_s < STEADY_S:
            return False
        before = self.held
        if self._tried is not None:  # the link held with it
            del self._waiting[self._tried]
        self._tried = min(self._waiting, key=lambda topic: (self._waiting[topic], topic), default=None)
        self._since_s = now_s
        return self.held != before

    @property
    def held(self) -> set[str]:
        """Topics that are not to be subscribed to now."""
        return {*self.left, *self._waiting} - {self._tried}

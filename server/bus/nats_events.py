"""The newest events of one vehicle at a web node: in order, once; missing ones are requested."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

RECENT = 200  # kept in memory; older ones are requested from the agent


class EventCache:
    """Takes events that were published or requested, in any order."""

    def __init__(self) -> None:
        self.run = ""
        self.last = 0  # every event up to this number was there
        self.newest = 0  # the newest that the agent has, as far as is known
        self._recent: deque[dict[str, Any]] = deque(maxlen=RECENT)

    @property
    def is_behind(self) -> bool:
        return self.newest > self.last

    def begin(self, run: str, last: int) -> None:
        """The agent is there, in this run of it; older events are left where they are. Those of another run may be of
        another log."""
        if run != self.run:
            self.last = self.newest = last
            self._recent.clear()
        self.run = run
        self.newest = max(self.newest, last)

    def take(self, events: Sequence[dict[str, Any]]) -> bool:
        """Events in order; those that were there are left out. True where there are new ones; see `is_behind`."""
        before = self.last
        for event in events:
            n = event.get("n")
            if type(n) is not int:
                return self.last != before
            self.newest = max(self.newest, n)
            if n == self.last + 1:
                self._recent.append(event)
                self.last = n
        return self.last != before

    def after(self, n: int, limit: int) -> list[dict[str, Any]] | None:
        """The events after number `n`; None where some of them are not here."""
        if n >= self.last:
            return []
        if not self._recent or self._recent[0]["n"] > n + 1:
            return None
        return [event for event in self._recent if event["n"] > n][:limit]

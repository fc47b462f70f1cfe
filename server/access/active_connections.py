"""What each device has under way now: requests and sockets, so that they end when it may not come any more."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(slots=True, eq=False)
class Visit:
    """One request or socket under way."""

    task: asyncio.Task[object]
    is_socket: bool
    ended_because: str | None = None  # set: it was ended from here, and not by its own program


class Visits:
    """All that is under way."""

    def __init__(self) -> None:
        self._under_way: dict[str, set[Visit]] = {}

    @contextmanager
    def of(self, device: str, *, is_socket: bool) -> Iterator[Visit]:
        """Notes the running task as a visit of this device."""
        task = asyncio.current_task()
        assert task is not None
        visit = Visit(task=task, is_socket=is_socket)
        mine = self._under_way.setdefault(device, set())
        mine.add(visit)
        try:
            yield visit
        finally:
            mine.discard(visit)
            if not mine and self._under_way.get(device) is mine:
                del self._under_way[device]

    def end(self, device: str, because: str, *, only_sockets: bool = False, but: object = None) -> int:
        """Ends what the device has under way, without waiting for it; how many. `but`: a task that goes on."""
        ended = [
            visit
            for visit in self._under_way.get(device, set())
            if visit.task is not but and (visit.is_socket or not only_sockets)
        ]
        for visit in ended:
            visit.ended_because = because
            visit.task.cancel()
        return len(ended)

    def sockets(self, device: str) -> int:
        """How many sockets it has open."""
        return sum(1 for visit in self._under_way.get(device, ()) if visit.is_socket)

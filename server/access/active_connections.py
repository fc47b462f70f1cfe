"""The open requests and sockets of each device, to cancel them when its access ends."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(slots=True, eq=False)
class ActiveConnection:
    """One open request or socket."""

    task: asyncio.Task[object]
    is_socket: bool
    ended_because: str | None = None  # set if it was cancelled from here


class ActiveConnections:
    """The open requests and sockets of all devices."""

    def __init__(self) -> None:
        self._under_way: dict[str, set[ActiveConnection]] = {}

    @contextmanager
    def of(self, device: str, *, is_socket: bool) -> Iterator[ActiveConnection]:
        """Register the running task as a connection of this device."""
        task = asyncio.current_task()
        assert task is not None
        visit = ActiveConnection(task=task, is_socket=is_socket)
        mine = self._under_way.setdefault(device, set())
        mine.add(visit)
        try:
            yield visit
        finally:
            mine.discard(visit)
            if not mine and self._under_way.get(device) is mine:
                del self._under_way[device]

    def end(self, device: str, because: str, *, only_sockets: bool = False, but: object = None) -> int:
        """Cancel the device's requests and sockets without waiting; return their number. `but`: a task to keep."""
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
        """The number of open sockets."""
        return sum(1 for visit in self._under_way.get(device, ()) if visit.is_socket)

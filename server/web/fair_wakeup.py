"""Many who wait for the same thing go one after another, so that many delay nothing else."""

from __future__ import annotations

import asyncio


class FairWakeup:
    """Sets events one by one, each in a turn of the loop of its own: between two of them timers and sockets are served.

    Who is in line already keeps the place, unless it became urgent. On one loop.
    """

    def __init__(self) -> None:
        self._urgent: dict[asyncio.Event, None] = {}
        self._line: dict[asyncio.Event, None] = {}
        self._next: asyncio.Handle | None = None

    def __len__(self) -> int:
        return len(self._urgent) + len(self._line)

    def queue(self, event: asyncio.Event, *, is_urgent: bool = False) -> None:
        """Append to the queue; urgent entries precede all others."""
        if is_urgent:
            self._line.pop(event, None)
            self._urgent[event] = None
        elif event not in self._urgent:
            self._line[event] = None
        if self._next is None:
            self._next = asyncio.get_running_loop().call_soon(self._call)

    def leave(self, event: asyncio.Event) -> None:
        self._urgent.pop(event, None)
        self._line.pop(event, None)

    def _call(self) -> None:
        self._next = None
        for line in (self._urgent, self._line):
            if line:
                event = next(iter(line))
                del line[event]
                event.set()
                break
        if len(self):
            self._next = asyncio.get_running_loop().call_soon(self._call)

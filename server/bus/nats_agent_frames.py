"""What an agent keeps of the frames that web nodes pull: what is looked at, goes unasked, or was too large."""

from __future__ import annotations

import asyncio
import contextlib
import logging

from server.bus.bus import ALL, SUMMARY, Frame
from server.bus.local import LocalBus

log = logging.getLogger("catgraph.bus")

LOG_AGAIN_S = 60.0  # the same complaint is logged no more often
FIRST_EVERY_S = 0.1  # a state is made
LARGEST_FIRST = 4000  # bytes of one: by the state that the node has it is 0.6 to 1.1 kB
MOST_FIRST = 10  # states: the first pull comes a round trip after the announcement, or later where a packet was lost


class Looked:
    """One kind of frame of one vehicle, while nodes pull it: counted as one viewer, and its newest frame awaited."""

    def __init__(self, bus: LocalBus, vehicle: str, kind: str) -> None:
        self._bus = bus
        self._key = (ALL, vehicle) if kind == SUMMARY else (vehicle, kind)
        self._changed = asyncio.Event()
        self._is_extra = kind not in ("state", SUMMARY)
        self._unwatch = bus.watch(self._key[0], self._on_new)
        if self._is_extra:
            bus.want(*self._key, +1)
        self.until_s = 0.0

    def close(self) -> None:
        self._unwatch()
        if self._is_extra:
            self._bus.want(*self._key, -1)

    @property
    def newest(self) -> Frame | None:
        return self._bus.newest(*self._key)

    async def after(self, number: int, wait_s: float) -> Frame | None:
        """The newest frame once it is another than `number`; None where none came in time."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(wait_s):
                while (frame := self.newest) is None or frame.number == number:
                    await self._changed.wait()
                return frame
        return None

    def _on_new(self, kind: str) -> None:
        if kind == self._key[1]:
            self._changed.set()
            self._changed = asyncio.Event()


class FirstStates:
    """Which states go unasked behind a gap: of vehicles whose states were pulled before it, until the first pull.

    A few and no more, so that a hop that stalls finds nothing old.
    """

    def __init__(self) -> None:
        self._have: dict[str, int] = {}  # the state that the node had at the last pull
        self._left: dict[str, int] = {}

    def begin(self) -> None:
        """The agent is back."""
        self._left = dict.fromkeys(self._have, MOST_FIRST)

    def note_pull(self, vehicle: str, have: int) -> None:
        self._have[vehicle] = have
        self._left.pop(vehicle, None)

    @property
    def due(self) -> list[str]:
        """Vehicles of which one goes now."""
        return [*self._left]

    def take(self, vehicle: str) -> int:
        """One goes now; the number of the state that the node has, 0 where none is due."""
        if vehicle not in self._left:
            return 0
        self._left[vehicle] -= 1
        if not self._left[vehicle]:
            del self._left[vehicle]
        return self._have[vehicle]


class TooLarge:
    """What was too large for the broker of late. Times are monotonic, in seconds."""

    def __init__(self) -> None:
        self._found: dict[str, tuple[str, float, float]] = {}  # what: a sentence, when it was so, and was logged

    def note(self, what: str, vehicle: str, size: int, largest: int, now_s: float) -> str:
        """A sentence on it."""
        key = f"{what} {vehicle}"
        _, _, logged_s = self._found.get(key, ("", 0.0, -LOG_AGAIN_S))
        if now_s - logged_s >= LOG_AGAIN_S:
            logged_s = now_s
            log.error("too_large_for_the_broker what=%s vehicle=%s bytes=%d", what, vehicle, size)
        takes = f"and the broker takes {largest // 1000} kB: it is not sent to web nodes."
        self._found[key] = (f"The {what} of {vehicle} has {size // 1000} kB, {takes}", now_s, logged_s)
        return self._found[key][0]

    def text(self, now_s: float) -> str | None:
        """In sentences; None: nothing."""
        return " ".join(text for text, at_s, _ in self._found.values() if at_s > now_s - LOG_AGAIN_S) or None

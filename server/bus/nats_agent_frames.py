"""The frames of an agent for web nodes: what is looked at, what is sent and how, and what was too large."""

from __future__ import annotations

import asyncio
import base64
import logging
from collections import defaultdict, deque
from collections.abc import Callable
from typing import Any

from server.bus import nats_wire as wire
from server.bus.bus import ALL, SUMMARY, Frame
from server.bus.local import LocalBus
from server.bus.nats_clock import Steady, slewed_s

log = logging.getLogger("catgraph.bus")

LOG_AGAIN_S = 60.0  # the same complaint is logged no more often
MOST_READERS = 100
FIRST_EVERY_S = 0.1  # a state is made
LARGEST_FIRST = 4000  # bytes of one: by the state that the node has it is 0.6 to 0.9 kB
MOST_RETURNS = 9  # in a row, without an answer between
LEVEL_FIRST = 9  # of zlib, so that an announcement with a state of before the gap is one packet: 1.3 kB instead of 1.6
LOOKED_AT_S = 600.0  # before the return, at most: of others none is made
LOOKED_LAST_S = 4.0  # before the last pull of any vehicle: a node repeats one that was lost after 3.5 s
MOST_FIRST = 20  # states: over a bad radio an answer to the first pulls that waits behind a lost packet comes by then


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
        self._given: dict[str, int] = {}  # the newest frame of each reader
        self._waiting = defaultdict[str, list[object]](list)
        self.until_s = 0.0

    def close(self) -> None:
        self._unwatch()
        if self._is_extra:
            self._bus.want(*self._key, -1)

    @property
    def newest(self) -> Frame | None:
        return self._bus.newest(*self._key)

    async def after(self, number: int, wait_s: float, reader: str = "") -> Frame | None:
        """The newest frame once it is another than `number`; None where none came in time.

        Pulls of one reader that come together get one frame each, the newest pull first: behind a stall the reader may
        have given up the others. "": no such reader.
        """
        waiting = self._waiting[reader]
        waiting.append(turn := object())
        try:
            async with asyncio.timeout(wait_s):
                while not self._is_for(reader, number, frame := self.newest) or (reader and waiting[-1] is not turn):
                    await self._changed.wait()
            if reader and frame is not None:
                self._given[reader] = frame.number
                if len(self._given) > MOST_READERS:
                    self._given.clear()
            return frame
        except TimeoutError:
            return None
        finally:
            waiting.remove(turn)
            if not waiting:
                self._waiting.pop(reader, None)

    def _is_for(self, reader: str, number: int, frame: Frame | None) -> bool:
        return frame is not None and frame.number not in (number, self._given.get(reader))

    def _on_new(self, kind: str) -> None:
        if kind == self._key[1]:
            self._changed.set()
            self._changed = asyncio.Event()


class SentFrames:
    """Frames as nodes get them: encoded, compressed by one that the node has, and the first ones behind a gap unasked.

    The unasked ones are states of vehicles whose states were pulled before it, beside the first answers: a few and no
    more, so that a hop that stalls finds nothing old. `now`: a monotonic clock in seconds.
    """

    def __init__(
        self, bus: LocalBus, run: str, now: Callable[[], float], slewed: Callable[[], float] = slewed_s
    ) -> None:
        self._bus = bus
        self._run = run
        self._now = now
        self._bases = defaultdict[tuple[str, str], wire.Bases](wire.Bases)
        self._have: dict[str, tuple[int, float]] = {}  # the state that the node had at the last pull, and when that was
        self._left: dict[str, int] = {}  # so many go unasked
        self._last: dict[str, int] = {}  # the last one that did
        self._slewed = slewed
        # Noted when each of the states was sent by which others are compressed: from its answer on a node that has it
        # may know the age of a state by this clock alone.
        self._clocks = defaultdict[str, dict[int, Steady]](dict)
        self._returns = deque[Steady](maxlen=MOST_RETURNS)  # what was answered since allows for less drift

    def encoded(self, came_s: float, frame: Frame | None, refused: str = "") -> bytes:
        """A frame as it is sent now; None: that there is no newer one, or why it is refused. The pull came then."""
        now_s = self._now()
        head = wire.FrameHead(run=self._run, number=0, now_s=now_s, waited_s=now_s - came_s, refused=refused)
        if frame is None:
            return wire.encode_frame(head)
        head = head.model_copy(
            update={"number": frame.number, "age_s": now_s - frame.put_s, "is_text": isinstance(frame.payload, str)}
        )
        return wire.encode_frame(head, frame.payload)

    def compressed(self, vehicle: str, kind: str, data: bytes, frame: Frame | None, pull: wire.Pull) -> bytes:
        """An encoded frame, for a node that inflates it."""
        bases = self._bases[vehicle, kind]
        data = wire.compressed(data, bases.get(pull.have) if pull.is_base and pull.run == self._run else b"")
        if frame is not None and isinstance(frame.payload, str):
            bases.add(frame.number, frame.payload)
            if kind == "state":
                self._note_clock(vehicle, frame.number)
        return data

    def _note_clock(self, vehicle: str, number: int, clock: Steady | None = None) -> None:
        clocks = self._clocks[vehicle]
        if clock is None and number not in clocks:
            clock = Steady(self._slewed)
            clock.note(self._now())
        if clock is not None:
            clocks[number] = clock
        while len(clocks) > wire.MOST_BASES:
            del clocks[next(iter(clocks))]

    def begin_first(self) -> list[str]:
        """The agent is back; `first_due`."""
        self._returns.append(returned := Steady(self._slewed))
        returned.note(self._now())
        last_s = max((at_s for _, at_s in self._have.values()), default=0.0)
        from_s = max(last_s - LOOKED_LAST_S, self._now() - LOOKED_AT_S)
        self._left = {one: MOST_FIRST for one, (_, at_s) in self._have.items() if at_s >= from_s}
        return self.first_due

    def note_pull(self, vehicle: str, kind: str, pull: wire.Pull) -> None:
        if kind != "state":
            return
        if pull.inflates and pull.is_base and pull.run == self._run:
            self._have[vehicle] = pull.have, self._now()

    @property
    def first_due(self) -> list[str]:
        """Vehicles of which a state goes unasked now."""
        return [*self._left]

    def announcement(self, vehicle: str, connection: int, *, is_first: bool = False) -> wire.Here:
        """Of the agent; `is_first`: with the state that goes unasked now."""
        last, more = self._bus.last_event(vehicle), self._first(vehicle) if is_first else {}
        return wire.Here(run=self._run, last=last, resumes=True, connection=connection, **more)

    def _first(self, vehicle: str) -> dict[str, Any]:
        """Its newest state as fields of an announcement; empty where none is due, or none that is small."""
        if vehicle not in self._left:
            return {}
        self._left[vehicle] -= 1
        if not self._left[vehicle]:
            del self._left[vehicle]
        bases, base, frame = self._bases[vehicle, "state"], self._have[vehicle][0], self._bus.newest(vehicle, "state")
        if frame is None or not isinstance(frame.payload, str) or not (text := bases.get(base)):
            return {}
        clock = self._clocks[vehicle].get(base)
        if clock is None or not self._is_steady_since(clock):
            return {}
        if frame.number in (base, self._last.get(vehicle)):  # none was made since
            return {}
        data = wire.compressed(self.encoded(self._now(), frame), text, LEVEL_FIRST)
        if len(data) > LARGEST_FIRST:
            return {}
        self._last[vehicle] = frame.number
        bases.add(frame.number, frame.payload)
        self._note_clock(vehicle, frame.number, clock)  # that of its base: the node may have no answer since
        return {"state": base64.b64encode(data).decode(), "base": base}

    def _is_steady_since(self, clock: Steady) -> bool:
        since = [one for one in self._returns if one.at_s >= clock.at_s]
        return len(since) < MOST_RETURNS and all(one.is_steady(self._now()) for one in (clock, *since))


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

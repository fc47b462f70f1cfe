"""The newest events of every vehicle at a web node; those lost on the way are requested from the agents."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from server.bus import nats_wire as wire
from server.bus.bus import NotServed
from server.bus.log_runs import Resumed
from server.bus.nats_questions import Questions

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

    def take(self, events: Sequence[dict[str, Any]], *, are_all: bool = False) -> bool:
        """Events in order; those that were there are left out. True where there are new ones; see `is_behind`.

        `are_all`: the agent has no others after `last`, as it was when they were requested: a number that is missing is
        of an event that its log has lost.
        """
        before = self.last
        for event in events:
            n = event.get("n")
            if type(n) is not int:
                return self.last != before
            self.newest = max(self.newest, n)
            if n == self.last + 1 or (are_all and n > self.last):
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


class RemoteLogs:
    """`on_new` is called with the name of a vehicle that has new events."""

    def __init__(self, questions: Questions, on_new: Callable[[str], None]) -> None:
        self._questions = questions
        self._on_new = on_new
        self._caches: dict[str, EventCache] = {}
        self._resuming: dict[str, bool] = {}  # whether their agents answer `resume`, once they announced it
        self._fetches: dict[str, asyncio.Task[None]] = {}
        self._changed = asyncio.Event()

    def __contains__(self, vehicle: str) -> bool:
        return vehicle in self._caches

    def __iter__(self) -> Iterator[str]:
        return iter(tuple(self._caches))

    async def stop(self) -> None:
        """Cancel the running requests."""
        for task in self._fetches.values():
            task.cancel()
        await asyncio.gather(*self._fetches.values(), return_exceptions=True)
        self._fetches.clear()

    def run(self, vehicle: str) -> str:
        """In which the agent numbers; "": nothing was received from it."""
        cache = self._caches.get(vehicle)
        return "" if cache is None else cache.run

    def last(self, vehicle: str) -> int:
        cache = self._caches.get(vehicle)
        return 0 if cache is None else cache.last

    def after(self, vehicle: str, n: int, limit: int) -> list[dict[str, Any]] | None:
        """The events after number `n`; None where some of them are not here."""
        cache = self._caches.get(vehicle)
        return [] if cache is None else cache.after(n, limit)

    def begin(self, vehicle: str, run: str, last: int) -> None:
        """The agent is there, in this run of it, and its newest event has this number."""
        cache = self._caches.setdefault(vehicle, EventCache())
        is_other = cache.run not in ("", run)
        cache.begin(run, last)
        if is_other:
            self._changed.set()
            self._changed = asyncio.Event()
            self._on_new(vehicle)  # its readers continue in this run
        self._fetch_missing(vehicle)

    def note_resuming(self, vehicle: str, *, is_able: bool) -> None:
        """Whether the agent is of a version that answers `resume`."""
        self._resuming[vehicle] = is_able

    async def resume(self, vehicle: str, run: str, n: int) -> Resumed:
        """As `PageBus.resume`."""
        if vehicle not in self._resuming:
            raise NotServed(f"{vehicle} has not announced yet which requests it answers")
        if not self._resuming[vehicle]:  # of an agent of before, only a shorter log is known to be another one
            common = n if n <= self.last(vehicle) else 0
            return Resumed(common=common, after=common, new_after=common)
        answer = await self._questions.ask(vehicle, wire.Ask(do="resume", run=run, n=n))
        if answer.resumed is None or answer.run != self.run(vehicle):
            raise NotServed(f"{vehicle} has started again")
        common, after, new_after = answer.resumed
        return Resumed(common=common, after=after, new_after=new_after)

    def take(self, vehicle: str, events: list[dict[str, Any]], *, are_all: bool = False) -> None:
        """Events that were published; or requested, and so all that the agent has from where the cache was."""
        if self._caches[vehicle].take(events, are_all=are_all):
            self._changed.set()
            self._changed = asyncio.Event()
            self._on_new(vehicle)
        self._fetch_missing(vehicle)

    def _fetch_missing(self, vehicle: str) -> None:
        running = self._fetches.get(vehicle)
        if self._caches[vehicle].is_behind and (running is None or running.done()):
            self._fetches[vehicle] = asyncio.create_task(self._fetch(vehicle))

    async def _fetch(self, vehicle: str) -> None:
        """Request the events lost on the way; where the agent does not answer, its next message starts this again."""
        cache = self._caches[vehicle]
        with contextlib.suppress(NotServed):
            while cache.is_behind:
                before, run = cache.last, cache.run
                answer = await self._questions.ask(vehicle, wire.Ask(do="after", n=before))
                if not answer.run == run == cache.run:  # it announces its new run itself; the rest is of another log
                    return
                self.take(vehicle, answer.events, are_all=True)
                if cache.last == before:
                    return

    async def caught_up(self, vehicle: str, last: int, wait_s: float) -> None:
        """Wait until event `last` is here, and no longer than `wait_s`."""
        cache = self._caches[vehicle]
        cache.newest = max(cache.newest, last)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(max(0.0, wait_s)):
                while cache.last < last:
                    self._fetch_missing(vehicle)
                    await self._changed.wait()

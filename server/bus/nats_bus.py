"""The bus of a web node: sessions run on agents, a NATS broker is between."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import Any

from nats.aio.client import Client
from nats.aio.msg import Msg

from server.bus import nats_wire as wire
from server.bus.bus import ALL, FRAME_LIVES_S, Frame, NotServed, Watcher
from server.bus.nats_events import EventCache
from server.bus.nats_pulls import Pulls
from server.bus.nats_questions import Questions
from server.bus.nats_sync import processed

GONE_AFTER_S = 3.0  # an agent that has not been heard for so long is not served


class NatsBus:
    """What pages need, of vehicles whose agents are elsewhere. `now`: a monotonic clock in seconds."""

    def __init__(self, client: Client, *, now: Callable[[], float]) -> None:
        self._client = client
        self._now = now
        self._frames: dict[tuple[str, str], Frame] = {}
        self._events: dict[str, EventCache] = {}
        self._heard_s: dict[str, float] = {}
        self._watchers: dict[str, dict[int, Watcher]] = {}
        self._next_watcher = 0
        self._wanted: dict[tuple[str, str], int] = {}
        self._fetches: dict[str, asyncio.Task[None]] = {}
        self._changed = asyncio.Event()
        self._questions = Questions(client, now=now)
        self._pulls = Pulls(client, self._questions, self._take_frame, now=now)

    async def start(self) -> None:
        await self._client.subscribe(wire.subject("*", "events"), cb=self._on_events)
        await self._client.subscribe(wire.subject("*", "here"), cb=self._on_here)
        await processed(self._client)

    async def stop(self) -> None:
        await self._pulls.stop()
        for task in self._fetches.values():
            task.cancel()
        await asyncio.gather(*self._fetches.values(), return_exceptions=True)

    # -- who is there --------------------------------------------------------------------------------------------------

    @property
    def vehicles(self) -> tuple[str, ...]:
        """All that were ever heard: one whose agent is gone is shown as lost, not left out."""
        return tuple(sorted(self._events))

    async def _on_here(self, message: Msg) -> None:
        try:
            here = wire.decode(wire.Here, message.data)
        except wire.Malformed as why:
            return self._questions.refuse(message.subject, why)
        vehicle = wire.vehicle_of(message.subject)
        self._meet(vehicle, here.run, here.last)

    def _meet(self, vehicle: str, run: str, last: int) -> None:
        is_new = vehicle not in self._events
        cache = self._events.setdefault(vehicle, EventCache())
        self._heard_s[vehicle] = self._now()
        cache.begin(run, last)
        self._fetch_missing(vehicle)
        if is_new:
            self._look(vehicle)

    # -- frames --------------------------------------------------------------------------------------------------------

    def put(self, vehicle: str, kind: str, payload: str | bytes) -> None:
        """Of this node alone: a frame composed of what it has of all vehicles."""
        if vehicle != ALL:
            raise ValueError("a node puts no frame of a vehicle")
        self._keep(vehicle, kind, payload, self._now())

    def newest(self, vehicle: str, kind: str) -> Frame | None:
        frame = self._frames.get((vehicle, kind))
        return frame if frame is not None and self._now() - frame.put_s <= FRAME_LIVES_S else None

    def _keep(self, vehicle: str, kind: str, payload: str | bytes, put_s: float) -> None:
        before = self._frames.get((vehicle, kind))
        number = before.number + 1 if before else 1
        self._frames[vehicle, kind] = Frame(number=number, payload=payload, put_s=put_s)
        self._wake(vehicle, kind)

    def watch(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        self._next_watcher += 1
        key = self._next_watcher
        self._watchers.setdefault(vehicle, {})[key] = watcher
        self._look_all(vehicle)

        def leave() -> None:
            self._watchers[vehicle].pop(key, None)
            self._look_all(vehicle)

        return leave

    def want(self, vehicle: str, kind: str, change: int) -> None:
        self._wanted[vehicle, kind] = self._wanted.get((vehicle, kind), 0) + change
        self._look(vehicle)

    def _look_all(self, vehicle: str) -> None:
        for one in self._events if vehicle == ALL else (vehicle,):
            self._look(one)

    def _look(self, vehicle: str) -> None:
        """Pull what somebody looks at, and nothing else."""
        looked = {
            "state": bool(self._watchers.get(vehicle)),
            wire.SUMMARY: bool(self._watchers.get(ALL)) and vehicle in self._events,
            **{kind: number > 0 for (whose, kind), number in self._wanted.items() if whose == vehicle},
        }
        for kind, is_looked in looked.items():
            self._pulls.look(vehicle, kind, is_looked)

    def _take_frame(self, vehicle: str, kind: str, payload: str | bytes, put_s: float) -> None:
        whose, name = (ALL, vehicle) if kind == wire.SUMMARY else (vehicle, kind)
        self._keep(whose, name, payload, put_s)

    def _wake(self, vehicle: str, kind: str) -> None:
        for watcher in tuple(self._watchers.get(vehicle, {}).values()):
            watcher(kind)

    # -- events --------------------------------------------------------------------------------------------------------

    def last_event(self, vehicle: str) -> int:
        cache = self._events.get(vehicle)
        return 0 if cache is None else cache.last

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]] | None:
        cache = self._events.get(vehicle)
        return [] if cache is None else cache.after(n, limit)

    async def events_after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        """Raises NotServed where they are at the agent and it does not answer."""
        recent = self.recent_events(vehicle, n, limit)
        if recent is not None:
            return recent
        return await self._read(
            vehicle, limit, lambda last, portion: wire.Ask(do="after", n=n if last is None else last, limit=portion)
        )

    async def find_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        """Raises NotServed, as `events_after`."""

        def ask(last: int | None, portion: int) -> wire.Ask:
            before = {} if last is None else {"before": last}
            return wire.Ask(do="find", filters={**filters, **before}, limit=portion)

        return await self._read(vehicle, filters.pop("limit", wire.PORTION), ask)

    async def _read(self, vehicle: str, limit: int, ask: Callable[[int | None, int], wire.Ask]) -> list[dict[str, Any]]:
        """In portions: `ask` is given the number of the last event that was read and how many to ask for."""
        found: list[dict[str, Any]] = []
        while len(found) < limit:
            portion = min(limit - len(found), wire.PORTION)
            answer = await self._questions.ask(vehicle, ask(found[-1]["n"] if found else None, portion))
            found += answer.events
            if len(answer.events) < portion:
                break
        return found

    async def _on_events(self, message: Msg) -> None:
        try:
            news = wire.decode(wire.Events, message.data)
        except wire.Malformed as why:
            return self._questions.refuse(message.subject, why)
        vehicle = wire.vehicle_of(message.subject)
        if not news.events or type(first := news.events[0].get("n")) is not int:
            return None
        if vehicle not in self._events:
            self._meet(vehicle, news.run, first - 1)
        return self._take(vehicle, news.events)

    def _take(self, vehicle: str, events: list[dict[str, Any]]) -> None:
        cache = self._events[vehicle]
        if cache.take(events):
            self._changed.set()
            self._changed = asyncio.Event()
            self._wake(vehicle, "events")
        self._fetch_missing(vehicle)

    def _fetch_missing(self, vehicle: str) -> None:
        running = self._fetches.get(vehicle)
        if self._events[vehicle].is_behind and (running is None or running.done()):
            self._fetches[vehicle] = asyncio.create_task(self._fetch(vehicle))

    async def _fetch(self, vehicle: str) -> None:
        """What was lost on the way; where the agent does not answer, its next word begins it again."""
        cache = self._events[vehicle]
        with contextlib.suppress(NotServed):
            while cache.is_behind:
                before = cache.last
                answer = await self._questions.ask(vehicle, wire.Ask(do="after", n=before))
                self._take(vehicle, answer.events)
                if cache.last == before:
                    return

    # -- requests ------------------------------------------------------------------------------------------------------

    async def request(self, vehicle: str, command: Mapping[str, Any], *, deadline_s: float = 3.0) -> Mapping[str, Any]:
        """The agent carries it out within `deadline_s` or not at all: the deadline is a time of its own clock."""
        ends_s = self._now() + deadline_s
        heard_s = self._heard_s.get(vehicle)
        if heard_s is None:
            raise NotServed(f"no vehicle is named {vehicle}")
        if self._now() - heard_s > GONE_AFTER_S:
            raise NotServed(f"nothing from {vehicle} for {self._now() - heard_s:.0f} s")
        clock = self._questions.clocks.get(vehicle)
        if clock is None or clock.run != self._events[vehicle].run or self._now() - clock.heard_s > GONE_AFTER_S:
            await self._questions.ask(vehicle, wire.Ask(do="clock"), within_s=deadline_s)
            clock = self._questions.clocks[vehicle]
        left_s = ends_s - self._now()
        not_after_s = clock.earliest(self._now()) + left_s
        asked = wire.Ask(do="command", command=dict(command), not_after_s=not_after_s, run=clock.run)
        answer = await self._questions.ask(vehicle, asked, within_s=left_s)
        await self._caught_up(vehicle, answer.last, ends_s)
        return answer.answer

    async def _caught_up(self, vehicle: str, last: int, ends_s: float) -> None:
        """What the command caused may be shown before it is answered; the answer does not wait longer than it may."""
        cache = self._events[vehicle]
        cache.newest = max(cache.newest, last)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(max(0.0, ends_s - self._now())):
                while cache.last < last:
                    self._fetch_missing(vehicle)
                    await self._changed.wait()

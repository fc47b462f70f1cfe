"""The bus of a web node: sessions run on agents, a NATS broker is between."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping
from typing import Any

from nats.aio.client import Client
from nats.aio.msg import Msg

from server.bus import nats_wire as wire
from server.bus.bus import ALL, FRAME_LIVES_S, SUMMARY, UNSERVED, Frame, NotServed, Watcher
from server.bus.log_runs import Resumed
from server.bus.nats_logs import RemoteLogs
from server.bus.nats_pulls import Pulls
from server.bus.nats_questions import GONE_AFTER_S, AgentLiveness, Questions, ReadEvent
from server.bus.watchers import Watchers

NOTIFY_EVERY_S = 0.5
REFUSED_FOR_S = FRAME_LIVES_S + wire.PULL_WAITS_S  # after the last refusal


# Of vehicle, kind, payload, age [s] at most, and by how much that is likely too great; raises Malformed.
Read = Callable[[str, str, str | bytes, float, float], str | bytes]


def as_it_is(vehicle: str, kind: str, payload: str | bytes, age_s: float, excess_s: float) -> str | bytes:
    return payload


class NatsBus:
    """What pages need, of vehicles whose agents are elsewhere. `now`: a monotonic clock in seconds."""

    def __init__(
        self,
        *,
        now: Callable[[], float],
        read: Read = as_it_is,
        expected: Collection[str] = (),
        read_event: ReadEvent = lambda event: event,
        on_new: Watcher = lambda _: None,
        on_message: Watcher = lambda _: None,
    ) -> None:
        """`read` frames of agents, `read_event` their events; `expected`: vehicles that are listed from the start, the
        others once something was received from them.

        `on_new` is called with the name of each vehicle that sends something for the first time, `on_message` always.
        """
        self._on_new, self._on_message = on_new, on_message
        self._now = now
        self._read_frame = read
        self._frames: dict[tuple[str, str], Frame] = {}
        self._watchers = Watchers()
        self._wanted: dict[tuple[str, str], int] = {}
        self._notifying: asyncio.Task[None] | None = None
        self._questions = Questions(now=now, read_event=read_event)
        self._agents = AgentLiveness(self._questions, now=now, expected=expected)
        self._logs = RemoteLogs(self._questions, lambda vehicle: self._watchers.wake(vehicle, "events"))
        self._refused: dict[tuple[str, str], tuple[str, float]] = {}  # why there is no frame of a kind, and since when
        self._pulls = Pulls(self._questions, self._take_frame, self._note_refused, now=now)

    def open(self) -> None:
        """Notify watchers of troubles, with or without a broker."""
        self._notifying = asyncio.create_task(self._notify_of_troubles(), name="notify of troubles")

    def close(self) -> None:
        if self._notifying is not None:
            self._notifying.cancel()

    async def start(self, client: Client) -> None:
        """From now on by this client, until `stop`."""
        self._questions.client = client
        await client.subscribe(wire.subject("*", "events"), cb=self._on_events)
        await client.subscribe(wire.subject("*", "here"), cb=self._on_here)
        self._look(ALL)

    async def stop(self) -> None:
        """Nothing comes any more, until the next start."""
        self._questions.client = None
        await self._pulls.stop()
        await self._logs.stop()

    @property
    def vehicles(self) -> tuple[str, ...]:
        return self._agents.vehicles

    @property
    def grows(self) -> bool:
        return True

    def link_trouble(self, vehicle: str) -> str | None:
        """Why no request reaches its agent; None: one does, whatever its values are."""
        return self._agents.trouble(vehicle)

    def trouble(self, vehicle: str) -> str | None:
        trouble = self.link_trouble(vehicle)
        if trouble is not None:
            return trouble
        if not self._watchers.viewers(vehicle):
            return self._why_none(vehicle, SUMMARY)
        if self.newest(vehicle, "state") is None:
            return self._why_none(vehicle, "state") or f"The agent of {vehicle} answers, and sends no values."
        return None

    def knows(self, vehicle: str) -> bool:
        return vehicle in self._logs

    def run(self, vehicle: str) -> str:
        return self._logs.run(vehicle)

    async def _notify_of_troubles(self) -> None:
        while True:
            for vehicle in self._watchers.viewed:
                if vehicle != ALL and self.trouble(vehicle) is not None:
                    self._watchers.wake(vehicle, UNSERVED)
            await asyncio.sleep(NOTIFY_EVERY_S)

    async def _on_here(self, message: Msg) -> None:
        try:
            here = wire.decode(wire.Here, message.data)
        except wire.Malformed as why:
            return self._questions.refuse(message.subject, why)
        vehicle = wire.vehicle_of(message.subject)
        if not here.is_copy and (is_again := self._agents.connects(vehicle, here)) is not None:
            self._logs.note_resuming(vehicle, is_able=here.resumes)
            self._meet(vehicle, here.run, here.last, is_again=is_again)
        return self._pulls.take_unasked(vehicle, here)

    def _meet(self, vehicle: str, run: str, last: int, *, is_again: bool = False) -> None:
        is_new, is_back = vehicle not in self._logs, is_again or self._agents.is_gone(vehicle)
        self._agents.note(vehicle)
        self._on_message(vehicle)
        self._logs.begin(vehicle, run, last)
        if is_back:
            self._pulls.again(vehicle)
        if is_new:
            self._on_new(vehicle)
            self._look(ALL)  # with a second one summaries are wanted of all
            self._watchers.wake(vehicle, "events")  # from now on pages of it can be greeted

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
        self._watchers.wake(vehicle, kind)

    def watch(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        leave = self._watchers.view(vehicle, watcher)
        self._look(vehicle)

        def end() -> None:
            leave()
            self._look(vehicle)

        return end

    def watch_events(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        return self._watchers.follow(vehicle, watcher)

    def want(self, vehicle: str, kind: str, change: int) -> None:
        self._wanted[vehicle, kind] = self._wanted.get((vehicle, kind), 0) + change
        self._look(vehicle)

    def _look(self, vehicle: str) -> None:
        """Pull only the frames that a page shows; `ALL`: of each vehicle from which something was received."""
        for one in self._logs if vehicle == ALL else (vehicle,):
            looked = {
                "state": self._watchers.viewers(one) > 0,
                SUMMARY: one in self._logs and self._shows_summaries,
                **{kind: number > 0 for (whose, kind), number in self._wanted.items() if whose == one},
            }
            for kind, is_looked in looked.items():
                self._pulls.look(one, kind, is_looked)

    @property
    def _shows_summaries(self) -> bool:
        """The pages of a node with one car have no use for its summary, and its pulls would delay their states;
        the page of all cars wants it."""
        is_wanted = len(self.vehicles) > 1 or self._wanted.get((ALL, SUMMARY), 0) > 0
        return is_wanted and self._watchers.viewers(ALL) > 0

    def _take_frame(self, vehicle: str, kind: str, payload: str | bytes, put_s: float, excess_s: float) -> None:
        """Raises Malformed."""
        payload = self._read_frame(vehicle, kind, payload, self._now() - put_s, excess_s)
        whose, name = (ALL, vehicle) if kind == SUMMARY else (vehicle, kind)
        self._keep(whose, name, payload, put_s)
        self._refused.pop((vehicle, kind), None)

    def _note_refused(self, vehicle: str, kind: str, why: str) -> None:
        self._refused[vehicle, kind] = (why, self._now())

    def _why_none(self, vehicle: str, kind: str) -> str | None:
        why, at_s = self._refused.get((vehicle, kind), ("", 0.0))
        return why if why and self._now() - at_s <= REFUSED_FOR_S else None

    def last_event(self, vehicle: str) -> int:
        return self._logs.last(vehicle)

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]] | None:
        return self._logs.after(vehicle, n, limit)

    async def events_after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        """Raises NotServed where they are at the agent and it does not answer."""
        self._agents.check_known(vehicle)
        recent = self.recent_events(vehicle, n, limit)
        if recent is not None:
            return recent
        run = self.run(vehicle)
        found = await self._questions.read(
            vehicle, limit, lambda last, portion: wire.Ask(do="after", n=n if last is None else last, limit=portion)
        )
        if self._questions.clocks[vehicle].run != run:  # of another run: the caller continues there
            raise NotServed(f"{vehicle} has started again")
        return found

    async def resume(self, vehicle: str, run: str, n: int) -> Resumed:
        """Raises NotServed, as `events_after`."""
        self._agents.check_known(vehicle)
        return await self._logs.resume(vehicle, run, n)

    async def find_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        """Raises NotServed, as `events_after`."""

        def ask(last: int | None, portion: int) -> wire.Ask:
            before = {} if last is None else {"before": last}
            return wire.Ask(do="find", filters={**filters, **before}, limit=portion)

        return await self._questions.read(vehicle, filters.pop("limit", wire.PORTION), ask)

    async def _on_events(self, message: Msg) -> None:
        try:
            news = wire.decode(wire.Events, message.data)
        except wire.Malformed as why:
            return self._questions.refuse(message.subject, why)
        vehicle = wire.vehicle_of(message.subject)
        if not news.events or type(first := news.events[0].get("n")) is not int:
            return None
        if news.run != self.run(vehicle):
            self._meet(vehicle, news.run, first - 1)
        return self._logs.take(vehicle, [self._questions.read_event(one) for one in news.events])

    async def request(
        self, vehicle: str, command: Mapping[str, Any], *, deadline_s: float = 3.0, comes_within_s: float | None = None
    ) -> Mapping[str, Any]:
        """The agent carries out what comes in time, and nothing later: the time is of its own clock."""
        began_s = self._now()
        ends_s = began_s + deadline_s
        due_s = ends_s if comes_within_s is None else began_s + min(deadline_s, comes_within_s)
        self._agents.check(vehicle)
        clock = self._questions.clocks.get(vehicle)
        if clock is None or clock.run != self._logs.run(vehicle) or self._now() - clock.received_s > GONE_AFTER_S:
            try:
                await self._questions.ask(vehicle, wire.Ask(do="clock"), within_s=deadline_s)
            except NotServed as why:  # the command itself was not sent
                raise NotServed(str(why), cut=why.cut) from None
            clock = self._questions.clocks[vehicle]
        now_s = self._now()
        ahead_s = clock.earliest(now_s) - now_s
        command_request = wire.Ask(
            do="command",
            command=dict(command),
            not_after_s=due_s + ahead_s,
            answered_by_s=ends_s + ahead_s,
            run=clock.run,
        )
        answer = await self._questions.ask(vehicle, command_request, within_s=ends_s - now_s)
        # What the command caused may be shown before it is answered; the answer does not wait longer than it may.
        await self._logs.caught_up(vehicle, answer.last, ends_s - self._now())
        return answer.answer

"""A web node pulls frames from agents: one after the other, and only what somebody looks at.

Over a slow radio one for each round trip is too few: there a few pulls are under way, each as long after the one before
as frames are made. The age of a frame counts from its own pull.
"""

from __future__ import annotations

import asyncio
import base64
import math
from collections.abc import Callable
from dataclasses import dataclass, field

from nats.errors import Error as NatsError

from server.bus import nats_wire as wire
from server.bus.nats_clock import AgentAhead, LikelyAhead
from server.bus.nats_questions import ANSWER_S, Questions

MOST = 100  # pulls a second of one kind of frame, where an agent answers at once
RETRY_S = 0.5  # after a pull that nobody answered
EVERY_S = 0.1  # a state is made
SLOW_S = 0.15  # the round trip from which on several pulls are under way
SMOOTHING = 0.75
MOST_UNDER_WAY = 6  # compressed, they are fewer bytes than one state is
MOST_TEXTS = 30  # frames by which one may be compressed: those that were under way when an agent was lost, and 20
LARGEST_UNASKED = 8000  # letters of one
Keep = Callable[[str, str, str | bytes, float, float], None]
Refuse = Callable[[str, str, str], None]


@dataclass(slots=True)
class _Newest:
    """Which frame of its kind came last."""

    number: int = 0
    run: str = ""
    run_requested_s: float = -math.inf  # when the pull was sent that brought the first one of this run
    texts: wire.Bases = field(default_factory=lambda: wire.Bases(MOST_TEXTS))  # none of a scan
    ahead: AgentAhead = field(default_factory=AgentAhead)
    likely: LikelyAhead = field(default_factory=LikelyAhead)


async def _ended(pulls: set[asyncio.Task[None]]) -> set[asyncio.Task[None]]:
    """None is left, once all of these have ended. Raises what one of them raised."""
    await asyncio.gather(*pulls)
    return set()


class Pulls:
    """`keep` gets vehicle, kind, payload, when it was put by our clock `now`, in seconds, no later than it was, and how
    long after that it likely was put.

    It raises Malformed. `refuse` gets vehicle, kind, and why there is no frame, as a sentence.
    """

    def __init__(self, questions: Questions, keep: Keep, refuse: Refuse, *, now: Callable[[], float]) -> None:
        self._questions = questions
        self._keep = keep
        self._refuse = refuse
        self._now = now
        self._tasks: dict[tuple[str, str], asyncio.Task[None]] = {}
        self._newest: dict[tuple[str, str], _Newest] = {}
        self._trips_s: dict[str, float] = {}  # to each vehicle's agent and back, smoothed

    def look(self, vehicle: str, kind: str, is_looked: bool) -> None:
        """Begin or end to pull this kind of frame; nothing where it is so already."""
        key = (vehicle, kind)
        if is_looked and (key not in self._tasks or self._tasks[key].done()):
            newest = self._newest.setdefault(key, _Newest())
            self._tasks[key] = asyncio.create_task(self._pull(vehicle, kind, newest))
        elif not is_looked and key in self._tasks:
            self._tasks.pop(key).cancel()
            del self._newest[key]

    def again(self, vehicle: str) -> None:
        """Request its frames anew: what was requested while its agent was silent is lost."""
        for key, task in [*self._tasks.items()]:
            if key[0] == vehicle:
                task.cancel()
                self._tasks[key] = asyncio.create_task(self._pull(*key, self._newest[key]))

    async def stop(self) -> None:
        tasks, self._tasks = self._tasks, {}
        self._newest.clear()
        for task in tasks.values():
            task.cancel()
        await asyncio.gather(*tasks.values(), return_exceptions=True)

    async def _pull(self, vehicle: str, kind: str, newest: _Newest) -> None:
        """Requests frames for as long as somebody looks."""
        under_way: set[asyncio.Task[None]] = set()
        began_s, requests = self._now(), 0  # in the second that began then
        try:
            while True:
                if requests >= MOST:
                    await asyncio.sleep(max(0.0, began_s + 1.0 - self._now()))
                if self._now() >= began_s + 1.0:
                    began_s, requests = self._now(), 0
                requests += 1
                most = self._most_under_way(vehicle, kind)
                if most == 1:
                    under_way = await _ended(under_way)
                    await self._request(vehicle, kind, newest)
                    continue
                due_s = self._now() + EVERY_S
                under_way.add(asyncio.create_task(self._request(vehicle, kind, newest)))
                wait_s = EVERY_S if len(under_way) < most else None
                done, under_way = await asyncio.wait(under_way, timeout=wait_s, return_when=asyncio.FIRST_COMPLETED)
                await _ended(done)
                if under_way:  # those that come together would bring the same frame for ever
                    await asyncio.sleep(max(0.0, due_s - self._now()))
        finally:
            for task in under_way:
                task.cancel()
            await asyncio.gather(*under_way, return_exceptions=True)

    def _most_under_way(self, vehicle: str, kind: str) -> int:
        """More than one only of states, which scans are not to delay, and only over a long round trip: an agent without
        a newer frame answers all of them with the next one."""
        trip_s = self._trips_s.get(vehicle, 0.0)
        return 1 if kind != "state" or trip_s < SLOW_S else min(MOST_UNDER_WAY, 1 + math.ceil(trip_s / EVERY_S))

    async def _request(self, vehicle: str, kind: str, newest: _Newest) -> None:
        """One frame newer than `newest`, where one comes."""
        if (client := self._questions.client) is None:
            return await asyncio.sleep(RETRY_S)
        requested_s = self._now()
        base = newest.texts.get(newest.number)
        pull = wire.Pull(have=newest.number, run=newest.run, inflates=True, is_base=bool(base))
        try:
            message = await client.request(
                wire.subject(vehicle, f"pull.{kind}"), wire.encode(pull), timeout=wire.PULL_WAITS_S + ANSWER_S
            )
            head, payload = wire.decode_frame(message.data, base)
        except (NatsError, TimeoutError):
            return await asyncio.sleep(RETRY_S)
        except wire.Malformed as why:
            newest.texts = wire.Bases(MOST_TEXTS)  # whatever it was: the next one is to need no other
            return await self._not_read(vehicle, kind, why)
        if head.run != newest.run:
            if requested_s < newest.run_requested_s:  # of a run that has ended since, and comes late
                return None
            newest.number, newest.run, newest.run_requested_s = 0, head.run, requested_s
            newest.texts, newest.ahead, newest.likely = wire.Bases(MOST_TEXTS), AgentAhead(), LikelyAhead()
        waited_s, now_s = max(0.0, head.waited_s), self._now()
        trip_s = max(0.0, now_s - requested_s - waited_s)
        self._trips_s[vehicle] = trip_s + SMOOTHING * (self._trips_s.get(vehicle, trip_s) - trip_s)
        self._questions.set_clock(vehicle, head.run, head.now_s)
        newest.ahead.received(head.now_s, now_s)
        newest.ahead.answered(requested_s, head.now_s - waited_s, now_s)
        newest.likely.answered(requested_s, head.now_s - waited_s, head.now_s, now_s)
        if head.refused:
            self._refuse(vehicle, kind, head.refused)
        # By our clock, and no later than it was: the pull was at the agent after `requested_s`.
        sent_s = max(requested_s + waited_s, newest.ahead.earliest(head.now_s, now_s))
        try:
            self._take(vehicle, kind, newest, head, payload, min(sent_s, now_s))
        except wire.Malformed as why:
            await self._not_read(vehicle, kind, why)

    def take_unasked(self, vehicle: str, here: wire.Here) -> None:
        """The state of an announcement, where somebody looks, and how old it is at most is known."""
        newest = self._newest.get((vehicle, "state"))
        if len(here.state) > LARGEST_UNASKED:
            return
        if newest is None or here.run != newest.run or not (base := newest.texts.get(here.base)):
            return
        try:
            head, payload = wire.decode_frame(base64.b64decode(here.state), base)
            now_s = self._now()
            newest.ahead.received(head.now_s, now_s)
            sent_s = newest.ahead.earliest(head.now_s, now_s)
            if head.run == newest.run and sent_s > -math.inf:
                self._take(vehicle, "state", newest, head, payload, min(sent_s, now_s))
        except ValueError as why:  # also of base64
            self._questions.refuse(wire.subject(vehicle, "here"), wire.Malformed(str(why)[:200]))

    def _take(
        self, vehicle: str, kind: str, newest: _Newest, head: wire.FrameHead, payload: str | bytes, sent_s: float
    ) -> None:
        """`sent_s`: no later than it was sent. Raises Malformed."""
        if head.number <= newest.number:
            return
        newest.number = head.number
        if isinstance(payload, str):
            newest.texts.add(head.number, payload)
        likely_later_s = max(0.0, newest.likely.when(head.now_s) - sent_s)
        self._keep(vehicle, kind, payload, sent_s - max(0.0, head.age_s), likely_later_s)

    async def _not_read(self, vehicle: str, kind: str, why: wire.Malformed) -> None:
        self._questions.refuse(wire.subject(vehicle, f"pull.{kind}"), why)
        self._refuse(vehicle, kind, f"The agent of {vehicle} sends what this server cannot read.")
        await asyncio.sleep(RETRY_S)

"""A web node pulls frames from agents: one after the other, and only what somebody looks at."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from nats.errors import Error as NatsError

from server.bus import nats_wire as wire
from server.bus.nats_questions import ANSWER_S, Questions

MOST = 100  # questions a second for one kind of frame, where an agent answers at once
RETRY_S = 0.5  # after a pull that nobody answered
Keep = Callable[[str, str, str | bytes, float], None]
Refuse = Callable[[str, str, str], None]


class Pulls:
    """`keep` gets vehicle, kind, payload, and when it was put by our clock `now`, in seconds: at the latest then.

    It raises Malformed. `refuse` gets vehicle, kind, and why there is no frame, as a sentence.
    """

    def __init__(self, questions: Questions, keep: Keep, refuse: Refuse, *, now: Callable[[], float]) -> None:
        self._questions = questions
        self._keep = keep
        self._refuse = refuse
        self._now = now
        self._tasks: dict[tuple[str, str], asyncio.Task[None]] = {}

    def look(self, vehicle: str, kind: str, is_looked: bool) -> None:
        """Begin or end to pull this kind of frame; nothing where it is so already."""
        key = (vehicle, kind)
        if is_looked and key not in self._tasks:
            self._tasks[key] = asyncio.create_task(self._pull(vehicle, kind))
        elif is_looked and self._tasks[key].done():
            self._tasks[key] = asyncio.create_task(self._pull(vehicle, kind))
        elif not is_looked and key in self._tasks:
            self._tasks.pop(key).cancel()

    def again(self, vehicle: str) -> None:
        """Request its frames anew: what was requested while its agent was silent is lost."""
        for key in [key for key in self._tasks if key[0] == vehicle]:
            self.look(*key, False)
            self.look(*key, True)

    async def stop(self) -> None:
        tasks, self._tasks = self._tasks, {}
        for task in tasks.values():
            task.cancel()
        await asyncio.gather(*tasks.values(), return_exceptions=True)

    async def _pull(self, vehicle: str, kind: str) -> None:
        """One frame after the other: the next is requested when the last is here, so that none waits on the way."""
        have, run = 0, ""
        subject = wire.subject(vehicle, f"pull.{kind}")
        began_s, requests = self._now(), 0  # in the second that began then
        while True:
            if requests >= MOST:
                await asyncio.sleep(max(0.0, began_s + 1.0 - self._now()))
            if self._now() >= began_s + 1.0:
                began_s, requests = self._now(), 0
            requests += 1
            requested_s = self._now()
            if (client := self._questions.client) is None:
                await asyncio.sleep(RETRY_S)
                continue
            try:
                pull = wire.encode(wire.Pull(have=have, run=run, inflates=True))
                message = await client.request(subject, pull, timeout=wire.PULL_WAITS_S + ANSWER_S)
                head, payload = wire.decode_frame(message.data)
            except (NatsError, TimeoutError):
                await asyncio.sleep(RETRY_S)
                continue
            except wire.Malformed as why:
                await self._not_read(vehicle, kind, why)
                continue
            self._questions.set_clock(vehicle, head.run, head.now_s)
            if head.refused:
                self._refuse(vehicle, kind, head.refused)
            if not head.number or (head.number, head.run) == (have, run):
                continue
            have, run = head.number, head.run
            # By our clock, and no later than it was: the pull was at the agent after `requested_s`.
            put_s = min(requested_s + max(0.0, head.waited_s), self._now()) - max(0.0, head.age_s)
            try:
                self._keep(vehicle, kind, payload, put_s)
            except wire.Malformed as why:
                await self._not_read(vehicle, kind, why)

    async def _not_read(self, vehicle: str, kind: str, why: wire.Malformed) -> None:
        self._questions.refuse(wire.subject(vehicle, f"pull.{kind}"), why)
        self._refuse(vehicle, kind, f"The agent of {vehicle} sends what this server cannot read.")
        await asyncio.sleep(RETRY_S)

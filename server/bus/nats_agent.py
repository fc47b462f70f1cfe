"""Offers the vehicles of a local bus to web nodes, through a NATS broker.

The broker only carries: the agent judges, records and numbers its events without one, and nodes ask for what they
missed.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any

from nats.aio.client import Client
from nats.aio.msg import Msg
from nats.aio.subscription import Subscription
from nats.errors import Error as NatsError

from server.bus import nats_wire as wire
from server.bus.bus import NotAdmitted, NotServed
from server.bus.local import LocalBus
from server.bus.nats_agent_frames import FIRST_EVERY_S, Looked, SentFrames, TooLarge
from server.bus.nats_link import processed
from server.system import log_context
from server.system.supervision import Supervisor, cancel

log = logging.getLogger("catgraph.bus")

WANTED_FOR_S = 2.5  # after the last pull a node is taken to look no longer
MOST_PULLS = 256  # that wait at once, of all nodes
MOST_REQUESTS = 64  # requests at once; a flood is refused
Admit = Callable[[str, Mapping[str, Any]], Awaitable[Mapping[str, Any]]]  # of vehicle, message; raises NotAdmitted
Late = Callable[[str, Mapping[str, Any], str], None]  # of vehicle, command, and why it is late, as a sentence
FILTERS = frozenset({"before", "alarm", "change", "since_ms", "until_ms"})


async def as_it_is(vehicle: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
    return message


def unnoted(vehicle: str, command: Mapping[str, Any], why: str) -> None:
    """Nothing."""


class NatsAgent:
    """Answers nodes for the vehicles of `bus`, in this run of it. `now`: a monotonic clock in seconds, as the bus's."""

    def __init__(
        self, bus: LocalBus, *, run: str, now: Callable[[], float], admit: Admit = as_it_is, on_late: Late = unnoted,
        is_limited: bool = False,
    ) -> None:  # fmt: skip
        """`admit` decides who gave a command of a node, and whether it is carried out; `on_late` gets each that came
        too late; `is_limited`: the broker lets it answer only by the connection of the request, as with keys."""
        self._admit = admit
        self._on_late = on_late
        self._is_limited = is_limited
        self.beside: Callable[[], list[Client]] = list  # connections for copies of first states
        self._bus = bus
        self._client: Client | None = None
        self._run = run
        self._now = now
        self._looked: dict[tuple[str, str], Looked] = {}
        self._frames = SentFrames(bus, run, now)
        self._tasks: set[asyncio.Task[None]] = set()
        self._supervisor = Supervisor("agent at the broker")
        self._pulls = self._requests = 0
        self._connection = 0  # how many there were to the broker
        self._published: dict[str, int] = {}  # the number of each vehicle's newest event that was published
        self._stops: list[Callable[[], None]] = []
        self._subscriptions: list[Subscription] = []
        self.refused = 0  # what could not be read or sent, or was too much
        self._too_large = TooLarge()

    def open(self) -> None:
        """Nothing: an agent does without a broker."""

    def close(self) -> None:
        """Nothing."""

    async def start(self, client: Client) -> None:
        """From now on nodes are answered by this client, until `stop`."""
        for vehicle in [one for one in self._bus.vehicles if one not in self._published]:
            self._published[vehicle] = self._bus.last_event(vehicle)
            self._stops.append(self._bus.watch_events(vehicle, lambda name: self._spawn(self._publish_events(name))))
        if not self._supervisor.keeps("announcements"):
            self._supervisor.keep("announcements", self._be_here)
        self._client = client
        self._connection += 1
        self._subscriptions.clear()  # of the client before
        for vehicle in self._published:
            for what, answer in (("pull.*", self._on_pull), ("ask", self._on_ask)):
                self._subscriptions.append(await client.subscribe(wire.subject(vehicle, what), cb=answer))
        # In one packet with the subscriptions: the broker has them before a node can answer this.
        await self._announce(self._published)
        self._spawn(self._send_first_states(client))

    async def stop(self) -> None:
        with contextlib.suppress(NatsError, TimeoutError):  # without a broker nothing is routed to it
            for subscription in self._subscriptions:
                await subscription.unsubscribe()
            if self._client is not None:
                await processed(self._client, within_s=1)  # from now on no request arrives
        self._subscriptions.clear()
        self._published.clear()
        while self._stops:
            self._stops.pop()()
        self._client = None
        await self._supervisor.stop()
        self._supervisor = Supervisor("agent at the broker")
        await cancel(self._tasks)
        for looked in self._looked.values():
            looked.close()
        self._looked.clear()

    def _spawn(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # -- frames --------------------------------------------------------------------------------------------------------

    async def _on_pull(self, message: Msg) -> None:
        kind = message.subject.rsplit(".", 1)[1]
        try:
            pull = wire.decode(wire.Pull, message.data)
        except wire.Malformed:
            self.refused += 1
            return
        if kind not in wire.KINDS or self._pulls >= MOST_PULLS:
            self.refused += 1
            return
        vehicle = wire.vehicle_of(message.subject)
        self._frames.note_pull(vehicle, kind, pull)
        self._spawn(self._answer_pull(message, vehicle, kind, pull))

    async def _answer_pull(self, message: Msg, vehicle: str, kind: str, pull: wire.Pull) -> None:
        came_s = self._now()
        looked = self._look(vehicle, kind)
        reader = message.reply.rpartition(".")[0] if kind == "state" else ""
        self._pulls += 1
        try:
            frame = await looked.after(pull.have if pull.run == self._run else 0, wire.PULL_WAITS_S, reader)
        finally:
            self._pulls -= 1
        data = self._frames.encoded(came_s, frame)
        if len(data) > self._largest:
            refused = self._note_too_large(f"{kind} frame", vehicle, len(data))
            await asyncio.sleep(wire.PULL_WAITS_S)  # it would be requested again at once
            data, frame = self._frames.encoded(came_s, None, refused), None
        if pull.inflates:
            data = self._frames.compressed(vehicle, kind, data, frame, pull)
        await self._respond(message, data)

    def _look(self, vehicle: str, kind: str) -> Looked:
        if (looked := self._looked.get((vehicle, kind))) is None:
            looked = self._looked[vehicle, kind] = Looked(self._bus, vehicle, kind)
        looked.until_s = self._now() + wire.PULL_WAITS_S + WANTED_FOR_S
        return looked

    async def _send_first_states(self, client: Client) -> None:
        """With announcements, a round trip before a pull brings one; by others as well, for lost packets."""
        for vehicle in self._frames.begin_first():
            self._look(vehicle, "state")  # else none is made
        copies = itertools.cycle([(one,) for one in self.beside()] or [()])
        while self._client is client and client.is_connected and (due := self._frames.first_due):
            await self._announce(due, *next(copies), is_first=True)
            await asyncio.sleep(FIRST_EVERY_S)

    # -- events --------------------------------------------------------------------------------------------------------

    async def _publish_events(self, vehicle: str) -> None:
        """Publishes the events that pages may have since the last time; nodes request those that were lost."""
        while (n := self._published[vehicle]) < self._bus.last_event(vehicle):
            events = await self._bus.events_after(vehicle, n, wire.PORTION)
            if not events or self._published[vehicle] != n:  # another task was faster
                return
            events = wire.fitting(events, self._largest)
            self._published[vehicle] = events[-1]["n"]
            await self._publish(vehicle, "events", wire.Events(run=self._run, events=events))

    async def _announce(self, vehicles: Iterable[str], *also_by: Client, is_first: bool = False) -> None:
        for vehicle in [*vehicles]:
            here = self._frames.announcement(vehicle, self._connection, is_first=is_first)
            await self._publish(vehicle, "here", here)
            copy = here.model_copy(update={"is_copy": True})
            for client in also_by:
                with contextlib.suppress(Exception):  # whatever it was: it came by ours
                    await client.publish(wire.subject(vehicle, "here"), wire.encode(copy))

    async def _be_here(self) -> None:
        while True:
            await asyncio.sleep(wire.HERE_EVERY_S)
            await self._announce(self._published)
            now_s = self._now()
            for key in [key for key, looked in self._looked.items() if looked.until_s < now_s]:
                self._looked.pop(key).close()

    # -- requests ------------------------------------------------------------------------------------------------------

    async def _on_ask(self, message: Msg) -> None:
        try:
            ask = wire.decode(wire.Ask, message.data)
        except wire.Malformed as why:
            self.refused += 1
            log.warning("request not read: subject=%s why=%s", message.subject, why)
            return
        if self._requests >= MOST_REQUESTS:
            self.refused += 1
            return
        vehicle = wire.vehicle_of(message.subject)
        trace = (message.headers or {}).get(wire.TRACE)
        with contextlib.nullcontext() if trace is None else log_context.tracing(trace):
            self._spawn(self._answer(message, vehicle, ask))

    async def _answer(self, message: Msg, vehicle: str, ask: wire.Ask) -> None:
        self._requests += 1
        found: dict[str, Any] = {}
        try:
            if ask.do == "command":
                found["answer"] = dict(await self._command(vehicle, ask))
            elif ask.do == "after":
                found["events"] = await self._bus.events_after(vehicle, ask.n, ask.limit, is_whole=True)
            elif ask.do == "find":
                filters = {name: value for name, value in ask.filters.items() if name in FILTERS}
                found["events"] = await self._bus.find_events(vehicle, **filters, limit=ask.limit)
            elif ask.do == "resume":
                resumed = await self._bus.resume(vehicle, ask.run, ask.n)
                found["resumed"] = [resumed.common, resumed.after, resumed.new_after]
        except NotServed as why:
            found["refused"], found["is_unknown"] = str(why), why.outcome == "unknown"
        finally:
            self._requests -= 1
        if events := found.get("events"):
            found["events"] = wire.fitting(events, self._largest)
            found["is_cut"] = len(found["events"]) < len(events)
        body = wire.Answer(run=self._run, now_s=self._now(), last=self._bus.last_event(vehicle), **found)
        data = wire.encode(body)
        if len(data) > self._largest:
            self._note_too_large(f"answer to {ask.do}", vehicle, len(data))
            refusal = f"the answer of {vehicle} is too large for the broker ({len(data) // 1000} kB)"
            is_unknown = ask.do == "command"
            body = wire.Answer(run=body.run, now_s=body.now_s, last=body.last, refused=refusal, is_unknown=is_unknown)
            data = wire.encode(body)
        await self._respond(message, data)

    @property
    def _largest(self) -> int:
        """Bytes of the largest body that the broker takes."""
        return wire.LARGEST if self._client is None else wire.largest(self._client.max_payload)

    @property
    def unsent(self) -> str | None:
        """What of late was too large for the broker, in sentences; None: nothing."""
        return self._too_large.text(self._now())

    def _note_too_large(self, what: str, vehicle: str, size: int) -> str:
        """A sentence on it."""
        self.refused += 1
        return self._too_large.note(what, vehicle, size, self._largest, self._now())

    async def _command(self, vehicle: str, ask: wire.Ask) -> Any:
        """Raises NotServed, also for a command that came too late or was meant for an earlier run."""
        if ask.run != self._run:
            self._on_late(vehicle, ask.command, "it was given before this agent was started.")
            raise NotServed(f"{vehicle} has started again since the command was given")
        self._check_time(vehicle, ask)
        try:
            command = await self._admit(vehicle, ask.command)
        except NotAdmitted as why:
            log.warning("command_not_admitted vehicle=%s why=%s", vehicle, why)
            return {"ok": False, "reason": str(why)}
        self._check_time(vehicle, ask)
        until_s = ask.not_after_s if ask.answered_by_s is None else ask.answered_by_s
        return await self._bus.request(vehicle, command, deadline_s=until_s - self._now())

    def _check_time(self, vehicle: str, ask: wire.Ask) -> None:
        """Raises NotServed: the command may not be carried out any more."""
        if (late_s := self._now() - ask.not_after_s) >= 0:
            log.warning("command_too_late vehicle=%s kind=%s", vehicle, ask.command.get("kind"))
            self._on_late(vehicle, ask.command, f"it came through a web node {late_s:.1f} s after its deadline.")
            raise NotServed(f"the command reached {vehicle} too late and was not carried out")

    async def _publish(self, vehicle: str, what: str, body: wire.Body) -> None:
        with contextlib.suppress(NatsError):
            if self._client is not None and self._client.is_connected:  # else it would wait in the client and come late
                await self._client.publish(wire.subject(vehicle, what), wire.encode(body))

    async def _respond(self, message: Msg, data: bytes) -> None:
        with contextlib.suppress(NatsError):
            if self._client is not None and self._client.is_connected and message.reply:
                if self._is_limited:  # by another one it would be refused, which is reported as a missing right
                    return await message.respond(data)
                await self._client.publish(message.reply, data)

"""Carries out what one page orders: commands to the car's session, and orders to the page's own replay."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Collection, Mapping
from typing import Any

from server.access.identity import Principal
from server.access.people import NOBODY, People
from server.bus.bus import NotServed, PageBus
from server.protocol import commands, messages, page_messages
from server.protocol.rate_limit import Allowance, Limits
from server.replay.manager import NoReplay
from server.replay.view_source import ViewSource
from server.system import log_context
from server.web.page_orders import REPORTS, PageOrders
from server.web.page_sender import PageSender

log = logging.getLogger("catgraph.web")

TOO_MANY = "Too many commands at once from this page: wait a second."
NOT_A_VIEWERS = "This device is paired as a viewer and cannot make changes."
NO_HELLO = "Not carried out: this page has not sent its hello yet."
NOT_FROM_A_REPLAY = "This page shows a replay and cannot send commands. Return to live first."
SLOW_REPLAY = "The replay takes too long to answer earlier requests: try again."
SENT_BY_ITSELF = frozenset({"outcome", "position"})
ANSWERED_WITHIN_S = 3.0  # a session carries out what reaches it until then


async def passed_on(
    bus: PageBus, vehicle: str, message: Mapping[str, Any], *, fleet: bool = False, waited_s: float = 0.0
) -> Mapping[str, Any]:
    """The answer of the vehicle's session to a command of a page, under the command's id in all logs.

    `waited_s`: how long ago it came. What is late by that is not carried out, and is in the log of the car.
    """
    kind, ago_s = message.get("kind"), message.get("pressed_ago_s", 0.0)
    if kind in commands.COMES_WITHIN_S and "heard_ms" not in message and isinstance(ago_s, int | float):
        message = {**message, "pressed_ago_s": ago_s + waited_s}
    with log_context.tracing(message.get("id")):
        within_s = commands.comes_within_s(message)
        left_s = (ANSWERED_WITHIN_S if within_s is None else within_s) - waited_s
        try:
            answer = await bus.request(vehicle, message, deadline_s=ANSWERED_WITHIN_S, comes_within_s=left_s)
        except NotServed as why:
            answer = messages.not_served(why, bus.trouble(vehicle) if fleet else None)
        if bus.grows:  # else the session has logged it
            logged = (vehicle, message.get("kind"), message.get("by"), answer.get("ok"), answer.get("reason", ""))
            log.info("command_passed_on vehicle=%s kind=%s by=%s ok=%s reason=%s", *logged)
        return answer


def lane_of(kind: object) -> str:
    """What slows or releases the car waits for no other command, and no command for what a page sends by itself."""
    if not isinstance(kind, str) or kind not in commands.SLOW_DOWN | SENT_BY_ITSELF:
        return ""
    return "slow-down" if kind in commands.SLOW_DOWN else REPORTS


class CommandsOfPage:
    """What a page of one car and a page of all cars have in common: who sends its commands, and how it leaves.

    `send` queues a reply; `complain` counts a message that is invalid, and answers why. `add` and `present` only note
    what the page sent: `run` carries it out.
    """

    def __init__(
        self,
        bus: PageBus,
        principal: Principal,
        limits: Limits,
        *,
        now: Callable[[], float],
        send: Callable[[messages.ToPage], None],
        complain: Callable[[str], None],
        people: People = NOBODY,
    ) -> None:
        self._bus = bus
        self._now = now
        self._send = send
        self._complain = complain
        self._sender = PageSender(principal, people, signs=bus.grows)
        self._allowed = Allowance(limits.commands, now())
        self._orders = PageOrders(now, self.carry_out, self.pass_on)
        self._announcements = Announcements(bus)

    @property
    def sender(self) -> PageSender:
        return self._sender

    def begin(self, message: Mapping[str, Any]) -> None:
        """The page's hello."""
        self._sender.begin(message)
        self.send_duty()

    def send_duty(self) -> None:
        """Send the page who is on duty, after its hello."""
        if self._sender.has_begun:
            self._send(self._sender.duty)

    @property
    def are_unfinished(self) -> bool:
        """Whether a command waits or is being carried out."""
        return self._orders.are_unfinished

    async def run(self) -> None:
        """Carries out the page's commands and passes on its statuses, without end."""
        await self._orders.run()

    async def add(self, message: dict[str, Any]) -> None:
        """Have a command carried out after those before it in its lane."""
        await self._orders.add(message, lane_of(message.get("kind")))

    async def carry_out(self, message: dict[str, Any], waited_s: float = 0.0) -> None:
        """Carry out a command that came `waited_s` ago, and reply."""
        raise NotImplementedError

    def present(self, message: Mapping[str, Any]) -> None:
        """The page's status, once a second: without a reply, not of a viewer's page, and not before its hello: it would
        be counted under another id."""
        if not self._sender.is_operator or not self._sender.has_begun:
            return
        self._sender.note_key(message)
        try:
            commands.read(message)  # also where the page's own car is not served, and nobody else reads it
        except commands.NotUnderstood as why:
            self._complain(str(why))
            return
        self._orders.add_status(message)

    async def pass_on(self, status: Mapping[str, Any]) -> None:
        """Pass on the page's status."""
        raise NotImplementedError

    async def leave(self) -> None:
        """The page is closed: it is not counted on to announce alarms any more."""
        await self._orders.finished()
        await self._announcements.forwarded()
        self.present(LEAVES)
        await self._orders.finished()
        await self._announcements.forwarded()

    async def finished(self) -> None:
        """Wait until all that the page sent was carried out."""
        await self._orders.finished()

    async def close(self) -> None:
        """End what is being forwarded to other cars."""
        await self._announcements.close()

    def _id_of(self, message: Mapping[str, Any]) -> str | None:
        id = message.get("id")
        if isinstance(id, str) and len(id) <= 80:
            return id
        self._complain("A command needs an id of at most 80 characters.")
        return None


class PageCommands(CommandsOfPage):
    """Of a page of one car."""

    def __init__(
        self,
        bus: PageBus,
        vehicle: str,
        view: ViewSource,
        principal: Principal,
        limits: Limits,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        send: Callable[[messages.ToPage], None],
        complain: Callable[[str], None],
        people: People = NOBODY,
    ) -> None:
        super().__init__(bus, principal, limits, now=now, send=send, complain=complain, people=people)
        self._vehicle = vehicle
        self._view = view
        self._wall_ms = wall_ms
        self._slow_downs = Allowance(limits.slow_down, now())
        self._opening: asyncio.Task[None] | None = None

    async def carry_out(self, message: dict[str, Any], waited_s: float = 0.0) -> None:
        """Have the session carry out a command, or the page's own replay, and reply."""
        if message.get("kind") == "replay":
            await self.replay(message, waited_s)
        else:
            await self.command(message, waited_s)

    async def command(self, message: dict[str, Any], waited_s: float = 0.0) -> None:
        """Have the session carry out a command that came `waited_s` ago, and reply."""
        id = self._id_of(message)
        if id is None:
            return
        kind = message.get("kind")
        reason = self._refusal(kind)
        if reason is None and self._bus.grows and "signed" not in message:  # else the session looks at it
            reason = commands.too_late(message, self._wall_ms())
        if reason is not None:
            self._send(messages.refusal(id, reason))
            return
        answer = await passed_on(self._bus, self._vehicle, message | self._who, waited_s=waited_s)
        self._send(messages.reply(id, await self._sender.end_handed_over(kind, answer)))

    def _refusal(self, kind: object) -> str | None:
        """Why a command does not reach the session; None: it does."""
        if not self._sender.is_operator:  # whatever it is: no command of the union needs less than an operator
            return NOT_A_VIEWERS
        if not self._sender.has_begun:  # it would be stored under an id that the page never queries
            return NO_HELLO
        command = commands.BY_KIND.get(kind) if isinstance(kind, str) else None
        if command is None:  # commands of the server to a session are not allowed for a page
            return commands.NO_SUCH
        allowance = self._slow_downs if kind in commands.SLOW_DOWN else self._allowed
        if not allowance.takes(self._now()):
            return TOO_MANY
        if self._view.is_replaying and not command.passes_replay:
            return NOT_FROM_A_REPLAY
        return None

    async def pass_on(self, status: Mapping[str, Any]) -> None:
        """Pass on the page's status to its car, and to those that it announces."""
        answer: Mapping[str, Any] = {"ok": True}
        with contextlib.suppress(NotServed):  # the other cars may be served
            answer = await self._bus.request(self._vehicle, {**status, **self._who})
        if answer.get("ok") is not True:
            self._complain(str(answer.get("reason")))
            return
        named = () if status.get("leaves") else status.get("announces", ())
        cars = set(self._bus.vehicles).intersection(named) - {self._vehicle}
        self._announcements.forward(status, self._who, cars)

    async def replay(self, message: Mapping[str, Any], waited_s: float = 0.0) -> None:
        """Have the page's own replay carry out an order that came `waited_s` ago, and reply."""
        id = self._id_of(message)
        if id is None:
            return
        if waited_s > ANSWERED_WITHIN_S:
            self._send(messages.refusal(id, SLOW_REPLAY))
            return
        if not self._allowed.takes(self._now()):
            self._send(messages.refusal(id, TOO_MANY))
            return
        try:
            order = page_messages.read_replay_order(message)
        except commands.NotUnderstood as why:
            self._send(messages.refusal(id, str(why)))
            return
        match order:
            case page_messages.OpenReplay() | page_messages.OpenBeside() if self._is_opening:
                self._send(messages.refusal(id, "A recording is already being opened."))
            case page_messages.OpenReplay() | page_messages.OpenBeside():
                self.open_replay(order, id)
            case page_messages.CloseBeside():
                await self._view.close_beside()
                self._send(messages.reply(id, {"ok": True}))
            case page_messages.LeaveReplay():
                await self._view.leave()
                self._send(messages.reply(id, {"ok": True}))
            case _:
                self._send(messages.reply(id, await self._view.ask(order)))

    @property
    def _is_opening(self) -> bool:
        return self._opening is not None and not self._opening.done()

    def open_replay(self, order: page_messages.OpenReplay | page_messages.OpenBeside, id: str | None = None) -> None:
        """Open a recording, which takes a second; meanwhile the page continues with live data.

        `id` None: the recording is from the page's address, and only an error is sent.
        """
        self._opening = asyncio.create_task(self._open(id, order), name="open a replay")

    async def _open(self, id: str | None, order: page_messages.OpenReplay | page_messages.OpenBeside) -> None:
        try:
            if isinstance(order, page_messages.OpenBeside):
                await self._view.open_beside(order)
            else:
                await self._view.open(order)
            if id is not None:
                self._send(messages.reply(id, {"ok": True}))
        except NoReplay as why:
            self._send(messages.replay_ended(str(why)) if id is None else messages.refusal(id, str(why)))

    async def close(self) -> None:
        """End what is being opened, or forwarded to other cars."""
        if self._opening is not None:
            self._opening.cancel()
            await asyncio.gather(self._opening, return_exceptions=True)
        await super().close()

    @property
    def _who(self) -> dict[str, Any]:
        return self._sender.as_json(is_replaying=self._view.is_replaying)


LEAVES = {"kind": "present", "visible": False, "sound": "asks", "awake": "asks", "leaves": True}
FORWARD_WITHIN_S = 1.0  # to another car whose alarms this page announces
AT_ONCE = 8  # cars; between them others on the loop have their turn


class Announcements:
    """What one page that announces the alarms of other cars reports to their sessions."""

    def __init__(self, bus: PageBus) -> None:
        self._bus = bus
        self._announced: set[str] = set()  # cars whose alarms it announces
        self._forwarding: asyncio.Task[None] | None = None

    def forward(self, status: Mapping[str, Any], sender: Mapping[str, Any], cars: Collection[str]) -> None:
        """Pass a page's status on to the cars whose alarms it announces, and once to those that it did.

        Meanwhile the page is served: another car may be lost.
        """
        if self._forwarding is not None and not self._forwarding.done():
            return  # the page states it every second
        now = set(cars)
        before, self._announced = self._announced, now
        statuses = {
            vehicle: {**status, "kind": "announces", "leaves": vehicle not in now, **sender} for vehicle in now | before
        }
        if statuses:
            self._forwarding = asyncio.create_task(self._forward_all(statuses), name="announce")

    async def _forward_all(self, statuses: Mapping[str, Mapping[str, Any]]) -> None:
        async def forward_to(vehicle: str, status: Mapping[str, Any]) -> None:
            with contextlib.suppress(NotServed):
                await self._bus.request(vehicle, status, deadline_s=FORWARD_WITHIN_S)

        async with asyncio.TaskGroup() as group:
            for number, (vehicle, status) in enumerate(statuses.items(), 1):
                group.create_task(forward_to(vehicle, status))
                if number % AT_ONCE == 0:
                    await asyncio.sleep(0)

    async def forwarded(self) -> None:
        """Wait until it was passed on."""
        if self._forwarding is not None:
            await asyncio.gather(self._forwarding, return_exceptions=True)

    async def close(self) -> None:
        """End what is being passed on."""
        if self._forwarding is not None:
            self._forwarding.cancel()
            await self.forwarded()

"""Carries out what one page orders: commands to the car's session, and orders to the page's own replay."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Mapping
from typing import Any

from server.access.identity import Principal
from server.access.people import NOBODY, People
from server.bus.bus import NotServed, PageBus
from server.protocol import commands, messages, replay_commands
from server.protocol.rate_limit import Allowance, Limits
from server.replay.manager import NoReplay
from server.replay.view_source import ViewSource
from server.system import log_context
from server.web.announcements import LEAVES, Announcements
from server.web.page_sender import PageSender

log = logging.getLogger("catgraph.web")

TOO_MANY = "Too many commands at once from this page: wait a second."
NOT_A_VIEWERS = "This device is paired as a viewer and cannot make changes."
NO_HELLO = "Not carried out: this page has not sent its hello yet."
NOT_FROM_A_REPLAY = "This page shows a replay and cannot send commands. Return to live first."


async def passed_on(
    bus: PageBus, vehicle: str, message: Mapping[str, Any], *, fleet: bool = False
) -> Mapping[str, Any]:
    """The answer of the vehicle's session to a command of a page, under the command's id in all logs."""
    with log_context.tracing(message.get("id")):
        try:
            answer = await bus.request(vehicle, message, comes_within_s=commands.comes_within_s(message))
        except NotServed as why:
            answer = messages.not_served(why, bus.trouble(vehicle) if fleet else None)
        if bus.grows:  # else the session has logged it
            logged = (vehicle, message.get("kind"), message.get("by"), answer.get("ok"), answer.get("reason", ""))
            log.info("command_passed_on vehicle=%s kind=%s by=%s ok=%s reason=%s", *logged)
        return answer


class PageCommands:
    """Of one page. `send` queues a reply; `complain` counts a message that is invalid, and answers why."""

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
        self._bus = bus
        self._vehicle = vehicle
        self._view = view
        self._sender = PageSender(principal, people, signs=bus.grows)
        self._now = now
        self._wall_ms = wall_ms
        self._send = send
        self._complain = complain
        self._orders = Allowance(limits.commands, now())
        self._slow_downs = Allowance(limits.slow_down, now())
        self._opening: asyncio.Task[None] | None = None
        self._announcements = Announcements(bus)  # to other cars

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

    async def command(self, message: dict[str, Any]) -> None:
        """Has the session carry out a command, and messages."""
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
        answer = await passed_on(self._bus, self._vehicle, message | self._who)
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
        allowance = self._slow_downs if kind in commands.SLOW_DOWN else self._orders
        if not allowance.takes(self._now()):
            return TOO_MANY
        if self._view.is_replaying and not command.passes_replay:
            return NOT_FROM_A_REPLAY
        return None

    async def present(self, message: Mapping[str, Any]) -> None:
        """Pass on the page's status, once a second: without a reply, not of a viewer's page, and not before its hello:
        it would be counted under another id."""
        if not self._sender.is_operator or not self._sender.has_begun:
            return
        self._sender.note_key(message)
        try:
            commands.read(message)  # also where the page's own car is not served, and nobody else reads it
        except commands.NotUnderstood as why:
            self._complain(str(why))
            return
        answer: Mapping[str, Any] = {"ok": True}
        with contextlib.suppress(NotServed):  # the other cars may be served
            answer = await self._bus.request(self._vehicle, {**message, **self._who})
        if answer.get("ok") is not True:
            self._complain(str(answer.get("reason")))
            return
        named = () if message.get("leaves") else message.get("announces", ())
        cars = set(self._bus.vehicles).intersection(named) - {self._vehicle}
        self._announcements.forward(message, self._who, cars)

    async def leave(self) -> None:
        """The page is closed: it is not counted on to show alarms any more."""
        await self._announcements.forwarded()
        await self.present(LEAVES)
        await self._announcements.forwarded()

    async def replay(self, message: Mapping[str, Any]) -> None:
        """Has the page's own replay carry out an order, and messages."""
        id = self._id_of(message)
        if id is None:
            return
        if not self._orders.takes(self._now()):
            self._send(messages.refusal(id, TOO_MANY))
            return
        try:
            order = replay_commands.read(message)
        except replay_commands.NotUnderstood as why:
            self._send(messages.refusal(id, str(why)))
            return
        match order:
            case replay_commands.OpenReplay() | replay_commands.OpenBeside() if self._is_opening:
                self._send(messages.refusal(id, "A recording is already being opened."))
            case replay_commands.OpenReplay() | replay_commands.OpenBeside():
                self.open_replay(order, id)
            case replay_commands.CloseBeside():
                await self._view.close_beside()
                self._send(messages.reply(id, {"ok": True}))
            case replay_commands.LeaveReplay():
                await self._view.leave()
                self._send(messages.reply(id, {"ok": True}))
            case _:
                self._send(messages.reply(id, await self._view.ask(order)))

    @property
    def _is_opening(self) -> bool:
        return self._opening is not None and not self._opening.done()

    def open_replay(
        self, order: replay_commands.OpenReplay | replay_commands.OpenBeside, id: str | None = None
    ) -> None:
        """Open a recording, which takes a second; meanwhile the page continues with live data.

        `id` None: the recording is from the page's address, and only an error is sent.
        """
        self._opening = asyncio.create_task(self._open(id, order), name="open a replay")

    async def _open(self, id: str | None, order: replay_commands.OpenReplay | replay_commands.OpenBeside) -> None:
        try:
            if isinstance(order, replay_commands.OpenBeside):
                await self._view.open_beside(order)
            else:
                await self._view.open(order)
            if id is not None:
                self._send(messages.reply(id, {"ok": True}))
        except NoReplay as why:
            self._send(messages.replay_ended(str(why)) if id is None else messages.refusal(id, str(why)))

    async def close(self) -> None:
        """Ends what is being opened, or forwarded to other cars."""
        if self._opening is not None:
            self._opening.cancel()
            await asyncio.gather(self._opening, return_exceptions=True)
        await self._announcements.close()

    @property
    def _who(self) -> dict[str, Any]:
        return self._sender.as_json(is_replaying=self._view.is_replaying)

    def _id_of(self, message: Mapping[str, Any]) -> str | None:
        id = message.get("id")
        if isinstance(id, str) and len(id) <= 80:
            return id
        self._complain("A command needs an id of at most 80 characters.")
        return None

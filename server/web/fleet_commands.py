"""Carries out what a page of all cars orders: each command is sent to the session of the car that it names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from server.access.identity import Principal
from server.access.people import NOBODY, People
from server.bus.bus import PageBus
from server.control import display_name
from server.protocol import commands, messages
from server.protocol.rate_limit import Allowance, Limits
from server.web.announcements import LEAVES, Announcements
from server.web.page_commands import NO_HELLO, NOT_A_VIEWERS, TOO_MANY, passed_on
from server.web.page_sender import PageSender

NOT_FROM_HERE = "Open the car's own page for this."
UNNAMED = "Name the car that is meant."
PAGE_ONLY = {"announces", "id", "kind"}  # of a status: not for the cars


class FleetCommands:
    """Of one page. `send` queues a reply; `complain` counts a message that is invalid, and answers why."""

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
        self._orders = Allowance(limits.commands, now())
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

    async def command(self, message: dict[str, Any]) -> None:
        """Has the session of the car carry out a command, and answers."""
        id = message.get("id")
        if not isinstance(id, str) or len(id) > 80:
            self._complain("A command needs an id of at most 80 characters.")
            return
        vehicle = message.get("vehicle")
        reason = self._refusal(message.get("kind"), vehicle)
        if reason is not None or not isinstance(vehicle, str):
            self._send(messages.refusal(id, reason or UNNAMED))
            return
        order = message | self._sender.as_json()
        self._send(messages.reply(id, await passed_on(self._bus, vehicle, order, fleet=True)))

    def _refusal(self, kind: object, vehicle: object) -> str | None:
        """Why a command does not reach a session; None: it does."""
        if not self._sender.is_operator:
            return NOT_A_VIEWERS
        if not self._sender.has_begun:
            return NO_HELLO
        command = commands.BY_KIND.get(kind) if isinstance(kind, str) else None
        if command is None:
            return commands.NO_SUCH
        if not self._orders.takes(self._now()):
            return TOO_MANY
        if not command.from_fleet:
            return NOT_FROM_HERE
        if not isinstance(vehicle, str) or not vehicle:
            return UNNAMED
        if vehicle not in self._bus.vehicles:
            return f"No car is named {display_name.clean(vehicle)}."
        return None

    async def present(self, message: Mapping[str, Any]) -> None:
        """Pass on the page's status, once a second, to every car: without a reply, not of a viewer's page, and not
        before its hello: it would be counted under another id."""
        if not self._sender.is_operator or not self._sender.has_begun:
            return
        self._sender.note_key(message)
        try:
            command = commands.read(message)
        except commands.NotUnderstood as why:
            self._complain(str(why))
            return
        status = command.model_dump(exclude=PAGE_ONLY)
        self._announcements.forward(status, self._sender.as_json(), () if status["leaves"] else self._bus.vehicles)

    async def leave(self) -> None:
        """The page is closed: it is not counted on to announce alarms any more."""
        await self._announcements.forwarded()
        await self.present(LEAVES)
        await self._announcements.forwarded()

    async def close(self) -> None:
        await self._announcements.close()

"""Carries out what one page orders: commands to the car's session, and orders to the page's own replay."""

from __future__ import annotations

import asyncio
import re
import secrets
from collections.abc import Callable, Mapping
from typing import Any

from server.access.identity import LOCAL, Principal
from server.bus.bus import LocalBus, NotServed
from server.control import display_name
from server.protocol import commands, replies
from server.protocol.rate_limit import SLOW_DOWN, Allowance, Limits
from server.replay import commands as replay_commands
from server.replay.manager import NoReplay
from server.replay.view_source import ViewSource

# Where the phone is, the live monitor must know whatever its page shows; and a page that is asked for control answers.
FROM_A_REPLAY = ("position", "control", "veto")
LEAVES = {"kind": "present", "visible": False, "sound": "asks", "awake": "asks", "leaves": True}
TOO_MANY = "Too many orders at once from this page: wait a second."
NOT_A_VIEWERS = "This device is paired as a viewer: it looks, and changes nothing."
NOT_FROM_A_REPLAY = "This page replays a recording: nothing is ordered from it. Go back to live first."


class PageCommands:
    """Of one page. `send` queues a reply; `complain` counts a message that makes no sense, and answers why."""

    def __init__(
        self,
        bus: LocalBus,
        vehicle: str,
        view: ViewSource,
        principal: Principal,
        limits: Limits,
        *,
        now: Callable[[], float],
        send: Callable[[replies.ToPage], None],
        complain: Callable[[str], None],
    ) -> None:
        self._bus = bus
        self._vehicle = vehicle
        self._view = view
        self._principal = principal
        self._now = now
        self._send = send
        self._complain = complain
        self._orders = Allowance(limits.commands, now())
        self._slow_downs = Allowance(limits.slow_down, now())
        self._opening: asyncio.Task[None] | None = None
        self._has_begun = False
        self._is_counted = False  # as a page that may show and sound alarms
        self._name = display_name.NAMELESS  # which the page gave itself: who gave its orders, in the log
        self._page = secrets.token_hex(8)  # by which the page keeps control over a reload

    async def begin(self, message: Mapping[str, Any]) -> None:
        """The page's hello: its name, and the id that it keeps over a reload, of which only the first counts."""
        page = message.get("page")
        if isinstance(page, str) and re.fullmatch(commands.PAGE, page) and not self._has_begun:
            if self._is_counted:
                await self.leave()  # it was counted under the id of before, which nobody uses any more
            self._page = page
        self._name = display_name.clean(message.get("name")) or self._name
        self._has_begun = True

    async def command(self, message: dict[str, Any]) -> None:
        """Has the session carry out a command, and replies."""
        id = self._id_of(message)
        if id is None:
            return
        kind = message.get("kind")
        reason = self._refusal(kind)
        if reason is not None:
            self._send(replies.refusal(id, reason))
            return
        try:
            answer = await self._bus.request(self._vehicle, message | self._sender)
        except NotServed as why:
            answer = {"ok": False, "reason": f"{str(why).capitalize()}."}
        self._send(replies.reply(id, answer))

    def _refusal(self, kind: object) -> str | None:
        """Why a command does not reach the session; None: it does."""
        if not self._principal.is_operator:  # whatever it is: no command of the union needs less than an operator
            return NOT_A_VIEWERS
        if not isinstance(kind, str) or kind not in commands.KINDS:  # what the server asks of a session is not a page's
            return commands.NO_SUCH
        allowance = self._slow_downs if kind in SLOW_DOWN else self._orders
        if not allowance.takes(self._now()):
            return TOO_MANY
        if self._view.is_replaying and kind not in FROM_A_REPLAY:
            return NOT_FROM_A_REPLAY
        return None

    async def present(self, message: Mapping[str, Any]) -> None:
        """Passes on, once a second, whether the page is seen and heard: without a reply, and not of a viewer's page."""
        if not self._principal.is_operator:
            return
        self._is_counted = True
        try:
            answer = await self._bus.request(self._vehicle, {**message, **self._sender})
        except NotServed:
            return
        if answer.get("ok") is not True:
            self._complain(str(answer.get("reason")))

    async def leave(self) -> None:
        """The page is closed: it is not counted on to show alarms any more."""
        await self.present(LEAVES)

    async def replay(self, message: Mapping[str, Any]) -> None:
        """Has the page's own replay carry out an order, and replies."""
        id = self._id_of(message)
        if id is None:
            return
        if not self._orders.takes(self._now()):
            self._send(replies.refusal(id, TOO_MANY))
            return
        try:
            order = replay_commands.read({name: value for name, value in message.items() if name not in ("id", "kind")})
        except replay_commands.NotUnderstood as why:
            self._send(replies.refusal(id, str(why)))
            return
        match order:
            case replay_commands.Open() if self._opening is not None and not self._opening.done():
                self._send(replies.refusal(id, "A recording is being opened already."))
            case replay_commands.Open():
                self.open_replay(order, id)
            case replay_commands.Leave():
                await self._view.leave()
                self._send(replies.reply(id, {"ok": True}))
            case _:
                self._send(replies.reply(id, await self._view.ask(order)))

    def open_replay(self, order: replay_commands.Open, id: str | None = None) -> None:
        """Opens a recording, which takes a second; meanwhile the page goes on taking what is live.

        `id` None: the page's address names the recording, and only a refusal is sent.
        """
        self._opening = asyncio.create_task(self._open(id, order), name="open a replay")

    async def _open(self, id: str | None, order: replay_commands.Open) -> None:
        try:
            await self._view.open(order)
            if id is not None:
                self._send(replies.reply(id, {"ok": True}))
        except NoReplay as why:
            self._send(replies.replay_ended(str(why)) if id is None else replies.refusal(id, str(why)))

    async def close(self) -> None:
        """Ends what is being opened."""
        if self._opening is not None:
            self._opening.cancel()
            await asyncio.gather(self._opening, return_exceptions=True)

    @property
    def _sender(self) -> dict[str, Any]:
        """Who sends; it replaces whatever the page itself states of that."""
        return {
            "by": self._name if self._principal is LOCAL else self._principal.name,
            "who": self._principal.id,
            "page": self._page,
            "replaying": self._view.is_replaying,
            "console": False,
        }

    def _id_of(self, message: Mapping[str, Any]) -> str | None:
        id = message.get("id")
        if isinstance(id, str) and len(id) <= 80:
            return id
        self._complain("A command carries an id of at most 80 letters.")
        return None

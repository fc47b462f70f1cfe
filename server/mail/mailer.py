"""A server's mail: takes orders, and keeps the two tasks that make and send mails running whatever happens to them."""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from server.mail import address, sender
from server.mail.mail_folder import MailFolder, MailRefused
from server.mail.order import Letter, Order
from server.mail.outbox import OutboxFull, WrongState
from server.mail.prepare import Preparer
from server.mail.sender import Sender
from server.mail.settings import MailSettings, checked
from server.mail.source import Source
from server.mail.under_way import Underway
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.mail")


class Mailer:
    """One server's mail, kept in `folder`."""

    def __init__(
        self,
        folder: Path,
        source: Source,
        *,
        wall_ms: Callable[[], int],
        pause_s: Callable[[int], float] = sender.pause_s,
    ) -> None:
        self.settings = MailSettings()
        self.place = folder
        self._source = source
        self._wall_ms = wall_ms
        self._folder = MailFolder(folder)
        self._sender = Sender(self._folder, lambda: self.settings, wall_ms, pause_s)
        self._preparer = Preparer(self._folder, source, lambda: self.settings, self._sender.look)
        self._supervisor = Supervisor("mail")

    @property
    def trouble(self) -> str | None:
        """Why nothing can be kept or sent now."""
        return self._folder.trouble

    @property
    def complaints(self) -> list[str]:
        """What was found wrong at the start."""
        return self._folder.complaints

    @property
    def making(self) -> Underway | None:
        """The letter whose mails are made now."""
        return self._preparer.under_way

    @property
    def sending(self) -> Underway | None:
        """The mail that is on its way now."""
        return self._sender.under_way

    async def start(self) -> None:
        """Open the outbox and start sending. Disk errors are in `trouble`, never raised."""
        settings = await self._folder.open()
        if settings is None:
            return
        self.settings = settings
        self._supervisor.keep("preparing", partial(self._again, "preparing mail", self._preparer.run))
        self._supervisor.keep("sending", partial(self._again, "sending mail", self._sender.run))

    async def stop(self) -> None:
        """Ends it; what is on its way is sent again at the next start."""
        await self._supervisor.stop()
        await self._folder.close()

    def problems(self) -> list[str]:
        """What is wrong with its tasks, a sentence each."""
        return self._supervisor.problems()

    def look(self) -> None:
        """Something may be due: a clock was moved, or mail was ordered."""
        self._preparer.look()
        self._sender.look()

    # --- what the routes ask for

    def new_key(self) -> str:
        """A name for an order that brings none."""
        return secrets.token_hex(12)

    def share_of(self, letter: Letter) -> float | None:
        """How much of it is made, or sent of the mail that is on its way: 0 to 1; None: neither is going on."""
        if letter.state not in ("queued", "sending"):
            return None  # the connection may still be ending
        for under_way in (self.making, self.sending):
            if under_way is not None and under_way.letter == letter.n:
                return round(under_way.share, 3)
        return None

    async def order(self, key: str, order: Order) -> Letter:
        """Takes an order; it is on the disk when this returns. Raises MailRefused."""
        if not self.settings.is_complete:
            raise MailRefused("Mail is not set up: enter SMTP host and sender in Settings, E-mail.", status=409)
        for one in order.to:
            self._allow(one)
        for recording in order.recordings:
            if await asyncio.to_thread(self._source.path_of, recording) is None:
                raise MailRefused(f"There is no finished recording {recording}.", field="recordings", status=404)
        try:
            letter = await self._folder.ask(lambda outbox: outbox.add(key, order, self._wall_ms()))
        except OutboxFull:
            raise MailRefused("The outbox is full: cancel or resend failed mails.", status=409) from None
        self._preparer.look()
        return letter

    async def letters(self, before: int | None, limit: int) -> list[Letter]:
        return await self._folder.ask(lambda outbox: outbox.letters(before, limit))

    async def letter(self, n: int) -> Letter:
        """Raises MailRefused where there is none."""
        found = await self._folder.ask(lambda outbox: outbox.letter(n))
        if found is None:
            raise _unknown(n)
        return found

    async def cancel(self, n: int) -> Letter:
        """Nothing more of it is sent; a mail that is handed over already is waited for. Raises MailRefused."""
        try:
            await self._folder.ask(lambda outbox: outbox.cancel(n))
        except WrongState as why:
            raise MailRefused(str(why), status=409) from None
        except KeyError:
            raise _unknown(n) from None
        for under_way in (self.making, self.sending):
            if under_way is not None and under_way.letter == n:
                await under_way.break_off()
        return await self.letter(n)

    async def resend(self, n: int) -> Letter:
        """Tries it again now. Raises MailRefused."""
        letter = await self.letter(n)
        for one in letter.order.to:
            self._allow(one)
        try:
            letter = await self._folder.ask(lambda outbox: outbox.resend(n, self.settings.sender, self._wall_ms()))
        except WrongState as why:
            raise MailRefused(str(why), status=409) from None
        self._sender.release()
        self.look()
        return letter

    async def change(self, body: Mapping[str, Any]) -> MailSettings:
        """Takes settings over, once they are on the disk; what waits is tried. Raises BadMailSetting, MailRefused."""
        settings = await asyncio.to_thread(checked, body, self.settings)
        await self._folder.keep(settings)
        self.settings = settings
        self._sender.forget_failures()
        await self._folder.ask(lambda outbox: outbox.queue.try_all_again(settings.sender, self._wall_ms()))
        self.look()
        return settings

    def _allow(self, one: str) -> None:
        if not address.is_allowed(address.parse(one), self.settings.allowed):
            raise MailRefused(f"{one} is not among the allowed recipients.", field="to")

    async def _again(self, what: str, work: Callable[[], Awaitable[None]]) -> None:
        while True:
            try:
                await work()
            except MailRefused as why:  # a disk error, reported in `trouble`
                log.error("%s: %s", what, why)
            except Exception:
                log.exception("task failed, restarting: task=%s", what)
            await asyncio.sleep(sender.AGAIN_S)


def _unknown(n: int) -> MailRefused:
    return MailRefused(f"There is no mail number {n}.", status=404)

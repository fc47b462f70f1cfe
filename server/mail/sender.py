"""Sends the mails of the outbox when they are due, over one connection, and stores the outcome of each attempt."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from functools import partial
from typing import Any

from server.mail import address, attempt, retry_backoff
from server.mail.mail_folder import MailFolder, MailRefused
from server.mail.order import Mail, Outcome
from server.mail.outbox import Outbox
from server.mail.replies import Trouble
from server.mail.settings import MailSettings
from server.mail.smtp_connection import Connection, Envelope, connect
from server.mail.smtp_dial import Account
from server.mail.under_way import Underway, joined

log = logging.getLogger("catgraph.mail")
_LONGEST_MS = round(1000 * retry_backoff.LONGEST_S)


class Sender:
    """Takes mails from the outbox and sends them to the SMTP server."""

    def __init__(
        self,
        folder: MailFolder,
        settings: Callable[[], MailSettings],
        wall_ms: Callable[[], int],
        pause_s: Callable[[int], float],
    ) -> None:
        self.under_way: Underway | None = None
        self._folder = folder
        self._settings = settings
        self._wall_ms = wall_ms
        self._pause_s = pause_s
        self._due = asyncio.Event()
        self._failures = 0  # of the account, one after the other
        self._held: tuple[int, str] | None = None  # no attempt before this time [ms], and why

    def look(self) -> None:
        """Wake up: a mail may be due, because a clock was set or a mail was ordered."""
        self._due.set()

    def release(self) -> None:
        """End a back-off of the account: try the server again at once."""
        self._held = None

    def forget_failures(self) -> None:
        """Reset the back-off for a changed account."""
        self._failures = 0
        self._held = None

    async def run(self) -> None:
        """Sends what is due, until it is cancelled. Raises MailRefused for what the disk does."""
        connection: Connection | None = None
        await self._folder.ask(lambda outbox: outbox.queue.requeue())
        try:
            while True:
                self._due.clear()
                mail = await self._folder.ask(partial(_next_due, now_ms=self._wall_ms()))
                if mail is None:
                    if connection is not None:
                        await connection.close()
                        connection = None
                    await self._wait()
                    continue
                if self._is_held():
                    await self._hold()
                    continue
                connection = await self._send(mail, connection)
        finally:
            if connection is not None:
                connection.drop()

    async def _wait(self) -> None:
        """Wait until a mail is due, or until woken up."""
        earliest = await self._folder.ask(lambda outbox: outbox.queue.earliest_ms())
        timeout = None if earliest is None else max(0.0, (earliest - self._wall_ms()) / 1000)
        if timeout is not None:
            timeout = min(timeout, retry_backoff.LONGEST_S)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(timeout):  # wait_for of Python 3.11 may swallow the end of the task
                await self._due.wait()

    async def _send(self, mail: Mail, connection: Connection | None) -> Connection | None:
        """Make one attempt and store its outcome; return the connection if it can be used again."""
        refused = self._refusal(mail)
        if refused is not None:
            await self._settle(mail, Outcome(state="failed", detail=refused, recipients=mail.recipients))
            return connection
        begun = await self._folder.ask(lambda outbox: outbox.queue.begin(mail.n))
        if begun is None:
            return connection  # it was cancelled
        under_way = Underway(letter=mail.letter, connection=connection)
        under_way.task = asyncio.ensure_future(self._hand_over(begun, under_way))
        self.under_way = under_way
        try:
            return await self._finish(begun, under_way)
        except BaseException:
            if under_way.connection is not None:
                under_way.connection.drop()
            raise
        finally:
            self.under_way = None
            under_way.over.set()

    async def _finish(self, mail: Mail, under_way: Underway) -> Connection | None:
        """Wait for an attempt and store its outcome, even if the server is ended meanwhile."""
        is_ended = False
        try:
            await joined(under_way.task)
        except asyncio.CancelledError:
            is_ended = True
        task, trouble, now_ms = under_way.task, None, self._wall_ms()
        if task.cancelled():
            if is_ended:
                raise asyncio.CancelledError  # it is sent again at the next start
            outcome = Outcome(state="cancelled", detail="", recipients=mail.recipients)
        elif (error := task.exception()) is None:
            answers, of_mail = task.result()
            outcome = attempt.answered(mail, answers, of_mail, now_ms, self._pause_s)
            self._failures = 0
        else:
            trouble = error if isinstance(error, Trouble) else self._fault(mail, error)
            outcome = self._troubled(mail, trouble, under_way, now_ms)
        await asyncio.shield(self._settle(mail, outcome))
        if is_ended:
            raise asyncio.CancelledError
        if trouble is not None and trouble.is_of_account:
            await self._account_refused(trouble, now_ms)
        connection = under_way.connection
        if connection is not None and (trouble is not None or task.cancelled() or not connection.is_open):
            connection.drop()
            return None
        return connection

    def _fault(self, mail: Mail, error: BaseException) -> Trouble:
        """Turn an internal error into a Trouble, so that no mail stays "sending" for ever."""
        log.error("mail not sent: mail=%d", mail.letter, exc_info=error)
        return Trouble(f"Internal server error ({type(error).__name__}); the server's log has the details.")

    def _troubled(self, mail: Mail, trouble: Trouble, under_way: Underway, now_ms: int) -> Outcome:
        is_doubtful = under_way.connection is not None and under_way.connection.is_doubtful
        return attempt.troubled(mail, trouble, is_doubtful=is_doubtful, now_ms=now_ms, pause_s=self._pause_s)

    async def _hand_over(self, mail: Mail, under_way: Underway) -> Any:
        if under_way.connection is None or not under_way.connection.is_open:
            under_way.connection = await connect(Account.of(self._settings()))
        path = self._folder.files / mail.file
        waiting = [one.address for one in mail.recipients if one.state == "waiting"]
        envelope = Envelope(
            sender=self._settings().sender,
            to=waiting,
            file=path,
            size_bytes=mail.size_bytes,
            needs_utf8=not all(
                one.isascii() for one in (self._settings().sender, *(r.address for r in mail.recipients))
            ),
        )

        def on_progress(sent: int) -> None:
            under_way.share = sent / max(1, mail.size_bytes)

        try:
            return await under_way.connection.hand_over(envelope, on_progress)
        except FileNotFoundError:
            raise Trouble("Its file is missing from the outbox: send it again.", is_permanent=True) from None

    def _refusal(self, mail: Mail) -> str | None:
        """Why a mail may not be sent any more; None if it may."""
        if not self._settings().is_complete:
            return "Mail is not set up: enter SMTP host and sender in Settings, E-mail."
        for one in mail.recipients:
            if one.state == "waiting" and not address.is_allowed(address.parse(one.address), self._settings().allowed):
                return f"{one.address} is not among the allowed recipients."
        return None

    async def _account_refused(self, trouble: Trouble, now_ms: int) -> None:
        """Back off for all mails after a failure of the account. The pause starts at the end of the attempt, `now_ms`,
        however long the disk took since."""
        if trouble.is_permanent:
            await self._folder.ask(lambda outbox: outbox.queue.refuse_all(str(trouble), now_ms))
            return
        self._failures += 1
        self._held = now_ms + round(1000 * self._pause_s(self._failures)), str(trouble)
        await self._hold()

    async def _hold(self) -> None:
        if self._held is not None:
            until_ms, why = self._held
            await self._folder.ask(lambda outbox: outbox.queue.hold(why, until_ms, _LONGEST_MS))

    def _is_held(self) -> bool:
        """Apply a running back-off of the account to newly ordered mails."""
        if self._held is None:
            return False
        left_ms = self._held[0] - self._wall_ms()
        return 0 < left_ms <= _LONGEST_MS  # more: the clock was set back

    async def _settle(self, mail: Mail, outcome: Outcome) -> None:
        """Store the outcome of an attempt, however long the disk takes: without it the mail would be sent again."""
        log.info("mail %d part %d of %d: %s. %s", mail.letter, mail.part, mail.parts, outcome.state, outcome.detail)
        while True:
            try:
                await self._folder.ask(lambda outbox: outbox.queue.settle(mail.n, outcome, self._wall_ms()))
                return
            except MailRefused as why:
                log.error("mail state not saved yet: mail=%d error=%s", mail.letter, why)
                await asyncio.sleep(retry_backoff.AGAIN_S)


def _next_due(outbox: Outbox, now_ms: int) -> Mail | None:
    return outbox.queue.next_due(now_ms, _LONGEST_MS)

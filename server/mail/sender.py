"""Sends the mails of the outbox when they are due, over one connection, and stores the outcome of each attempt."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from server.mail import address
from server.mail.mail_folder import MailFolder, MailRefused
from server.mail.order import Mail, Outcome, Recipient
from server.mail.outbox import Outbox
from server.mail.settings import MailSettings
from server.mail.smtp_connection import Connection, Envelope, Reply, connect
from server.mail.smtp_dial import Account, Trouble
from server.mail.under_way import Underway, joined

log = logging.getLogger("catgraph.mail")

# How long a mail waits before it is tried again, and when it is given up.
_PAUSES_S = (10, 30, 60, 120, 300, 600, 1200, 1800)
LONGEST_S = 3600.0
_LONGEST_MS = round(1000 * LONGEST_S)
AGAIN_S = 5.0  # until a failed task is restarted, and a failed disk is tried again
# Three days, though RFC 5321 4.5.4.1 wants four to five from relays that nobody watches: an operator does here. Counted
# in attempts, not by the clock: a computer in a car may only learn the date after a day.
MAX_ATTEMPTS = len(_PAUSES_S) + 72
_MOST_NAMED = 5  # recipients named in a sentence


def pause_s(attempts: int) -> float:
    """The pause after so many attempts that came to nothing (1: the first)."""
    return float(_PAUSES_S[attempts - 1]) if attempts <= len(_PAUSES_S) else LONGEST_S


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
            timeout = min(timeout, LONGEST_S)
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
            outcome = answered(mail, answers, of_mail, now_ms, self._pause_s)
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
        return troubled(mail, trouble, is_doubtful=is_doubtful, now_ms=now_ms, pause_s=self._pause_s)

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
                await asyncio.sleep(AGAIN_S)


def _next_due(outbox: Outbox, now_ms: int) -> Mail | None:
    return outbox.queue.next_due(now_ms, _LONGEST_MS)


def answered(
    mail: Mail,
    answers: Mapping[str, Reply],
    of_mail: Reply | None,
    now_ms: int,
    pause_s: Callable[[int], float],
) -> Outcome:
    """Return the outcome of the server's replies: one for each recipient, and one for the mail if any was accepted."""
    recipients = tuple(_settled(one, answers.get(one.address), of_mail) for one in mail.recipients)
    waiting = [one for one in recipients if one.state == "waiting"]
    refused = [one for one in recipients if one.state == "refused"]
    if waiting:
        detail = waiting[0].detail
        if len(recipients) > 1:
            detail = f"{_named(waiting)}; {_count(recipients)}"
        return _again(mail, recipients, detail, now_ms, pause_s)
    if refused:
        detail = refused[0].detail if len(recipients) == 1 else f"{_named(refused)}; {_count(recipients)}"
        return Outcome(state="failed", detail=detail, recipients=recipients)
    detail = recipients[-1].detail if recipients else ""
    return Outcome(state="sent", detail=detail, recipients=recipients)


def troubled(
    mail: Mail, trouble: Trouble, *, is_doubtful: bool, now_ms: int, pause_s: Callable[[int], float]
) -> Outcome:
    """Return the outcome of an attempt that failed before the server's final reply."""
    detail = str(trouble)
    if is_doubtful:
        detail = f"{detail} It may have arrived; it is sent again under the same Message-ID."
    if trouble.is_permanent:
        return Outcome(state="failed", detail=detail, recipients=mail.recipients, of_account=trouble.is_of_account)
    return _again(mail, mail.recipients, detail, now_ms, pause_s)


def _settled(one: Recipient, answer: Reply | None, of_mail: Reply | None) -> Recipient:
    if one.state != "waiting" or answer is None:
        return one  # already accepted or refused
    if answer.code >= 300:
        return replace(one, state="refused" if answer.is_permanent else "waiting", detail=answer.text)
    if of_mail is None:
        return one
    if of_mail.code < 300:
        return replace(one, state="accepted", detail=of_mail.text)
    return replace(one, state="refused" if of_mail.is_permanent else "waiting", detail=of_mail.text)


def _again(
    mail: Mail, recipients: tuple[Recipient, ...], detail: str, now_ms: int, pause_s: Callable[[int], float]
) -> Outcome:
    if mail.attempts >= MAX_ATTEMPTS:
        return Outcome(
            state="failed", detail=f"Given up after {mail.attempts} attempts: {detail}", recipients=recipients
        )
    next_ms = now_ms + round(1000 * pause_s(mail.attempts))
    return Outcome(state="queued", detail=detail, recipients=recipients, next_ms=next_ms)


def _named(some: Sequence[Recipient]) -> str:
    listed = ", ".join(f"{one.address}: {one.detail}" if one.detail else one.address for one in some[:_MOST_NAMED])
    return listed + (f" and {len(some) - _MOST_NAMED} more" if len(some) > _MOST_NAMED else "")


def _count(recipients: Sequence[Recipient]) -> str:
    accepted = sum(one.state == "accepted" for one in recipients)
    return f"{accepted} of {len(recipients)} recipients have it"

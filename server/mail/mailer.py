"""Keeps the outbox, makes and sends what is in it: two tasks on the loop, begun again whatever happens to them."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import logging
import os
import secrets
import shutil
import sqlite3
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from server.mail import address, attempt, retry_backoff
from server.mail.order import Letter, Mail, Order
from server.mail.outbox import Outbox, OutboxFull, Outcome, WrongState
from server.mail.prepare import CannotPrepare, prepare
from server.mail.replies import Trouble
from server.mail.settings import MailSettings, MailSettingsFile, checked
from server.mail.smtp_connection import Account, Connection, Envelope, connect
from server.mail.source import Source
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.mail")
T = TypeVar("T")
_LONGEST_MS = round(1000 * retry_backoff.LONGEST_S)
_AGAIN_S = 5.0  # until a task that failed is begun again
_BREAK_OFF_S = 10.0  # a cancelled mail that was handed over already waits so long for its answer


class MailRefused(Exception):
    """An order that is not taken; `str()` is one sentence, `field` what is at fault, `status` as HTTP has it."""

    def __init__(self, sentence: str, *, field: str = "", status: int = 422) -> None:
        super().__init__(sentence)
        self.field = field
        self.status = status


@dataclass(slots=True)
class Underway:
    """What is being made or sent now."""

    letter: int
    task: asyncio.Future[Any] = field(default_factory=lambda: asyncio.get_running_loop().create_future())
    share: float = 0.0
    connection: Connection | None = None
    over: asyncio.Event = field(default_factory=asyncio.Event)  # and what came of it is on the disk


class Mailer:
    """One server's mail, kept in `folder`."""

    def __init__(
        self,
        folder: Path,
        source: Source,
        *,
        wall_ms: Callable[[], int],
        pause_s: Callable[[int], float] = retry_backoff.pause_s,
    ) -> None:
        self._folder = folder
        self._source = source
        self._wall_ms = wall_ms
        self._pause_s = pause_s
        self._thread = ThreadPoolExecutor(1, "catgraph-outbox")
        self._supervisor = Supervisor("mail")
        self._to_make = asyncio.Event()
        self._to_send = asyncio.Event()
        self._failures = 0  # of the account, one after the other
        self._held: tuple[int, str] | None = None  # until when the server is not asked again [ms], and why
        self.making: Underway | None = None
        self.sending: Underway | None = None
        self.settings = MailSettings()
        self.complaints: list[str] = []  # what was found wrong at the start
        self.trouble: str | None = None  # why nothing can be kept or sent now
        self._lock: int | None = None
        self._outbox: Outbox | None = None

    async def start(self) -> None:
        """Opens the outbox and begins to send. Never raises for what the disk does: `trouble` says it."""
        try:
            await self._in_thread(self._open)
        except (OSError, sqlite3.Error) as why:
            self.trouble = f"Mail is off: {_reason(why)}."
            log.error("%s", self.trouble)
            return
        self._supervisor.keep("preparing", partial(self._again, "preparing mail", self._make_all))
        self._supervisor.keep("sending", partial(self._again, "sending mail", self._send_all))

    async def stop(self) -> None:
        """Ends it; what is on its way is sent again at the next start."""
        await self._supervisor.stop()
        await self._in_thread(self._close)
        self._thread.shutdown(wait=True)

    def problems(self) -> list[str]:
        """What is wrong with its tasks, a sentence each."""
        return self._supervisor.problems()

    def look(self) -> None:
        """Something may be due: a clock was moved, or mail was ordered."""
        self._to_make.set()
        self._to_send.set()

    # --- what the routes ask for

    def new_key(self) -> str:
        """A name for an order that brings none."""
        return secrets.token_hex(12)

    def share_of(self, letter: Letter) -> float | None:
        """How much of it is made, or sent of the mail that is on its way: 0 to 1; None: neither is going on."""
        for under_way in (self.making, self.sending):
            if under_way is not None and under_way.letter == letter.n:
                return round(under_way.share, 3)
        return None

    async def order(self, key: str, order: Order) -> Letter:
        """Takes an order; it is on the disk when this returns. Raises MailRefused."""
        if not self.settings.is_complete:
            raise MailRefused("Mail is not set up: give SMTP host and sender in Settings, E-mail.", status=409)
        for one in order.to:
            self._allow(one)
        for recording in order.recordings:
            if await asyncio.to_thread(self._source.path_of, recording) is None:
                raise MailRefused(f"There is no finished recording {recording}.", field="recordings", status=404)
        try:
            letter = await self._with(lambda outbox: outbox.add(key, order, self._wall_ms()))
        except OutboxFull:
            raise MailRefused("The outbox is full: cancel or resend what failed.", status=409) from None
        self._to_make.set()
        return letter

    async def letters(self, before: int | None, limit: int) -> list[Letter]:
        return await self._with(lambda outbox: outbox.letters(before, limit))

    async def letter(self, n: int) -> Letter:
        """Raises MailRefused where there is none."""
        found = await self._with(lambda outbox: outbox.letter(n))
        if found is None:
            raise _unknown(n)
        return found

    async def cancel(self, n: int) -> Letter:
        """Nothing more of it is sent; a mail that is handed over already is waited for. Raises MailRefused."""
        try:
            await self._with(lambda outbox: outbox.cancel(n))
        except WrongState as why:
            raise MailRefused(str(why), status=409) from None
        except KeyError:
            raise _unknown(n) from None
        for under_way in (self.making, self.sending):
            if under_way is None or under_way.letter != n:
                continue
            if under_way.connection is None or not under_way.connection.is_doubtful:
                under_way.task.cancel()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_BREAK_OFF_S):
                    await under_way.over.wait()
        return await self.letter(n)

    async def resend(self, n: int) -> Letter:
        """Tries it again now. Raises MailRefused."""
        letter = await self.letter(n)
        for one in letter.order.to:
            self._allow(one)
        try:
            letter = await self._with(lambda outbox: outbox.resend(n, self.settings.sender, self._wall_ms()))
        except WrongState as why:
            raise MailRefused(str(why), status=409) from None
        self._held = None
        self.look()
        return letter

    async def change(self, body: Mapping[str, Any]) -> MailSettings:
        """Takes settings over, once they are on the disk; what waits is tried. Raises BadMailSetting, MailRefused."""
        settings = await asyncio.to_thread(checked, body, self.settings)
        if self._outbox is None:
            raise MailRefused(self.trouble or "Mail is not ready yet.", status=503)
        try:
            await self._in_thread(lambda: MailSettingsFile(self._folder / "settings.toml").write(settings))
        except OSError as why:
            raise MailRefused(f"The mail settings are not kept: {_reason(why)}.", status=507) from None
        self.settings = settings
        self._failures, self._held = 0, None
        await self._with(lambda outbox: outbox.try_all_again(settings.sender, self._wall_ms()))
        self.look()
        return settings

    # --- preparing

    async def _make_all(self) -> None:
        while True:
            self._to_make.clear()
            letter = await self._with(Outbox.to_prepare)
            if letter is None:
                await self._to_make.wait()
                continue
            await self._make(letter)

    async def _make(self, letter: Letter) -> None:
        outbox = self._outbox
        assert outbox is not None
        under_way = Underway(
            letter=letter.n,
            task=asyncio.ensure_future(
                prepare(letter, self.settings, self._source, self._folder / "work", outbox.files, self._made_so_far)
            ),
        )
        self.making = under_way
        try:
            await _joined(under_way.task)
            if under_way.task.cancelled():
                await self._with(lambda outbox: outbox.discard(letter.key))
                return  # somebody cancelled the letter
            made = under_way.task.result()
            await self._with(lambda outbox: outbox.prepared(letter.n, made))
            await self._with(lambda outbox: outbox.discard(letter.key))
            self._to_send.set()
        except (CannotPrepare, OSError) as why:
            said = str(why) if isinstance(why, CannotPrepare) else f"It could not be made: {_reason(why)}."
            log.warning("mail %d: %s", letter.n, said)
            await self._with(lambda outbox: outbox.prepare_failed(letter.n, said))
        except MailRefused:
            raise  # the disk; it is made again
        except Exception:
            log.exception("mail %d could not be made", letter.n)
            said = "It could not be made: the server made a mistake, which is in its log."
            await self._with(lambda outbox: outbox.prepare_failed(letter.n, said))
        finally:
            self.making = None
            under_way.over.set()

    def _made_so_far(self, share: float) -> None:  # also called from the thread that packs
        under_way = self.making
        if under_way is not None:
            under_way.share = min(1.0, max(under_way.share, share))

    # --- sending

    async def _send_all(self) -> None:
        connection: Connection | None = None
        await self._with(Outbox.requeue)
        try:
            while True:
                self._to_send.clear()
                mail = await self._with(partial(_next_due, now_ms=self._wall_ms()))
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
        """Until something is due, or somebody calls."""
        earliest = await self._with(Outbox.earliest_ms)
        timeout = None if earliest is None else max(0.0, (earliest - self._wall_ms()) / 1000)
        if timeout is not None:
            timeout = min(timeout, retry_backoff.LONGEST_S)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(timeout):  # wait_for of Python 3.11 may swallow the end of the task
                await self._to_send.wait()

    async def _send(self, mail: Mail, connection: Connection | None) -> Connection | None:
        """One attempt, and what came of it on the disk; the connection where it can be used again."""
        refused = self._refusal(mail)
        if refused is not None:
            await self._settle(mail, Outcome(state="failed", said=refused, recipients=mail.recipients))
            return connection
        begun = await self._with(lambda outbox: outbox.begin(mail.n))
        if begun is None:
            return connection  # it was cancelled
        under_way = Underway(letter=mail.letter, connection=connection)
        under_way.task = asyncio.ensure_future(self._hand_over(begun, under_way))
        self.sending = under_way
        try:
            return await self._finish(begun, under_way)
        except BaseException:
            if under_way.connection is not None:
                under_way.connection.drop()
            raise
        finally:
            self.sending = None
            under_way.over.set()

    async def _finish(self, mail: Mail, under_way: Underway) -> Connection | None:
        """Waits for an attempt and keeps what came of it, though the server be ended meanwhile."""
        is_ended = False
        try:
            await _joined(under_way.task)
        except asyncio.CancelledError:
            is_ended = True
        task, trouble = under_way.task, None
        if task.cancelled():
            if is_ended:
                raise asyncio.CancelledError  # it is sent again at the next start
            outcome = Outcome(state="cancelled", said="", recipients=mail.recipients)
        elif (error := task.exception()) is None:
            answers, of_mail = task.result()
            outcome = attempt.answered(mail, answers, of_mail, self._wall_ms(), self._pause_s)
            self._failures = 0
        else:
            trouble = error if isinstance(error, Trouble) else self._fault(mail, error)
            outcome = self._troubled(mail, trouble, under_way)
        await asyncio.shield(self._settle(mail, outcome))
        if is_ended:
            raise asyncio.CancelledError
        if trouble is not None and trouble.is_of_account:
            await self._account_refused(trouble)
        connection = under_way.connection
        if connection is not None and (trouble is not None or task.cancelled() or not connection.is_open):
            connection.drop()
            return None
        return connection

    def _fault(self, mail: Mail, error: BaseException) -> Trouble:
        """A fault of ours must not keep a mail "sending" for ever."""
        log.error("mail %d could not be sent", mail.letter, exc_info=error)
        return Trouble(f"The server made a mistake ({type(error).__name__}), which is in its log.")

    def _troubled(self, mail: Mail, trouble: Trouble, under_way: Underway) -> Outcome:
        is_doubtful = under_way.connection is not None and under_way.connection.is_doubtful
        return attempt.troubled(mail, trouble, is_doubtful=is_doubtful, now_ms=self._wall_ms(), pause_s=self._pause_s)

    async def _hand_over(self, mail: Mail, under_way: Underway) -> Any:
        outbox = self._outbox
        assert outbox is not None
        if under_way.connection is None or not under_way.connection.is_open:
            under_way.connection = await connect(Account.of(self.settings))
        path = outbox.files / mail.file
        waiting = [one.address for one in mail.recipients if one.state == "waiting"]
        envelope = Envelope(
            sender=self.settings.sender,
            to=waiting,
            file=path,
            size_bytes=mail.size_bytes,
            needs_utf8=not all(one.isascii() for one in (self.settings.sender, *(r.address for r in mail.recipients))),
        )

        def told(sent: int) -> None:
            under_way.share = sent / max(1, mail.size_bytes)

        try:
            return await under_way.connection.hand_over(envelope, told)
        except FileNotFoundError:
            raise Trouble("Its file is gone from the outbox: send it again.", is_permanent=True) from None

    def _refusal(self, mail: Mail) -> str | None:
        """Why it may not be sent any more."""
        if not self.settings.is_complete:
            return "Mail is not set up: give SMTP host and sender in Settings, E-mail."
        for one in mail.recipients:
            if one.state == "waiting" and not address.is_allowed(address.parse(one.address), self.settings.allowed):
                return f"{one.address} is not among the allowed recipients."
        return None

    async def _account_refused(self, trouble: Trouble) -> None:
        """What holds for one mail holds for all: the server is not asked once for each."""
        if trouble.is_permanent:
            await self._with(lambda outbox: outbox.refuse_all(str(trouble), self._wall_ms()))
            return
        self._failures += 1
        self._held = self._wall_ms() + round(1000 * self._pause_s(self._failures)), str(trouble)
        await self._hold()

    async def _hold(self) -> None:
        if self._held is not None:
            until_ms, why = self._held
            await self._with(lambda outbox: outbox.hold(why, until_ms, _LONGEST_MS))

    def _is_held(self) -> bool:
        """The server was asked in vain a short while ago: what was ordered since waits with the others."""
        if self._held is None:
            return False
        left_ms = self._held[0] - self._wall_ms()
        return 0 < left_ms <= _LONGEST_MS  # more: the clock was set back

    async def _settle(self, mail: Mail, outcome: Outcome) -> None:
        """Keeps what came of an attempt, however long the disk takes: forgetting it would send the mail again."""
        log.info("mail %d part %d of %d: %s. %s", mail.letter, mail.part, mail.parts, outcome.state, outcome.said)
        while True:
            try:
                await self._with(lambda outbox: outbox.settle(mail.n, outcome, self._wall_ms()))
                return
            except MailRefused as why:
                log.error("what became of mail %d is not kept yet: %s", mail.letter, why)
                await asyncio.sleep(_AGAIN_S)

    # --- the ground

    def _allow(self, one: str) -> None:
        if not address.is_allowed(address.parse(one), self.settings.allowed):
            raise MailRefused(f"{one} is not among the allowed recipients.", field="to")

    async def _again(self, what: str, work: Callable[[], Awaitable[None]]) -> None:
        while True:
            try:
                await work()
            except MailRefused as why:  # the disk, told in `trouble`
                log.error("%s: %s", what, why)
            except Exception:
                log.exception("%s failed; it is begun again", what)
            await asyncio.sleep(_AGAIN_S)

    async def _with(self, work: Callable[[Outbox], T]) -> T:
        """Asks the outbox in its own thread. Raises MailRefused where the disk does not do it."""
        outbox = self._outbox
        if outbox is None:
            raise MailRefused(self.trouble or "Mail is not ready yet.", status=503)
        try:
            found = await self._in_thread(lambda: work(outbox))
        except (OSError, sqlite3.Error) as why:
            self.trouble = f"The outbox is not kept: {_reason(why)}."
            raise MailRefused(self.trouble, status=507) from None
        self.trouble = None
        return found

    async def _in_thread(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    def _open(self) -> None:
        folder = self._folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._lock = _locked(folder / "lock")
        file = MailSettingsFile(folder / "settings.toml")
        self.settings = file.read()
        shutil.rmtree(folder / "work", ignore_errors=True)
        outbox = Outbox(folder)
        outbox.recover()
        self.complaints = [one for one in (file.complaint, outbox.complaint) if one]
        for one in self.complaints:
            log.error("%s", one)
        self._outbox = outbox

    def _close(self) -> None:
        if self._outbox is not None:
            self._outbox.close()
        if self._lock is not None:
            os.close(self._lock)


def _next_due(outbox: Outbox, now_ms: int) -> Mail | None:
    return outbox.next_due(now_ms, _LONGEST_MS)


async def _joined(task: asyncio.Future[Any]) -> None:
    """Waits for a task to end, however; whoever is cancelled meanwhile takes it along."""
    try:
        await asyncio.wait([task])
    except asyncio.CancelledError:
        await _ended(task)
        raise


async def _ended(task: asyncio.Future[Any]) -> None:
    """Ends a task; told again and again, for wait_for of Python 3.11 (aiosmtplib uses it) may swallow the word."""
    while not task.done():
        task.cancel()
        await asyncio.wait([task], timeout=0.5)


def _locked(path: Path) -> int:
    """One server sends from a folder, or each mail would go out twice. Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise OSError(0, "another catgraph sends from the same folder") from None
    return descriptor


def _unknown(n: int) -> MailRefused:
    return MailRefused(f"There is no mail number {n}.", status=404)


def _reason(why: BaseException) -> str:
    if isinstance(why, OSError) and why.strerror:
        return why.strerror[:1].lower() + why.strerror[1:]
    return str(why)[:120] or type(why).__name__

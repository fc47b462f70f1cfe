"""One connection to the SMTP server: dial, encrypt, log in, send mails in pieces.

aiosmtplib (written against 5.1) dials, encrypts, logs in and sends commands. Its own send method takes a whole mail as
bytes and blocks the loop with regular expressions; here the text is read off the loop, and written as fast as the
server takes it.
"""

from __future__ import annotations

import asyncio
import contextlib
import ssl
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import aiosmtplib
from aiosmtplib.protocol import SMTPProtocol

from server.mail.smtp_dial import DIAL_S, Account, Trouble, as_trouble, clean, dial, own_name

REPLY_S = 60.0  # RFC 5321 4.5.3.2 has minutes; a server that thinks so long is tried again
END_S = 300.0  # for the reply to a whole mail, which a server may take apart and scan first
STALL_S = 60.0  # without a byte taken; RFC 5321 4.5.3.2 has minutes
_PIECE = 1 << 18


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """One mail and its SMTP envelope."""

    sender: str
    to: Sequence[str]
    file: Path
    size_bytes: int
    needs_utf8: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """The server's reply to one command."""

    code: int
    message: str

    @property
    def is_permanent(self) -> bool:
        return self.code >= 500

    @property
    def text(self) -> str:
        return f"{self.code} {self.message}".strip()


class Connection:
    """An open connection; mails are sent one after the other."""

    def __init__(self, smtp: aiosmtplib.SMTP, account: Account) -> None:
        self._smtp = smtp
        self._account = account
        self.is_doubtful = False  # a whole mail was handed over and the server has not answered

    @property
    def is_open(self) -> bool:
        return self._smtp.is_connected

    @property
    def largest_bytes(self) -> int | None:
        """The server's size limit (RFC 1870) [B]; None: not declared."""
        limit = self._smtp.esmtp_extensions.get("size", "")
        return int(limit) if limit.isdigit() and int(limit) > 0 else None

    async def hand_over(
        self, mail: Envelope, on_progress: Callable[[int], None]
    ) -> tuple[dict[str, Reply], Reply | None]:
        """The server's answer to each recipient, and to the mail; None where no recipient was taken.

        `on_progress` is called with the bytes that are on their way. Raises Trouble: then nothing is settled, and where
        `is_doubtful` is true the mail may have arrived.
        """
        self.is_doubtful = False
        with self._as_trouble("while the mail was sent"):
            await self._sender(mail)
            answers = {one: await self._recipient(one, mail.needs_utf8) for one in mail.to}
            if any(answer.code in (421, 0) for answer in answers.values()) and not self._smtp.is_connected:
                raise Trouble(next(answer.text for answer in answers.values() if answer.code in (421, 0)))
            if not any(answer.code < 300 for answer in answers.values()):
                await self._smtp.rset()
                return answers, None
            start = await self._smtp.execute_command(b"DATA", timeout=REPLY_S)
            if start.code != 354:
                return answers, self._reply(start.code, start.message)
            return answers, await self._text(mail, on_progress)

    async def _sender(self, mail: Envelope) -> None:
        options = []
        largest = self.largest_bytes
        if largest is not None and mail.size_bytes > largest:
            raise Trouble(
                f"{self._account.shown} takes mails of at most {largest / 1e6:.1f} MB, and this one has "
                f"{mail.size_bytes / 1e6:.1f} MB: lower the size limit in Settings, E-mail, and send it again.",
                is_permanent=True,
            )
        if self._smtp.supports_extension("size"):
            options.append(f"SIZE={mail.size_bytes}")
        if mail.needs_utf8:
            if not self._smtp.supports_extension("smtputf8"):
                raise Trouble(
                    f"{self._account.shown} takes no address with letters beyond ASCII before the @.", is_permanent=True
                )
            options.append("SMTPUTF8")
        try:
            await self._smtp.mail(mail.sender, options=options, encoding=_encoding(mail.needs_utf8), timeout=REPLY_S)
        except aiosmtplib.SMTPSenderRefused as refused:
            answer = self._reply(refused.code, refused.message)
            raise Trouble(
                f"The sender {mail.sender} is refused: {answer.text}", is_permanent=answer.is_permanent
            ) from None

    async def _recipient(self, one: str, needs_utf8: bool) -> Reply:
        try:
            answer = await self._smtp.rcpt(one, encoding=_encoding(needs_utf8), timeout=REPLY_S)
        except aiosmtplib.SMTPRecipientRefused as refused:
            return self._reply(refused.code, refused.message)
        return self._reply(answer.code, answer.message)

    async def _text(self, mail: Envelope, on_progress: Callable[[int], None]) -> Reply:
        protocol = self._smtp.protocol
        if protocol is None:
            raise Trouble("The connection was lost.")
        # A server may refuse during the transfer: its reply is awaited from the start.
        answer = asyncio.ensure_future(protocol.read_response(timeout=None))
        try:
            async with opened(mail.file) as file:
                sent = 0
                is_line_start = True
                while not answer.done():
                    piece, is_line_start, length = await asyncio.to_thread(next_piece, file, is_line_start)
                    if not piece:
                        break
                    await write(protocol, piece, answer)
                    sent += length
                    on_progress(sent)
            if not answer.done():
                self.is_doubtful = True
                protocol.write(b".\r\n")
            async with asyncio.timeout(END_S):
                final = await answer
        finally:
            if not answer.done():
                answer.cancel()
            elif not answer.cancelled():
                answer.exception()
        self.is_doubtful = False
        return self._reply(final.code, final.message)

    async def close(self) -> None:
        """Send QUIT if the connection is open."""
        with contextlib.suppress(aiosmtplib.SMTPException, OSError, TimeoutError):
            await self._smtp.quit(timeout=2.0)
        self._smtp.close()

    def drop(self) -> None:
        """Abort the connection: the server discards an incomplete mail."""
        transport = self._smtp.transport
        if isinstance(transport, asyncio.Transport) or hasattr(transport, "abort"):
            transport.abort()  # type: ignore[union-attr]
        self._smtp.close()

    @contextmanager
    def _as_trouble(self, when: str) -> Iterator[None]:
        with as_trouble(self._account, when):
            yield

    def _reply(self, code: int, message: str) -> Reply:
        return Reply(code=code, message=clean(message, self._account.password))


@asynccontextmanager
async def connected(account: Account) -> AsyncIterator[Connection]:
    """A connection that is logged in, closed at the end. Raises Trouble of the account."""
    connection = await connect(account)
    try:
        yield connection
    finally:
        await connection.close()


async def connect(account: Account) -> Connection:
    """Dials, encrypts, logs in. Raises Trouble of the account."""
    context = await asyncio.to_thread(_context, account.ca) if account.security != "none" else None
    with as_trouble(account, ""):
        dialled = await dial(account)
        smtp = aiosmtplib.SMTP(
            hostname=account.host,
            sock=dialled,
            local_hostname=own_name(dialled),
            timeout=REPLY_S,
            use_tls=account.security == "tls",
            start_tls=False,
            tls_context=context,
        )
        connection = Connection(smtp, account)
        try:
            await smtp.connect(timeout=DIAL_S)
            await smtp.ehlo(timeout=REPLY_S)
            if account.security == "starttls":
                if not smtp.supports_extension("starttls"):
                    raise Trouble(
                        f"{account.shown} offers no STARTTLS: choose TLS, or ask for its port.",
                        is_permanent=True,
                        is_of_account=True,
                    )
                await smtp.starttls(tls_context=context, timeout=REPLY_S)
                await smtp.ehlo(timeout=REPLY_S)
            if account.user:
                await _log_in(smtp, account)
        except BaseException:
            smtp.close()  # and its transport with the socket
            raise
    return connection


async def _log_in(smtp: aiosmtplib.SMTP, account: Account) -> None:
    try:
        await smtp.login(account.user, account.password, timeout=REPLY_S)
    except aiosmtplib.SMTPAuthenticationError as refused:
        reply = f"{refused.code} {clean(refused.message, account.password)}"
        raise Trouble(
            f"{account.shown} refuses the login of {account.user}: {reply}",
            is_permanent=refused.code >= 500,
            is_of_account=True,
        ) from None
    except aiosmtplib.SMTPException as error:
        if isinstance(error, (aiosmtplib.SMTPServerDisconnected, aiosmtplib.SMTPTimeoutError)):
            raise
        raise Trouble(
            f"{account.shown} offers no supported login method.", is_permanent=True, is_of_account=True
        ) from None


def _context(ca: str) -> ssl.SSLContext:
    """The system's own authorities, or only those given."""
    return ssl.create_default_context(cadata=ca or None)


def _encoding(needs_utf8: bool) -> str:
    return "utf-8" if needs_utf8 else "ascii"


@contextlib.asynccontextmanager
async def opened(path: Path) -> AsyncIterator[BinaryIO]:
    """The file, opened for reading in a thread; closed at the end, also if that comes while it is being opened."""
    opening: asyncio.Future[BinaryIO] = asyncio.ensure_future(asyncio.to_thread(open, path, "rb"))
    try:
        file = await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close)
        raise
    with file:
        yield file


def _close(opening: asyncio.Future[BinaryIO]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()


def next_piece(file: BinaryIO, is_line_start: bool) -> tuple[bytes, bool, int]:
    """The next piece with its dots doubled (RFC 5321 4.5.2), whether it ends a line, and how long it was."""
    piece = file.read(_PIECE)
    escaped = piece.replace(b"\n.", b"\n..")
    if is_line_start and piece.startswith(b"."):
        escaped = b"." + escaped
    return escaped, piece.endswith(b"\n"), len(piece)


async def write(protocol: SMTPProtocol, piece: bytes, answer: asyncio.Future[Any]) -> None:
    """Writes, and waits until the line has taken most of it, the server answers, or nothing moves any more."""
    protocol.write(piece)
    drained: asyncio.Future[Any] = asyncio.ensure_future(protocol._drain_helper())
    try:
        done, _ = await asyncio.wait({drained, answer}, timeout=STALL_S, return_when=asyncio.FIRST_COMPLETED)
        if not done:
            raise TimeoutError
        if drained in done:
            drained.result()
    finally:
        drained.cancel()
        with contextlib.suppress(asyncio.CancelledError, OSError):
            await drained

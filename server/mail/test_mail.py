"""A test of the mail settings: connect, encrypt, log in, and send a short mail at once, bypassing the outbox."""

from __future__ import annotations

import asyncio
import secrets
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path

from server.mail import address, compose
from server.mail.address import MailAddress
from server.mail.settings import MailSettings
from server.mail.smtp_connection import Envelope, connected
from server.mail.smtp_dial import Account, Trouble

WITHIN_S = 45.0


class MailTestFailed(Exception):
    """The test failed; `str()` is a sentence with the server's reply."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """The result of a test that succeeded."""

    sentence: str
    reply: str
    is_encrypted: bool
    largest_bytes: int | None


async def try_out(settings: MailSettings, to: MailAddress | None, now_ms: int) -> Trial:
    """Test the settings, and send a mail to `to` if it is given. Raises MailTestFailed."""
    account = Account.of(settings)
    try:
        async with asyncio.timeout(WITHIN_S), connected(account) as connection:
            how = f"{account.shown} answers" + (", encrypted" if settings.security != "none" else ", NOT encrypted")
            how += f", and accepts the login of {settings.user}." if settings.user else "."
            reply = ""
            if to is not None:
                with tempfile.TemporaryDirectory(prefix="catgraph-mail-") as folder:
                    mail = await asyncio.to_thread(_written, settings, to, now_ms, Path(folder))
                    answers, of_mail = await connection.hand_over(mail, lambda _: None)
                refused = of_mail is None or of_mail.code >= 300
                answer = answers[to.text] if of_mail is None else of_mail
                reply = answer.text
                if refused:
                    raise MailTestFailed(f"{account.shown} refuses the mail to {to.shown}: {reply}")
                how += f" It accepted a mail to {to.shown}."
            largest = connection.largest_bytes
            if largest is not None and largest < settings.limit_bytes * 1.37:
                how += (
                    f" It accepts mails of at most {largest / 1e6:.1f} MB: set the limit to {largest / 1.4e6:.1f} MB."
                )
            return Trial(sentence=how, reply=reply, is_encrypted=settings.security != "none", largest_bytes=largest)
    except Trouble as why:
        raise MailTestFailed(str(why)) from None
    except TimeoutError:
        raise MailTestFailed(f"{account.shown} did not answer in time.") from None


def _written(settings: MailSettings, to: MailAddress, now_ms: int, folder: Path) -> Envelope:
    sender = address.parse(settings.sender)
    path = folder / "trial.eml"
    draft = compose.Draft(
        sender=sender,
        sender_name=settings.sender_name,
        to=[to],
        subject="catgraph: test mail",
        at_ms=now_ms,
        message_id=f"<{secrets.token_hex(12)}.trial@{sender.domain}>",
        text="This mail tests catgraph's mail settings. Recordings will come from this address.",
    )
    size = compose.write(draft, path, threading.Event())
    return Envelope(
        sender=sender.text,
        to=[to.text],
        file=path,
        size_bytes=size,
        needs_utf8=sender.needs_utf8 or to.needs_utf8,
    )

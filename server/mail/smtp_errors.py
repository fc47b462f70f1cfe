"""Failures of a connection to an SMTP server, as sentences for the operator."""

from __future__ import annotations

import ssl
from collections.abc import Iterator
from contextlib import contextmanager

import aiosmtplib

from server.mail.replies import Trouble, clean
from server.mail.smtp_dial import Account


@contextmanager
def as_trouble(account: Account, when: str) -> Iterator[None]:
    """Turn every failure of a connection into a Trouble with a sentence."""
    is_dialling = not when
    try:
        yield
    except Trouble:
        raise
    except aiosmtplib.SMTPResponseException as answer:
        reply = f"{answer.code} {clean(answer.message, account.password)}"
        raise Trouble(
            f"{account.shown} replied{'' if is_dialling else f' {when}'}: {reply}",
            is_permanent=answer.code >= 500,
            is_of_account=is_dialling,
        ) from None
    except (aiosmtplib.SMTPException, OSError, TimeoutError) as error:
        trusted = _of_trust(error)
        if trusted is not None:
            raise Trouble(
                f"{account.shown} cannot be verified: {trusted}.", is_permanent=True, is_of_account=True
            ) from None
        raise Trouble(
            f"{account.shown} {_how(error)}{'' if is_dialling else f' {when}'}.", is_of_account=is_dialling
        ) from None


def _of_trust(error: BaseException) -> str | None:
    """Why the certificate is not trusted; None if the failure had another cause."""
    one: BaseException | None = error
    while one is not None:
        if isinstance(one, ssl.SSLCertVerificationError):
            return clean(one.verify_message or "its certificate is not trusted", "")
        one = one.__cause__ or one.__context__
    return None


def _how(error: BaseException) -> str:
    one: BaseException | None = error
    while one is not None:
        if isinstance(one, ConnectionRefusedError):
            return "refuses the connection"
        if isinstance(one, ssl.SSLError):
            return "does not speak TLS correctly"
        one = one.__cause__ or one.__context__
    if isinstance(error, TimeoutError):
        return "did not answer in time"
    if isinstance(error, (ConnectionError, aiosmtplib.SMTPServerDisconnected)):
        return "closed the connection"
    if isinstance(error, OSError) and error.strerror:
        return f"cannot be reached ({error.strerror.lower()})"
    return "does not answer like a mail server"

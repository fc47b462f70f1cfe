"""Which SMTP server an account names, a socket to it, and its replies and failures as sentences for the operator."""

from __future__ import annotations

import asyncio
import base64
import binascii
import ipaddress
import re
import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import aiosmtplib

from server.mail.settings import MailSettings
from server.rosbridge.address import BadAddress, refuse_forbidden

_LONGEST = 300
_BASE64 = re.compile(r"[A-Za-z0-9+/]{4,}={0,2}")
DIAL_S = 20.0


class Trouble(Exception):
    """No mail was accepted; `str()` is one sentence, with the server's reply if there was one."""

    def __init__(self, sentence: str, *, is_permanent: bool = False, is_of_account: bool = False) -> None:
        super().__init__(sentence)
        self.is_permanent = is_permanent  # trying again changes nothing
        self.is_of_account = is_of_account  # it holds for every mail, not for this one


def clean(text: str, password: str) -> str:
    """A server's reply on one line, cut, without control characters; a password that it repeats is masked."""
    if password:
        text = _BASE64.sub(lambda found: "•••" if _holds(found[0], password) else found[0], text)
        text = text.replace(password, "•••")
    line = "".join(letter if letter.isprintable() else " " for letter in text[: 8 * _LONGEST])
    return " ".join(line.split())[:_LONGEST]


def _holds(text: str, password: str) -> bool:
    """Whether it is the password, or a login with it, in base64."""
    try:
        return password.encode() in base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """The server to dial and the login."""

    host: str
    port: int
    security: str  # starttls, tls, none
    user: str
    password: str
    ca: str

    def __repr__(self) -> str:  # no password in any log
        return f"Account({self.shown})"

    @classmethod
    def of(cls, settings: MailSettings) -> Account:
        """The account in these settings."""
        return cls(
            host=settings.host,
            port=settings.port,
            security=settings.security,
            user=settings.user,
            password=settings.password,
            ca=settings.ca,
        )

    @property
    def shown(self) -> str:
        return f"{self.host}:{self.port}"


async def dial(account: Account) -> socket.socket:
    """A socket connected to the first address of the host that answers and may be dialled."""
    loop = asyncio.get_running_loop()
    async with asyncio.timeout(DIAL_S):
        try:
            found = await loop.getaddrinfo(account.host, account.port, type=socket.SOCK_STREAM)
        except socket.gaierror:
            raise Trouble(f"There is no host named {account.host}.", is_of_account=True) from None
        last: OSError | None = None
        for family, _, protocol, _, where in found:
            try:
                refuse_forbidden(str(where[0]))
            except BadAddress as why:
                raise Trouble(str(why), is_permanent=True, is_of_account=True) from None
            one = socket.socket(family, socket.SOCK_STREAM, protocol)
            try:
                one.setblocking(False)
                await loop.sock_connect(one, where)
                return one
            except OSError as error:
                one.close()
                last = error
            except BaseException:
                one.close()
                raise
    raise last or OSError("no address")


def own_name(dialled: socket.socket) -> str:
    """How this machine calls itself: its full name, else its address (RFC 5321 4.1.3). No name is looked up."""
    name = socket.gethostname()
    if "." in name and name.isascii() and name.isprintable() and " " not in name:
        return name
    own = ipaddress.ip_address(str(dialled.getsockname()[0]).partition("%")[0])
    return f"[IPv6:{own}]" if own.version == 6 else f"[{own}]"


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

"""Writes one mail as a file: headers, text, a range of a file in base64. Streamed, never whole in memory.

Text of a header is checked here: `email.message` refuses CR and LF only.
"""

from __future__ import annotations

import base64
import os
import re
import threading
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from email import policy
from email.header import Header
from email.headerregistry import Address
from email.message import EmailMessage
from email.policy import Policy
from pathlib import Path
from typing import BinaryIO

from server.mail.address import MailAddress

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,119}")
# Line breaks beyond CR and LF, and signs that turn the direction of writing: a subject must not rewrite its line.
_REFUSED = frozenset("\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\ufeff")
_LINE = 57  # bytes that make one line of 76 letters, RFC 2045 6.8
_PIECE = _LINE * 4096  # some 230 kB at once


def is_one_line(text: str) -> bool:
    """Return whether a text may stand in a header: no controls, no line breaks of any kind, no lone surrogates."""
    return not any(unicodedata.category(letter) in ("Cc", "Cs") or letter in _REFUSED for letter in text)


def one_line(text: str) -> str:
    """Return the text. Raises ValueError unless it is one line."""
    if not is_one_line(text):
        raise ValueError("a line break cannot stand in a line")
    return text


def needs_encoding(text: str) -> bool:
    """Return whether a text must be sent as encoded words (RFC 2047)."""
    return not text.isascii() or "=?" in text


class EncodedText:
    """A header that is written as encoded words, in the form that `EmailPolicy` accepts: a name and `fold`.

    The headers of `email.headerregistry` decode a given encoded word, so that a line break in it becomes real, and lose
    blanks between encoded words. `email.header.Header` does neither.
    """

    def __init__(self, name: str, text: str, rest: str = "") -> None:
        self.name = name
        self._text = one_line(text)
        self._rest = rest  # what follows on a line of its own

    def fold(self, *, policy: Policy) -> str:
        """Return the lines of the header."""
        encoded = Header(self._text, "utf-8", header_name=self.name).encode(linesep=policy.linesep)
        rest = f"{policy.linesep} {self._rest}" if self._rest else ""
        return f"{self.name}: {encoded}{rest}{policy.linesep}"


def file_name(name: str) -> str:
    """Return a name that may stand in quotes. Raises ValueError: names of attachments are made here, and plain."""
    if not _FILE_NAME.fullmatch(name):
        raise ValueError(f"{name[:60]!r} is no name for an attachment")
    return name


class Stopped(Exception):
    """The order was cancelled while its mails were made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """`length` bytes of a file from `start` on, under a name."""

    path: Path
    start: int
    length: int
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A mail before it is written."""

    sender: MailAddress
    sender_name: str
    to: Sequence[MailAddress]
    subject: str
    at_ms: int
    message_id: str  # with its brackets
    text: str
    attachment: Attachment | None = None


def write(draft: Draft, path: Path, stop: threading.Event) -> int:
    """Write the mail durably and return its size. Raises OSError, Stopped; ValueError for what no header may hold."""
    with open(path, "xb") as file:
        if draft.attachment is None:
            file.write(bytes(build(draft)))
        else:
            # `email.message` builds the mail around an empty attachment; its content never is in memory.
            end = f"--{_boundary(draft.message_id)}--\r\n".encode()
            around, found, _ = bytes(build(draft)).rpartition(b"\r\n" + end)
            if not found:
                raise ValueError("the mail does not end with its attachment")
            file.write(around)
            _attach(draft.attachment, file, stop)
            file.write(end)
        file.flush()
        os.fsync(file.fileno())
        return file.tell()


def build(draft: Draft) -> EmailMessage:
    """Build the mail, with an empty attachment in the place of the one that is streamed."""
    needs_utf8 = any(one.needs_utf8 for one in (draft.sender, *draft.to))
    mail = EmailMessage(policy=policy.SMTPUTF8 if needs_utf8 else policy.SMTP)
    mail["Date"] = datetime.fromtimestamp(draft.at_ms // 1000, UTC)
    mail["From"] = (
        EncodedText("From", draft.sender_name, f"<{draft.sender.text}>")
        if needs_encoding(draft.sender_name)
        else Address(one_line(draft.sender_name), draft.sender.local, draft.sender.domain)
    )
    mail["To"] = [Address("", one.local, one.domain) for one in draft.to]
    mail["Message-ID"] = one_line(draft.message_id)
    mail["Subject"] = (
        EncodedText("Subject", draft.subject) if needs_encoding(draft.subject) else one_line(draft.subject)
    )
    mail.set_content(draft.text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n") + "\n", cte="base64")
    if draft.attachment is not None:
        name = file_name(draft.attachment.name)
        mail.add_attachment(b"", maintype="application", subtype="octet-stream", filename=name, params={"name": name})
        mail.set_boundary(_boundary(draft.message_id))
    return mail


def _boundary(message_id: str) -> str:
    """Return what separates the parts: `=_` can stand neither in base64 nor in a header (RFC 2045 6.7)."""
    return "=_" + "".join(letter for letter in message_id if letter.isalnum())[:60]


def _attach(attachment: Attachment, file: BinaryIO, stop: threading.Event) -> None:
    left = attachment.length
    with open(attachment.path, "rb") as source:
        source.seek(attachment.start)
        while left:
            if stop.is_set():
                raise Stopped
            piece = source.read(min(_PIECE, left))
            if not piece:
                raise OSError(f"{attachment.path.name} is shorter than it was")
            left -= len(piece)
            # Only the last piece may end within a line, or its padding would stand amid the rest.
            file.write(_base64(piece))


def _base64(piece: bytes) -> bytes:
    return base64.encodebytes(piece).replace(b"\n", b"\r\n")

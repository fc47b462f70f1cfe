"""Writes one mail as a file, as it goes over the wire: head, text, a stretch of a file in base64. Never in memory."""

from __future__ import annotations

import base64
import os
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from server.mail import headers
from server.mail.address import MailAddress

_LINE = 57  # bytes that make one line of 76 letters, RFC 2045 6.8
_PIECE = _LINE * 4096  # some 230 kB at once


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
    """Writes it, durably; its size. Raises OSError, Stopped; ValueError for what cannot stand in a head."""
    with open(path, "xb") as file:
        file.write(_head(draft))
        if draft.attachment is None:
            file.write(_text_part(draft.text))
        else:
            edge = _edge(draft.message_id)
            file.write(headers.line("Content-Type", f'multipart/mixed; boundary="{edge}"'))
            file.write(f"\r\n--{edge}\r\n".encode())
            file.write(_text_part(draft.text))
            file.write(f"--{edge}\r\n".encode())
            _attach(draft.attachment, file, stop)
            file.write(f"--{edge}--\r\n".encode())
        file.flush()
        os.fsync(file.fileno())
        return file.tell()


def _head(draft: Draft) -> bytes:
    return b"".join(
        (
            headers.date_line(draft.at_ms),
            headers.address_line("From", [draft.sender], draft.sender_name),
            headers.address_line("To", draft.to),
            headers.line("Message-ID", draft.message_id),
            headers.text_line("Subject", draft.subject),
            headers.line("MIME-Version", "1.0"),
        )
    )


def _edge(message_id: str) -> str:
    """What separates the parts: `=_` can stand neither in base64 nor in a head of ours (RFC 2045 6.7)."""
    return "=_" + "".join(letter for letter in message_id if letter.isalnum())[:60]


def _text_part(text: str) -> bytes:
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n").split("\n")
    body = "\r\n".join(lines) + "\r\n"
    head = headers.line("Content-Type", "text/plain; charset=utf-8") + headers.line(
        "Content-Transfer-Encoding", "base64"
    )
    return head + b"\r\n" + _base64(body.encode())


def _attach(attachment: Attachment, file: BinaryIO, stop: threading.Event) -> None:
    name = headers.file_name(attachment.name)
    file.write(headers.line("Content-Type", f'application/octet-stream; name="{name}"'))
    file.write(headers.line("Content-Transfer-Encoding", "base64"))
    file.write(headers.line("Content-Disposition", f'attachment; filename="{name}"'))
    file.write(b"\r\n")
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

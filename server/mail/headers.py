"""The lines at the head of a mail and of its parts, after RFC 5322 and 2047. What holds a line break never gets in.

Written here and not by email.message: what goes out is plain to see, the same for the same mail, and no
display name, comment or second address can be smuggled into a line of addresses.
"""

from __future__ import annotations

import base64
import re
import unicodedata
from collections.abc import Sequence
from datetime import UTC, datetime
from email.utils import format_datetime

from server.mail.address import MailAddress

_FOLD = 60  # letters of UTF-8 in one encoded word: 75 with its frame (RFC 2047 2) and what stands before it
_PLAIN = re.compile(r"[!-~]+( [!-~]+)*")
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,119}")
# Line breaks beyond CR and LF, and signs that turn the direction of writing: a subject must not rewrite its line.
_REFUSED = frozenset("\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\ufeff")


def is_one_line(text: str) -> bool:
    """Whether a text may stand in a head: no control characters, no line breaks of any kind, no lone surrogates."""
    return not any(unicodedata.category(letter) in ("Cc", "Cs") or letter in _REFUSED for letter in text)


def line(name: str, value: str) -> bytes:
    """`Name: value`, ASCII, folded only where the caller folded it. Raises ValueError for what could break out."""
    text = f"{name}: {value}"
    if not re.fullmatch(r"[A-Za-z-]+", name) or not re.fullmatch(r"(?:[ -~]|\r\n (?=[!-~]))+", text):
        raise ValueError(f"{name} cannot be written into a mail")
    return f"{text}\r\n".encode("ascii")


def text_line(name: str, text: str) -> bytes:
    """A line of free text, such as the subject; encoded where it is not short ASCII."""
    return line(name, words(text))


def words(text: str) -> str:
    """Text as RFC 2047 has it: as it is where that is short and plain, else encoded words; no letter is broken."""
    if not is_one_line(text):
        raise ValueError("a line break cannot stand in a line")
    if not text or (_PLAIN.fullmatch(text) and len(text) <= _FOLD and "=?" not in text):
        return text
    found: list[str] = []
    piece = b""
    for letter in text:
        encoded = letter.encode()
        if len(piece) + len(encoded) > _FOLD * 3 // 4 - 9:
            found.append(_word(piece))
            piece = b""
        piece += encoded
    return "\r\n ".join([*found, _word(piece)])


def _word(piece: bytes) -> str:
    return f"=?utf-8?B?{base64.b64encode(piece).decode()}?="


def address_line(name: str, addresses: Sequence[MailAddress], display: str = "") -> bytes:
    """`To: a@b,` one a line. In UTF-8 (RFC 6532) where an address has a local part outside ASCII."""
    if not addresses:
        raise ValueError(f"{name} needs an address")
    if display:
        shown = words(display)
        if "=?" not in shown:  # a plain name is quoted, and neither \ nor " in it can end the quotes
            shown = '"' + shown.replace("\\", "\\\\").replace('"', '\\"') + '"'
        head = f"{shown}\r\n <"
        plain = line(name, f"{head}{addresses[0].text if addresses[0].text.isascii() else 'x@x'}>")
        return plain if addresses[0].text.isascii() else f"{name}: {head}{addresses[0].text}>\r\n".encode()
    joined = ",\r\n ".join(one.text for one in addresses)
    if joined.isascii():
        return line(name, joined)
    line(name, "x@x")  # its name is checked all the same; parse() has checked the addresses
    return f"{name}: {joined}\r\n".encode()


def date_line(at_ms: int) -> bytes:
    """`Date:`, in UTC."""
    return line("Date", format_datetime(datetime.fromtimestamp(at_ms // 1000, UTC)))


def file_name(name: str) -> str:
    """A name that may stand in quotes. Raises ValueError: the names of what is attached are ours, and plain."""
    if not _FILE_NAME.fullmatch(name):
        raise ValueError(f"{name[:60]!r} is no name for an attachment")
    return name

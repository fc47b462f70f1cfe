"""Checks of header text: `email.message` refuses CR and LF only."""

from __future__ import annotations

import re
import unicodedata
from email.header import Header
from email.policy import Policy

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,119}")
# Line breaks beyond CR and LF, and signs that turn the direction of writing: a subject must not rewrite its line.
_REFUSED = frozenset("\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\ufeff")


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

"""Checks of text before it goes into a header: `email.message` refuses CR and LF and nothing else."""

from __future__ import annotations

import re
import unicodedata

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,119}")
# Line breaks beyond CR and LF, and signs that turn the direction of writing: a subject must not rewrite its line.
_REFUSED = frozenset("\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\ufeff")


def is_one_line(text: str) -> bool:
    """Return whether a text may stand in a header: no controls, no line breaks of any kind, no lone surrogates."""
    return not any(unicodedata.category(letter) in ("Cc", "Cs") or letter in _REFUSED for letter in text)


def one_line(text: str) -> str:
    """Return the text as a header may hold it. Raises ValueError unless it is one line.

    `email.message` decodes an encoded word (RFC 2047) that it is given, and one may hold a line break. So none
    is left in the text.
    """
    if not is_one_line(text):
        raise ValueError("a line break cannot stand in a line")
    return text.replace("=?", "= ?")


def file_name(name: str) -> str:
    """Return a name that may stand in quotes. Raises ValueError: names of attachments are made here, and plain."""
    if not _FILE_NAME.fullmatch(name):
        raise ValueError(f"{name[:60]!r} is no name for an attachment")
    return name

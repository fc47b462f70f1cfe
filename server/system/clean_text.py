"""Text of strangers (a car, its bridge, a phone, a file) as it may be shown and logged: one line, all of it seen.

Nothing in it steers a terminal, ends a line, turns the direction of writing or hides between letters.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from typing import Any

MAX_TEXT = 4000  # letters


def clean(text: str, most: int = MAX_TEXT) -> str:
    """The text with a blank for each sign that is not seen, cut with … where it is longer than `most` letters."""
    if len(text) > most:
        text = f"{text[: most - 1]}…"
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else _BLANK.get(unicodedata.category(letter), "") for letter in text)


def cleaned(value: Any) -> Any:
    """A value as JSON has them, with every text in it clean, names of fields too."""
    if isinstance(value, str):
        return clean(value)
    if isinstance(value, Mapping):
        return {clean(name) if isinstance(name, str) else name: cleaned(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [cleaned(one) for one in value]
    return value


def short_text(value: Any, limit: int) -> str:
    """A text of at most `limit` letters, clean; of another value the name of its type, of None nothing."""
    return clean(value[:limit]) if isinstance(value, str) else "" if value is None else f"({type(value).__name__})"


# Line ends, tabs and blanks of other widths become a blank; other invisible characters are removed.
_BLANK = {"Cc": " ", "Zs": " ", "Zl": " ", "Zp": " "}

"""What somebody who gives an order calls himself: a label for the log, bounded and cleaned; no proof of who it is."""

from __future__ import annotations

import unicodedata

MAX_LETTERS = 40
NAMELESS = "operator"  # a page that gives no name
_NOT_SIGNED = " (not signed)"  # behind a name that only a web node states


def clean(text: object) -> str | None:
    """The label as one line of at most 40 printable characters; None if nothing remains.

    Control and bidirectional characters are removed, because a name must not change the log line that it is in.
    """
    if not isinstance(text, str):
        return None
    start = text[: 8 * MAX_LETTERS]
    seen = "".join(letter if unicodedata.category(letter)[0] not in "CZ" else " " for letter in start)
    return " ".join(seen.split())[:MAX_LETTERS].strip() or None


def not_signed(name: str) -> str:
    """A name that only a web node states; the end that marks it is never cut off."""
    return f"{name[: MAX_LETTERS - len(_NOT_SIGNED)]}{_NOT_SIGNED}"


def with_person(person: str, device: str) -> str:
    """How an order of a person at a device is signed: "A. K. (Pixel 7)"."""
    return f"{person} ({device})"


def person_of(signed: str) -> str | None:
    """The person in a name made by `with_person`; None: it is of a device or a program. No person's name has a
    bracket, but the name of a device may: compare what is found with names of people."""
    person, bracket, _ = signed.partition(" (")
    return person if bracket and signed.endswith(")") else None


def of_program(user_agent: str | None) -> str:
    """The name of a program that sends none: "api · curl"."""
    product = clean((user_agent or "").split("/", 1)[0].split(" ", 1)[0])
    return clean(f"api · {product}") if product else "api"  # type: ignore[return-value]

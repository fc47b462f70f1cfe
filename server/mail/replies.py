"""Mail server replies in displayable form, and the reason why a mail was not accepted."""

from __future__ import annotations

import base64
import binascii
import re

_LONGEST = 300
_BASE64 = re.compile(r"[A-Za-z0-9+/]{4,}={0,2}")


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

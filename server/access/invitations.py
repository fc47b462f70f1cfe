"""Invitations: a token for the QR link and a PIN to type, valid for one device and ten minutes.

The first device that uses either token or PIN invalidates both. Time is an argument.
"""

from __future__ import annotations

import hmac
import secrets
from dataclasses import dataclass

from server.access.identity import Role

LASTS_S = 600.0
MOST_STANDING = 6  # each valid PIN makes a guess likelier; the oldest is dropped
PIN_DIGITS = 6
TOKEN_BYTES = 18  # 144 bits cannot be guessed, so unlike the PIN it needs no throttle


@dataclass(frozen=True, slots=True, kw_only=True)
class Invitation:
    """For one device, in one role."""

    token: str
    pin: str
    role: Role
    until_s: float  # on the server's monotonic clock


def new_token() -> str:
    return secrets.token_urlsafe(TOKEN_BYTES)


def new_pin() -> str:
    return f"{secrets.randbelow(10**PIN_DIGITS):0{PIN_DIGITS}d}"


class Invitations:
    """The valid invitations: not used, withdrawn or expired."""

    def __init__(self) -> None:
        self._standing: list[Invitation] = []

    def new(self, role: Role, *, now_s: float) -> Invitation:
        """One more; its PIN is another than those that stand."""
        pins = {one.pin for one in self.standing(now_s)}
        pin = new_pin()
        while pin in pins:
            pin = new_pin()
        made = Invitation(token=new_token(), pin=pin, role=role, until_s=now_s + LASTS_S)
        self.add(made, now_s=now_s)
        return made

    def add(self, invitation: Invitation, *, now_s: float) -> None:
        """One that was made elsewhere."""
        self._standing = [*self.standing(now_s), invitation][-MOST_STANDING:]

    def standing(self, now_s: float) -> list[Invitation]:
        """Oldest first."""
        self._standing = [one for one in self._standing if now_s < one.until_s]
        return list(self._standing)

    def take(self, *, token: str | None = None, pin: str | None = None, now_s: float) -> Invitation | None:
        """Use up and return the invitation with this token or PIN; None: there is none.

        All are compared in constant time.
        """
        found = None
        for one in self.standing(now_s):
            by_token = token is not None and _is_same(one.token, token)
            by_pin = pin is not None and _is_same(one.pin, pin)
            if by_token or by_pin:
                found = one
        if found is not None:
            self.withdraw(found)
        return found

    def withdraw(self, invitation: Invitation) -> None:
        """Withdraw the invitation."""
        self._standing = [one for one in self._standing if one is not invitation]


def _is_same(one: str, other: str) -> bool:
    return hmac.compare_digest(one.encode(), other.encode("utf-8", "surrogatepass"))

"""Invitations: a token and a PIN to type, valid for one device and ten minutes, and growing waits after wrong PINs.

`catgraph pair` is another process: it writes an invitation into the data folder, and the server takes it from there.
Each is a file of its own, of mode 0600, with a random name; it is gone as soon as the server has read it.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import os
import secrets
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path

from server.access import secret_file
from server.access.identity import Role

LASTS_S = 600.0
MOST_STANDING = 6  # with each valid PIN a random one is likelier to match; the oldest is dropped
PIN_DIGITS = 6
TOKEN_BYTES = 18  # 144 bits cannot be guessed, so unlike the PIN it needs no throttle

FEW = 3  # wrong tries of one peer before it waits
MANY = 10  # wrong tries of all together before all wait
LONGEST_ONE_S = 300.0
LONGEST_ALL_S = 30.0
FORGIVEN_AFTER_S = 900.0  # without another wrong try
MOST_PEERS = 1000


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
        """One more; its PIN differs from those that are valid."""
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


@dataclass(slots=True)
class _Tries:
    wrong: int = 0
    until_s: float = 0.0
    last_s: float = 0.0


class PinThrottle:
    """Growing waits after wrong PINs, per peer and for the whole server. Time is an argument.

    Counts wrong tries. A try is admitted and checked without an await between, so that parallel tries all count.
    """

    def __init__(self) -> None:
        self._all = _Tries()
        self._peers: OrderedDict[str, _Tries] = OrderedDict()

    def wait_s(self, peer: str, *, now_s: float) -> float:
        """How long `peer` must wait before its next try is looked at; 0: it may try."""
        mine = self._peers.get(peer)
        until_s = max(self._all.until_s, mine.until_s if mine is not None else 0.0)
        return max(0.0, until_s - now_s)

    def wrong(self, peer: str, *, now_s: float) -> None:
        """A try was wrong."""
        mine = self._peers.setdefault(peer, _Tries())
        self._peers.move_to_end(peer)
        while len(self._peers) > MOST_PEERS:
            self._peers.popitem(last=False)
        for tries, free, longest_s in ((mine, FEW, LONGEST_ONE_S), (self._all, MANY, LONGEST_ALL_S)):
            if now_s - tries.last_s > FORGIVEN_AFTER_S:
                tries.wrong = 0
            tries.wrong += 1
            tries.last_s = now_s
            if tries.wrong >= free:
                tries.until_s = now_s + min(longest_s, 2.0 ** min(tries.wrong - free + 1, 16))

    def right(self, peer: str) -> None:
        """The peer was admitted: its own wrong tries are forgotten, those of the others are not."""
        self._peers.pop(peer, None)


log = logging.getLogger("catgraph.access")

_FOLDER = "waiting"
_RUNNING = "running.json"
_MOST = 20


def announce_server(folder: Path, address: str) -> None:
    """The server runs now and is reached there. Raises OSError."""
    secret_file.write(folder / _RUNNING, {"pid": os.getpid(), "address": address})


def retire_server(folder: Path) -> None:
    """The server ends."""
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        found = secret_file.read(folder / _RUNNING)
        if found is not None and found["pid"] == os.getpid():
            (folder / _RUNNING).unlink()


def running_server(folder: Path) -> str | None:
    """Where the server of this folder is reached; None: none runs that needs pairing. Raises OSError."""
    try:
        found = secret_file.read(folder / _RUNNING)
        if found is None:
            return None
        pid, address = int(found["pid"]), str(found["address"])
    except (ValueError, TypeError, KeyError):
        return None
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return None
    except PermissionError:
        pass  # it runs as somebody else
    return address


def lay_invitation(folder: Path, role: Role, *, wall_ms: int) -> Invitation:
    """Write a new invitation into the folder; its reader computes the expiry. Raises OSError."""
    made = Invitation(token=new_token(), pin=new_pin(), role=role, until_s=0.0)
    content = {"token": made.token, "pin": made.pin, "role": made.role, "made_ms": wall_ms}
    secret_file.write(folder / _FOLDER / f"{secrets.token_hex(8)}.json", content)
    return made


def collect_invitations(folder: Path, *, now_s: float, wall_ms: int) -> list[Invitation]:
    """The invitations written there since; they are removed from there."""
    found = []
    with contextlib.suppress(FileNotFoundError):
        for path in sorted((folder / _FOLDER).glob("*.json"))[:_MOST]:
            try:
                if (invitation := _read_pending(path, now_s=now_s, wall_ms=wall_ms)) is not None:
                    found.append(invitation)
                path.unlink()
            except (OSError, ValueError, TypeError, KeyError) as why:
                log.warning("an invitation cannot be read: %s", why)
                with contextlib.suppress(OSError):
                    path.unlink()
    return found


def _read_pending(path: Path, *, now_s: float, wall_ms: int) -> Invitation | None:
    if path.stat().st_uid != path.parent.stat().st_uid:
        raise ValueError(f"{path.name} is of another user than its folder")
    content = secret_file.read(path)
    token, pin = str(content["token"]), str(content["pin"])
    if len(token) < 20 or len(pin) != PIN_DIGITS:
        raise ValueError(f"{path.name} is no invitation")
    left_s = LASTS_S - max(0.0, (wall_ms - int(content["made_ms"])) / 1000)
    if left_s <= 0:
        return None
    return Invitation(token=token, pin=pin, role=Role(content["role"]), until_s=now_s + left_s)

"""Invitations of another process: `catgraph pair` lays one into the data folder, the server takes it from there.

Each is a file of its own, of mode 0600, named by chance; it is gone as soon as the server has read it.
"""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
from pathlib import Path

from server.access import secret_file
from server.access.identity import Role
from server.access.invitations import LASTS_S, PIN_DIGITS, Invitation, new_pin, new_token

log = logging.getLogger("catgraph.access")

_FOLDER = "waiting"
_RUNNING = "running.json"
_MOST = 20


def announce(folder: Path, address: str) -> None:
    """The server runs now and is reached there. Raises OSError."""
    secret_file.write(folder / _RUNNING, {"pid": os.getpid(), "address": address})


def retire(folder: Path) -> None:
    """The server ends."""
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        found = secret_file.read(folder / _RUNNING)
        if found is not None and found["pid"] == os.getpid():
            (folder / _RUNNING).unlink()


def running(folder: Path) -> str | None:
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


def lay(folder: Path, role: Role, *, wall_ms: int) -> Invitation:
    """Write a new invitation into the folder; its reader computes the expiry. Raises OSError."""
    made = Invitation(token=new_token(), pin=new_pin(), role=role, until_s=0.0)
    content = {"token": made.token, "pin": made.pin, "role": made.role, "made_ms": wall_ms}
    secret_file.write(folder / _FOLDER / f"{secrets.token_hex(8)}.json", content)
    return made


def collect(folder: Path, *, now_s: float, wall_ms: int) -> list[Invitation]:
    """The invitations written there since; they are removed from there."""
    found = []
    with contextlib.suppress(FileNotFoundError):
        for path in sorted((folder / _FOLDER).glob("*.json"))[:_MOST]:
            try:
                if (invitation := _read(path, now_s=now_s, wall_ms=wall_ms)) is not None:
                    found.append(invitation)
                path.unlink()
            except (OSError, ValueError, TypeError, KeyError) as why:
                log.warning("an invitation cannot be read: %s", why)
                with contextlib.suppress(OSError):
                    path.unlink()
    return found


def _read(path: Path, *, now_s: float, wall_ms: int) -> Invitation | None:
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

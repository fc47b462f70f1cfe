"""The devices that were paired: name, role, when each was last seen, and the hash of its secret. Kept in one file.

The secret itself lies only in the cookie of the device; its 256 random bits need no slow hash.
"""

from __future__ import annotations

import hashlib
import hmac
import logging
import secrets
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from server.access import secret_file
from server.access.identity import Role
from server.control import display_name
from server.storage.set_aside import set_aside

log = logging.getLogger("catgraph.access")

FILE = "devices.json"
FORGOTTEN_AFTER_MS = 90 * 86_400_000  # a phone that did not come for a season pairs again
MOST = 100  # the one not seen for longest goes
SEEN_EVERY_MS = 60_000  # how finely "last seen" is kept on the disk


@dataclass(frozen=True, slots=True, kw_only=True)
class Device:
    """One paired browser."""

    id: str
    name: str
    role: Role
    secret_sha256: str
    paired_ms: int
    seen_ms: int


class Devices:
    """All of them. What changes who may come in is on the disk before it is answered."""

    def __init__(self, folder: Path | None) -> None:
        """`folder` None: they last as long as this run. Raises OSError where the file cannot be read."""
        self._path = None if folder is None else folder / FILE
        self._devices: dict[str, Device] = {}
        self.server = secrets.token_hex(4)  # tells the cookies of two servers on one host apart
        self.signing_key = secrets.token_hex(32)
        self._saved_ms = 0
        self._version = 0
        self._written = 0
        self._writing = threading.Lock()
        if self._path is not None:
            self._load(self._path)

    def all(self) -> list[Device]:
        """Newest first."""
        return sorted(self._devices.values(), key=lambda one: (one.paired_ms, one.id), reverse=True)

    def get(self, id: str) -> Device | None:
        return self._devices.get(id)

    def known(self, id: str, secret: str, *, now_ms: int) -> Device | None:
        """The device whose secret this is, if it was seen of late."""
        device = self._devices.get(id)
        expected = device.secret_sha256 if device is not None else _hash("")
        is_right = hmac.compare_digest(expected, _hash(secret))
        if device is None or not is_right or now_ms - device.seen_ms > FORGOTTEN_AFTER_MS:
            return None
        return device

    def add(self, name: str, role: Role, *, now_ms: int) -> tuple[Device, str]:
        """A new device and its secret, which nobody is told but the device. Raises OSError: it is not paired then."""
        secret = secrets.token_urlsafe(32)
        device = Device(
            id=secrets.token_hex(6),
            name=self._own_name(display_name.clean(name) or "Phone"),
            role=role,
            secret_sha256=_hash(secret),
            paired_ms=now_ms,
            seen_ms=now_ms,
        )
        before = dict(self._devices)
        self._devices[device.id] = device
        self._drop_oldest(now_ms)
        self._save_or(before, now_ms)
        return device, secret

    def change(self, id: str, *, role: Role | None, name: str | None, now_ms: int) -> Device | None:
        """The device with another role or name; None: there is none. Raises OSError: nothing changed then."""
        device = self._devices.get(id)
        if device is None:
            return None
        before = dict(self._devices)
        changed = replace(device, role=role or device.role, name=name or device.name)
        self._devices[id] = changed
        self._save_or(before, now_ms)
        return changed

    def remove(self, id: str, *, now_ms: int) -> Device | None:
        """It may not come in any more, whatever becomes of the file: `OSError` says that it would after a restart."""
        device = self._devices.pop(id, None)
        if device is not None:
            self._save(now_ms)
        return device

    def seen(self, id: str, *, now_ms: int) -> Callable[[], None] | None:
        """It was here now. What is returned writes it to the disk, where it is time for that: in a thread, for no page
        shall wait for the disk. A disk that is full ends nobody's session."""
        device = self._devices.get(id)
        if device is None:
            return None
        self._devices[id] = replace(device, seen_ms=max(now_ms, device.seen_ms))
        return None if now_ms - self._saved_ms < SEEN_EVERY_MS else self.seen_on_disk(now_ms=now_ms)

    def seen_on_disk(self, *, now_ms: int) -> Callable[[], None]:
        """What writes when each was last seen."""
        self._saved_ms = now_ms
        version, content = self._content()

        def write() -> None:
            try:
                self._write(version, content)
            except OSError as why:
                log.warning("when devices were last seen cannot be kept: %s", why)

        return write

    def _own_name(self, name: str) -> str:
        taken = {one.name for one in self._devices.values()}
        numbers = (f"{name[: display_name.MAX_LETTERS - 4].strip()} {n}" for n in range(2, MOST + 2))
        return name if name not in taken else next(one for one in numbers if one not in taken)

    def _drop_oldest(self, now_ms: int) -> None:
        kept = [one for one in self._devices.values() if now_ms - one.seen_ms <= FORGOTTEN_AFTER_MS]
        kept.sort(key=lambda one: one.seen_ms)
        self._devices = {one.id: one for one in kept[-MOST:]}

    def _save_or(self, before: dict[str, Device], now_ms: int) -> None:
        try:
            self._save(now_ms)
        except OSError:
            self._devices = before
            raise

    def _save(self, now_ms: int) -> None:
        self._saved_ms = now_ms
        self._write(*self._content())

    def _content(self) -> tuple[int, Mapping[str, Any]]:
        self._version += 1
        devices = [asdict(one) for one in self._devices.values()]
        return self._version, {"server": self.server, "signing_key": self.signing_key, "devices": devices}

    def _write(self, version: int, content: Mapping[str, Any]) -> None:
        """Never an older list over a newer one: who was removed meanwhile would be in it again."""
        with self._writing:
            if self._path is not None and version > self._written:
                secret_file.write(self._path, content)
                self._written = version

    def _load(self, path: Path) -> None:
        try:
            found = secret_file.read(path)
            if found is None:
                self._save(0)
                return
            server, key = str(found["server"]), str(found["signing_key"])
            devices = [_device(one) for one in found["devices"]]
            if len(server) != 8 or len(key) < 64:
                raise ValueError("its keys are too short")
        except (ValueError, KeyError, TypeError) as why:
            aside = set_aside(path, "damaged")
            log.error("the list of paired devices cannot be read (%s): all pair anew; it is kept as %s", why, aside)
            self._save(0)
            return
        self.server, self.signing_key = server, key
        self._devices = {one.id: one for one in devices}


def _device(found: Mapping[str, Any]) -> Device:
    digest = str(found["secret_sha256"])
    if len(digest) != 64:
        raise ValueError("a hash is not one")
    return Device(
        id=str(found["id"]),
        name=str(found["name"]),
        role=Role(found["role"]),
        secret_sha256=digest,
        paired_ms=int(found["paired_ms"]),
        seen_ms=int(found["seen_ms"]),
    )


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()

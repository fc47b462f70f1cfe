"""The paired devices: name, role, last visit and the hash of the secret. Stored in one file.

The secret itself is only in the device's cookie; 256 random bits need no slow hash.
"""

from __future__ import annotations

import hashlib
import hmac
import logging
import secrets
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from server.access import secret_file
from server.access.identity import Role
from server.control import display_name
from server.storage.durable_file import set_aside
from server.storage.storage_thread import StorageThread

log = logging.getLogger("catgraph.access")

FILE = "devices.json"
FORGOTTEN_AFTER_MS = 90 * 86_400_000  # a phone unused for a season must be paired again
MOST = 100  # the one with the oldest visit is dropped
SEEN_EVERY_MS = 60_000  # how finely "last seen" is kept on the disk


@dataclass(frozen=True, slots=True, kw_only=True)
class Device:
    """One paired browser."""

    id: str
    name: str
    role: Role
    secret_sha256: str
    paired_ms: int
    changed_ms: int  # its name or role
    seen_ms: int


class Devices:
    """All paired devices. A change of access is on the disk before it is answered.

    A change counts in memory at once. The lists are written in the order in which they were made, so that none brings
    back who was removed meanwhile.
    """

    def __init__(self, folder: Path | None, *, storage: StorageThread | None = None) -> None:
        """`folder` None: they last as long as this run. `storage`: the thread that writes; None: the caller writes.

        Raises OSError where the file cannot be read.
        """
        self._path = None if folder is None else folder / FILE
        self._storage = storage
        self._devices: dict[str, Device] = {}
        self.server = secrets.token_hex(4)  # distinguishes the cookies of two servers on one host
        self.signing_key = secrets.token_hex(32)
        self.removed: dict[str, int] = {}  # when [ms]: nobody brings them back
        self.on_kept: Callable[[], None] = lambda: None  # called with each list that is written
        self._saved_ms = 0
        if self._path is not None:
            self._load(self._path)

    def all(self) -> list[Device]:
        """Newest first."""
        return sorted(self._devices.values(), key=lambda one: (one.paired_ms, one.id), reverse=True)

    def get(self, id: str) -> Device | None:
        return self._devices.get(id)

    def known(self, id: str, secret: str, *, now_ms: int) -> Device | None:
        """The device with this secret, if its last visit is recent."""
        device = self._devices.get(id)
        expected = device.secret_sha256 if device is not None else _hash("")
        is_right = hmac.compare_digest(expected, _hash(secret))
        if device is None or not is_right or now_ms - device.seen_ms > FORGOTTEN_AFTER_MS:
            return None
        return device

    async def add(self, name: str, role: Role, *, now_ms: int) -> tuple[Device, str]:
        """Add a device; return it with its secret, which only the device gets. Raises OSError: not paired then."""
        secret = secrets.token_urlsafe(32)
        device = Device(
            id=secrets.token_hex(6),
            name=self._own_name(display_name.clean(name) or "Phone"),
            role=role,
            secret_sha256=_hash(secret),
            paired_ms=now_ms,
            changed_ms=now_ms,
            seen_ms=now_ms,
        )
        before = dict(self._devices)
        self._devices[device.id] = device
        self._drop_oldest(now_ms)
        dropped = {id: one for id, one in before.items() if id not in self._devices}
        for id in dropped:
            self._note_removed(id, now_ms)
        try:
            await self.save(now_ms=now_ms)
        except OSError:
            self._devices.pop(device.id, None)
            self._devices |= dropped
            for id in dropped:
                self.removed.pop(id, None)
            raise
        return device, secret

    def change(self, id: str, *, role: Role | None, name: str | None, now_ms: int) -> Device | None:
        """The device with another role or name, which `save` keeps; None: there is none."""
        device = self._devices.get(id)
        if device is None:
            return None
        changed = self._devices[id] = replace(
            device, role=role or device.role, name=name or device.name, changed_ms=now_ms
        )
        return changed

    def remove(self, id: str, *, now_ms: int) -> Device | None:
        """Remove the device; `save` stores the change."""
        device = self._devices.pop(id, None)
        if device is not None:
            self._note_removed(id, now_ms)
        return device

    def _note_removed(self, id: str, now_ms: int) -> None:
        self.removed[id] = now_ms
        self.removed = dict(sorted(self.removed.items(), key=lambda one: one[1])[-MOST:])

    def put(self, device: Device) -> None:
        """A device as another server has it; `save` or `save_seen` stores it."""
        self._devices[device.id] = device

    async def save(self, *, now_ms: int) -> None:
        """Returns once the disk has the list. Raises OSError: a restart brings back the one before."""
        self._saved_ms = now_ms
        write = partial(self._write, self._content())
        if self._storage is None:
            write()
        else:
            await self._storage.run(write)
        self.on_kept()

    def seen(self, id: str, *, now_ms: int) -> None:
        """Record a visit. It is written once a minute, in the background; errors are logged only."""
        device = self._devices.get(id)
        if device is None:
            return
        self._devices[id] = replace(device, seen_ms=max(now_ms, device.seen_ms))
        if now_ms - self._saved_ms >= SEEN_EVERY_MS:
            self.save_seen(now_ms=now_ms)

    def save_seen(self, *, now_ms: int) -> None:
        """Write the last visits in the background; a full disk ends no session."""
        self._saved_ms = now_ms
        content = self._content()

        def write() -> None:
            try:
                self._write(content)
            except OSError as why:
                log.warning("when devices were last seen cannot be kept: %s", why)

        if self._storage is None:
            write()
        else:
            self._storage.submit(write)
        self.on_kept()

    def _own_name(self, name: str) -> str:
        taken = {one.name for one in self._devices.values()}
        numbers = (f"{name[: display_name.MAX_LETTERS - 4].strip()} {n}" for n in range(2, MOST + 2))
        return name if name not in taken else next(one for one in numbers if one not in taken)

    def _drop_oldest(self, now_ms: int) -> None:
        kept = [one for one in self._devices.values() if now_ms - one.seen_ms <= FORGOTTEN_AFTER_MS]
        kept.sort(key=lambda one: one.seen_ms)
        self._devices = {one.id: one for one in kept[-MOST:]}

    def _content(self) -> Mapping[str, Any]:
        devices = [asdict(one) for one in self._devices.values()]
        return {
            "server": self.server,
            "signing_key": self.signing_key,
            "devices": devices,
            "removed": dict(self.removed),
        }

    def _write(self, content: Mapping[str, Any]) -> None:
        if self._path is not None:
            secret_file.write(self._path, content)

    def _load(self, path: Path) -> None:
        try:
            found = secret_file.read(path)
            if found is None:
                self._write(self._content())
                return
            server, key = str(found["server"]), str(found["signing_key"])
            devices = [device_of(one) for one in found["devices"]]
            removed = {str(id): int(at_ms) for id, at_ms in found.get("removed", {}).items()}
            if len(server) != 8 or len(key) < 64:
                raise ValueError("its keys are too short")
        except (ValueError, KeyError, TypeError, AttributeError) as why:
            aside = set_aside(path, "damaged")
            log.error("the list of paired devices cannot be read (%s): all pair again; it is kept as %s", why, aside)
            self._write(self._content())
            return
        self.server, self.signing_key = server, key
        self._devices = {one.id: one for one in devices}
        self.removed = removed


def device_of(found: Mapping[str, Any]) -> Device:
    """Raises ValueError, KeyError or TypeError where it is none."""
    digest = str(found["secret_sha256"])
    if len(digest) != 64:
        raise ValueError("a hash is not one")
    return Device(
        id=str(found["id"]),
        name=str(found["name"]),
        role=Role(found["role"]),
        secret_sha256=digest,
        paired_ms=int(found["paired_ms"]),
        changed_ms=int(found.get("changed_ms", found["paired_ms"])),
        seen_ms=int(found["seen_ms"]),
    )


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()

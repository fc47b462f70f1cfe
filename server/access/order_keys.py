"""The keys of the devices that ordered something at this agent, and the name of each of them here.

A name belongs to the key that used it first. A list of the operator may limit them: then no other key counts.
"""

from __future__ import annotations

import contextlib
import logging
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from server.access import secret_file
from server.control import display_name
from server.protocol.signed_order import KEY_ID, short
from server.storage.storage_thread import StorageThread

log = logging.getLogger("catgraph.access")

FILE = "order_keys.json"
MOST = 500
KEEPS_NAME_MS = 60_000  # after it was called otherwise: who alternates names fills no log
LIST_LINE = re.compile(rf"({KEY_ID})\s+(\S.*)")


class BadList(ValueError):
    """The list of known devices cannot be used; `str()` is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownKey:
    """`claimed`: how the device calls itself; `name`: how it is called here."""

    name: str
    claimed: str
    first_ms: int


class OrderKeys:
    """Of one agent. What it notes is written in the background."""

    def __init__(self, folder: Path | None, *, storage: StorageThread | None = None) -> None:
        """`folder` None: they last as long as this run. Raises OSError where the file cannot be read."""
        self._path = None if folder is None else folder / FILE
        self._storage = storage
        self._known: dict[str, KnownKey] = {}
        self._renamed_ms: dict[str, int] = {}
        self._is_scheduled = False  # a write that has not begun
        if self._path is not None:
            self._load(self._path)

    def get(self, id: str) -> KnownKey | None:
        return self._known.get(id)

    @property
    def is_full(self) -> bool:
        return len(self._known) >= MOST

    def name(self, id: str, claimed: object, *, now_ms: int) -> tuple[str, str | None]:
        """How the device with this key is called here, and a sentence for the log where that is new."""
        wanted = display_name.clean(claimed) or display_name.NAMELESS
        before = self._known.get(id)
        if before is not None and before.claimed == wanted:
            return before.name, None
        if before is not None:
            if 0 <= now_ms - self._renamed_ms.get(id, now_ms - KEEPS_NAME_MS) < KEEPS_NAME_MS:
                return before.name, None
            self._renamed_ms[id] = now_ms
        name = self._free(id, wanted)
        first_ms = now_ms if before is None else before.first_ms
        self._known[id] = KnownKey(name=name, claimed=wanted, first_ms=first_ms)
        self._keep()
        if before is not None:
            return name, f"The device with key {short(id)}, {before.name} so far, is called {name} from now on."
        if name != wanted:
            return name, (
                f"A device with the new key {short(id)} calls itself {wanted}, a name that another key has: "
                f"it is called {name} here."
            )
        return name, f"First order of {name}, whose device has the key {short(id)}."

    def _free(self, id: str, wanted: str) -> str:
        """The name, or one that shows the key where another device has it."""
        taken = {key.name for other, key in self._known.items() if other != id}
        if wanted not in taken:
            return wanted
        for letters in (8, 16, 32):
            mark = f" · {id[1 : 1 + letters]}"
            name = f"{wanted[: display_name.MAX_LETTERS - len(mark)].strip()}{mark}"
            if name not in taken:
                return name
        return id

    def _keep(self) -> None:
        if self._path is None:
            return
        if self._storage is None:
            self._write(self._path)
        elif not self._is_scheduled:
            self._is_scheduled = True
            self._storage.submit(partial(self._write, self._path))

    def _write(self, path: Path) -> None:
        """On the thread of the disk: all of what is known by now."""
        self._is_scheduled = False
        _write(path, {id: asdict(key) for id, key in self._known.copy().items()})

    def _load(self, path: Path) -> None:
        try:
            found = secret_file.read(path) or {}
            self._known = {str(id): KnownKey(**key) for id, key in found.items()}
        except (ValueError, TypeError, AttributeError) as why:
            log.error("order_keys_not_read why=%s: every device is new to this agent", why)


def _write(path: Path, content: Mapping[str, Any]) -> None:
    try:
        secret_file.write(path, content)
    except OSError as why:
        log.warning("order_keys_not_kept why=%s", why)


class KnownDevices:
    """The operator's list: a line for each device with its key's id and its name, as in authorized_keys of SSH."""

    def __init__(
        self, path: Path, *, storage: StorageThread | None = None, now: Callable[[], float] = lambda: 0.0
    ) -> None:
        """Raises BadList."""
        self._path = path
        self._storage = storage
        self._now = now
        self._read_s = self._looked_s = now()
        self._is_looking = False
        self._stamp = _stamp(path)
        self._names = read_list(path)

    async def name(self, id: str) -> str | None:
        """The name of the device with this key; None: it is not in the list, also where that was read again."""
        if id not in self._names and self._now() - self._read_s >= 1.0:
            self._read_s = self._now()
            if self._storage is None:
                self._read()
            else:
                await self._storage.run(self._read)
        return self._names.get(id)

    def look(self) -> None:
        """Has the list read again where it was changed: in the background, once a second at most."""
        now_s = self._now()
        if self._is_looking or now_s - self._looked_s < 1.0:
            return
        self._looked_s = now_s
        if self._storage is None:
            return self._read_changed()
        self._is_looking = True
        with contextlib.suppress(RuntimeError):  # the storage is closed: this agent ends
            self._storage.submit(self._read_changed)

    def _read_changed(self) -> None:
        """On the thread of the disk."""
        try:
            if _stamp(self._path) != self._stamp:
                self._read()
        finally:
            self._is_looking = False

    def _read(self) -> None:
        """On the thread of the disk. A list that cannot be used leaves the one before."""
        self._stamp = _stamp(self._path)  # before it is read: a change meanwhile is seen the next time
        try:
            self._names = read_list(self._path)
        except BadList as why:
            log.warning("known_devices_not_read why=%s", why)


def _stamp(path: Path) -> tuple[int, int] | None:
    """Another one once the file was changed."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def read_list(path: Path) -> dict[str, str]:
    """Name by key. Raises BadList."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as why:
        raise BadList(
            f"The list of devices {path} cannot be read: {getattr(why, 'strerror', None) or 'no text'}."
        ) from None
    found: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        match = LIST_LINE.fullmatch(text)
        name = display_name.clean(match[2]) if match else None
        if match is None or name is None:
            raise BadList(f"{path}, line {number}: a device is written as its key, a space and its name.")
        if name in found.values() or match[1] in found:
            raise BadList(f"{path}, line {number}: this key or name is in the list already.")
        found[match[1]] = name
    return found

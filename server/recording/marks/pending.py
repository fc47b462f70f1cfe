"""Voice notes and photos of the present drive: on the disk before anything is answered, until a recording that is
complete holds them."""

from __future__ import annotations

import contextlib
import os
import threading
from dataclasses import dataclass
from pathlib import Path

from server.recording.marks.media import Kind, MediaName, find, name_of
from server.storage import durable_file

MOST_BYTES = 2 * 1024 * 1024 * 1024  # of all that waits
KEPT = "kept"  # folder of what no recording will take; it does not count as waiting


class NoRoom(Exception):
    """What waits fills its folder; `str()` is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Taken:
    """One file as it was when it was read."""

    path: Path
    data: bytes
    shape: tuple[int, int, int]


class PendingMedia:
    """Of one server: a folder for each vehicle. Its methods wait for the disk; they may be called from any thread."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._changing = threading.Lock()  # one keeps a new file while another removes the one before

    def folder(self, vehicle: str) -> Path:
        return self._root / vehicle

    def keep(self, vehicle: str, name: MediaName, data: bytes) -> bool:
        """Writes it durably, in place of another of the same kind; False: the same is there. Raises NoRoom, OSError."""
        folder = self.folder(vehicle)
        with self._changing:
            for path in (folder / name.file, folder / KEPT / name.file):
                with contextlib.suppress(FileNotFoundError):
                    if path.stat().st_size == len(data) and path.read_bytes() == data:
                        return False
            if self._bytes() + len(data) > MOST_BYTES:
                raise NoRoom(
                    f"Voice notes and photos that wait for a recording fill {MOST_BYTES >> 30} GB: "
                    "this one is not taken."
                )
            folder.mkdir(parents=True, exist_ok=True)
            before = [find(place, name.mark, name.kind) for place in (folder, folder / KEPT)]
            durable_file.write(folder / name.file, data)
            for old in before:
                if old is not None and old != folder / name.file:
                    old.unlink(missing_ok=True)
        return True

    def read(self, vehicle: str, mark: str, kind: Kind) -> tuple[MediaName, bytes] | None:
        """The voice note or the photo of a mark; None: there is none here."""
        for place in (self.folder(vehicle), self.folder(vehicle) / KEPT):
            path = find(place, mark, kind)
            with contextlib.suppress(OSError):  # a recording took it, or another came, just now
                if path is not None and (name := name_of(path.name)) is not None:
                    return name, path.read_bytes()
        return None

    def waiting(self, vehicle: str) -> dict[MediaName, Path]:
        """All that wait for a recording of a vehicle."""
        return _named(self.folder(vehicle))

    def files(self, vehicle: str) -> dict[MediaName, Path]:
        """All that wait, and all that were put aside."""
        return _named(self.folder(vehicle) / KEPT) | self.waiting(vehicle)

    def take(self, path: Path) -> Taken | None:
        """Reads one, to be removed with `remove`; None: it is not there any more. Raises OSError."""
        with self._changing, contextlib.suppress(FileNotFoundError):
            return Taken(path=path, data=path.read_bytes(), shape=_shape(path))
        return None

    def remove(self, taken: Taken) -> None:
        """Where it is still what was read: another that came meanwhile stays. Raises OSError."""
        with self._changing, contextlib.suppress(FileNotFoundError):
            if _shape(taken.path) == taken.shape:
                taken.path.unlink()

    def put_aside(self, vehicle: str, name: MediaName) -> None:
        """One that no recording will take. Raises OSError."""
        folder = self.folder(vehicle)
        with self._changing, contextlib.suppress(FileNotFoundError):
            (folder / KEPT).mkdir(exist_ok=True)
            os.replace(folder / name.file, folder / KEPT / name.file)
            durable_file.sync_folder(folder / KEPT)
            durable_file.sync_folder(folder)

    def _bytes(self) -> int:
        found = 0
        for path in self._root.glob("*/*"):
            with contextlib.suppress(FileNotFoundError):
                found += path.stat().st_size if path.is_file() else 0
        return found


def _named(folder: Path) -> dict[MediaName, Path]:
    if not folder.is_dir():
        return {}
    named = ((name_of(path.name), path) for path in folder.iterdir())
    return {name: path for name, path in named if name is not None}


def _shape(path: Path) -> tuple[int, int, int]:
    stat = path.stat()
    return stat.st_ino, stat.st_size, stat.st_mtime_ns

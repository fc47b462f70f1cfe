"""The folder of recordings: one subfolder per vehicle, names with vehicle and time, and unfinished files marked.

recordings/<vehicle>/<id>.mcap           closed, whole, never changed again
recordings/<vehicle>/<id>.mcap.writing   being written, or left by a server that was killed
recordings/<vehicle>/<id>.mcap.damaged   what could not be read again; kept for a repair by hand
recordings/.trash/                       deleted by the operator, and not yet gone
"""

from __future__ import annotations

import contextlib
import glob
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

FINISHED = ".mcap"
WRITING = ".mcap.writing"
DAMAGED = ".mcap.damaged"
RECOVERING = ".mcap.recovering"  # the new file while it is made; worth nothing when the maker was killed

FOLDER = "folder"  # the format of a recording that is a folder: a split bag of ROS 2

_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,79}")
_PART = re.compile(r"_p(\d+)(-\d+)?$")
_TRASH = ".trash"


class RecordingsFolder:
    """The recordings of one server. Nothing here makes a folder before something is to be written into it."""

    def __init__(self, root: Path) -> None:
        self.root = root

    @property
    def trash(self) -> Path:
        return self.root / _TRASH

    def path_of(self, id: str) -> Path | None:
        """The finished recording of that name; None where there is none. No name leads out of the folder."""
        if not is_id(id):
            return None
        return next((path for path in self.finished() if path.name == id + FINISHED), None)

    def finished(self) -> list[Path]:
        """All recordings that are closed, in the order of their names."""
        return sorted(self._files(FINISHED))

    def unfinished(self) -> list[Path]:
        """What is being written now, or was when a server ended."""
        return sorted(self._files(WRITING))

    def damaged(self) -> list[Path]:
        """What nothing could be read of, kept aside."""
        return sorted(self._files(DAMAGED))

    def first_id(self, vehicle: str, at_ms: int) -> str:
        """The name for a recording that starts at this time. The disk is not checked: the name may be in use."""
        stamp = datetime.fromtimestamp(at_ms / 1000, UTC).strftime("%Y%m%dT%H%M%SZ")
        return f"{_letters(vehicle)}_{stamp}"

    def new_id(self, vehicle: str, at_ms: int) -> str:
        """A name that nothing has yet, for what begins at that time of day."""
        return self.free_id(self.first_id(vehicle, at_ms))

    def free_id(self, first: str) -> str:
        """That name, or the next one that nothing has. Raises OSError."""
        taken = {id_of(path) for path in self._all()}
        for n in range(1, 10_000):
            id = first if n == 1 else f"{first}-{n}"
            if id not in taken:
                return id
        raise FileExistsError(f"ten thousand recordings are named {first}")

    def place(self, vehicle: str, id: str) -> Path:
        """Where the finished recording is to stand."""
        if not is_id(id):
            raise ValueError(f"{id[:90]!r} is not a valid name for a recording")
        return self.root / _letters(vehicle) / f"{id}{FINISHED}"

    def _all(self) -> Iterator[Path]:
        for ending in (FINISHED, WRITING, DAMAGED, RECOVERING):
            yield from self._files(ending)
        if self.trash.is_dir():  # a name is not given twice, or what is taken back from there would find it taken
            yield from self.trash.rglob(f"*{FINISHED}")

    def _files(self, ending: str) -> Iterator[Path]:
        if not self.root.is_dir():
            return
        for folder in self.root.iterdir():
            if folder.name == _TRASH or not folder.is_dir() or folder.is_symlink():
                continue
            for path in folder.iterdir():
                if path.name.endswith(ending) and is_id(path.name.removesuffix(ending)) and path.is_file():
                    yield path


def part_id(first: str, part: int) -> str:
    """The name of a session's part: the first has the session's own, the others end in _p2, _p3."""
    return first if part == 1 else f"{first}_p{part}"


def first_part(id: str) -> str:
    """The name of the first part of the session that a recording is of."""
    return _PART.sub("", id)


def part_number(id: str) -> int:
    """Which part of its session a recording is, by its name."""
    found = _PART.search(id)
    return 1 if found is None else int(found[1])


def known_beside(folder: Path) -> set[str]:
    """The names of all recordings of a vehicle's folder: finished, being written, unreadable, or in the trash."""
    return _named_beside(folder, (FINISHED, WRITING, DAMAGED))


def readable_beside(folder: Path) -> set[str]:
    """As `known_beside`, without what is known to be unreadable."""
    return _named_beside(folder, (FINISHED, WRITING))


def _named_beside(folder: Path, endings: tuple[str, ...]) -> set[str]:
    folder = folder.absolute()
    found = list(folder.glob("*.mcap*"))
    with contextlib.suppress(OSError):
        found += (folder.parent / _TRASH).glob(f"*/{glob.escape(folder.name)}/*{FINISHED}")
    return {id_of(path) for path in found if path.name.endswith(endings)}


def id_of(path: Path) -> str:
    """The recording's name in a file's, whatever its ending."""
    return path.name.partition(".")[0]


def is_id(text: str) -> bool:
    return _ID.fullmatch(text) is not None


def writing_path(finished: Path) -> Path:
    """The path of a recording until it is closed."""
    return finished.with_name(id_of(finished) + WRITING)


def _letters(vehicle: str) -> str:
    """A vehicle's name as file names may have it; a vehicle may be called by letters that not every system has."""
    plain = re.sub(r"[^A-Za-z0-9_-]", "-", vehicle)[:40]
    return plain if plain[:1].isalnum() else f"v{plain}"[:40]

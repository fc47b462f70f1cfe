"""Recordings below a folder, and what their path alone implies."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from server.recording.catalog import annotations as annotation_store
from server.recording.folder import DAMAGED, FINISHED, RECOVERING, WRITING, is_id

TRASH = ".trash"
_ENDINGS = (FINISHED, ".bag", ".db3", ".mcap.zstd", ".db3.zstd", DAMAGED)
_OTHERS = (*_ENDINGS, WRITING, RECOVERING)  # beside the parts of a bag: other recordings, whole or not
_PART = re.compile(r"(.+)_\d+\.(mcap|db3)(?:\.zstd)?")  # of a split bag of ROS 2
_METADATA = "metadata.yaml"
_LOGS = ("-wal", "-journal")  # of a database that was not closed
SEVERAL = "a folder of several files"  # what a split bag is
_DEEP = 3  # folders below the root that are looked into
_STAMP = re.compile(r"(\d{8}T\d{6})Z")


def id_of(inside: str) -> str:
    """The id of a file by its place below the folder: its own name where the recorder gave it, else one made of it.

    A recording that was copied in may be called anything, and as one in another folder is called too.
    """
    path = Path(inside)
    stem = path.name.partition(".")[0]
    if path.suffix == FINISHED and len(path.parts) == 2 and is_id(stem) and stem.startswith(f"{path.parts[0]}_"):
        return stem
    plain = re.sub(r"[^A-Za-z0-9_-]+", "-", stem).strip("-_")[:60] or "recording"
    return f"{plain}-{hashlib.sha256(os.fsencode(inside)).hexdigest()[:10]}"


def vehicle_of(found: dict[str, Any] | None, origin: str) -> str:
    kept = (found or {}).get("vehicle")
    folder = Path(origin).parts[0] if len(Path(origin).parts) > 1 else ""
    return annotation_store.line(kept or folder)[:40]


def started_ms_of(found: dict[str, Any] | None, name: str, changed_ns: int) -> int:
    """By what was recorded; until it is read by the name, else by the file's own time."""
    kept = (found or {}).get("started_ms")
    if isinstance(kept, int):
        return kept
    stamp = _STAMP.search(name)
    if stamp is not None:
        with contextlib.suppress(ValueError):
            return round(datetime.strptime(stamp[1], "%Y%m%dT%H%M%S").replace(tzinfo=UTC).timestamp() * 1000)
    return changed_ns // 1_000_000


def files_below(folder: Path) -> Iterator[Path]:
    """The recordings below a folder, and those in its trash; a split bag is its folder. No link is followed."""
    for at, folders, names in os.walk(folder):
        inside = Path(at).relative_to(folder).parts
        is_trash = inside[:1] == (TRASH,)
        is_bag = len(inside) > 2 * is_trash and bool(_bag(Path(at), folders, names))
        if is_trash and len(inside) > 1 and not (inside[1].isascii() and inside[1].isdigit() and len(inside[1]) < 16):
            folders.clear()
            continue
        deep = _DEEP + 2 if is_trash else _DEEP
        folders[:] = [
            name
            for name in folders
            if len(inside) < deep and (not name.startswith(".") or (name == TRASH and not inside))
        ]
        if is_trash and len(inside) < 2:
            continue
        if is_bag:
            yield Path(at)
            continue
        for name in names:
            path = Path(at, name)
            if name.endswith(_ENDINGS) and not name.startswith(".") and path.is_file() and not path.is_symlink():
                yield path


def _bag(folder: Path, folders: Sequence[str], names: Sequence[str]) -> list[Path]:
    """The files of the split bag that a folder is, the first part first; empty: it is none.

    It is one where nothing else is in it: no other recording, be it unfinished, no folder, and no notes of a part,
    which is then listed by itself with them. A vehicle's folder is one only while nothing else was recorded there.
    """
    parts = sorted(name for name in names if _PART.fullmatch(name))
    series = {(part[1], part[2]) for name in parts if (part := _PART.fullmatch(name)) is not None}
    if len(parts) < 2 or len(series) != 1 or folders:
        return []
    if any(name.endswith(_OTHERS) and name not in parts for name in names):
        return []
    paths = [folder / name for name in parts]
    if any(annotation_store.beside(path).name in names or path.is_symlink() or not path.is_file() for path in paths):
        return []
    if _METADATA not in names and folder.name not in {stem for stem, _ in series}:
        return []
    logs = [log for path in paths for log in logs_of(path) if log.name in names]
    return [*paths, *logs, *([folder / _METADATA] if _METADATA in names else [])]


def files_of(path: Path) -> list[Path]:
    """The files that are one recording: of a split bag its parts, their logs and its metadata, of a database also its
    log. Empty: it is a folder that is no recording (any more)."""
    if path.is_dir():
        _, folders, names = next(os.walk(path), ("", [], []))
        return _bag(path, folders, names)
    return [path, *(log for log in logs_of(path) if log.is_file())]


def why_not_one_file(path: Path) -> str | None:
    """What a recording is if no single file is a copy of it, as text behind "it is"; None: its file is all of it."""
    if path.is_dir():
        return SEVERAL
    with contextlib.suppress(FileNotFoundError):
        if any(file.stat().st_size for file in files_of(path)[1:]):
            return "a database with a log that holds a part of it"
    return None


def logs_of(path: Path) -> list[Path]:
    """What SQLite may have left beside a database."""
    return [path.with_name(path.name + end) for end in _LOGS] if path.name.endswith(".db3") else []


def shape_of(folder: Path) -> list[tuple[str, int]]:
    """A value that changes when a file below a folder is added, removed or renamed."""
    found = []
    for at, folders, _ in os.walk(folder):
        folders.sort()
        with contextlib.suppress(OSError):
            found.append((at, os.stat(at).st_mtime_ns))
    return found

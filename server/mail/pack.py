"""What is attached: the recordings as one compressed file, its SHA-256, and how it is cut in parts."""

from __future__ import annotations

import hashlib
import shutil
import threading
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from server.mail.compose import Stopped

_PIECE = 1 << 20
_LEVEL = 6  # zlib's own default: 1 and 9 differ by a few per cent on recordings, and 9 takes thrice the time
_SPARE_BYTES = 200_000_000  # left to the recorder, whatever is mailed


class NoRoom(Exception):
    """The disk has no room for it; `str()` is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """One file to be attached."""

    path: Path
    name: str
    size_bytes: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Bytes of the pack that go with one mail."""

    start: int
    length: int
    name: str


def pack(
    files: Sequence[Path],
    into: Path,
    name: str,
    at_ms: int,
    progress: Callable[[float], None],
    stop: threading.Event,
) -> Pack:
    """All files in one zip; a single one that is a zip already stays as it is. The same files make the same bytes.

    Raises OSError, Stopped, NoRoom.
    """
    whole = sum(path.stat().st_size for path in files) or 1
    if len(files) == 1 and files[0].suffix == ".zip":
        return _pack_of(files[0], f"{name}.zip", stop)
    need_room(into.parent, whole)
    when = datetime.fromtimestamp(at_ms // 1000, UTC)
    stamp = (min(max(when.year, 1980), 2107), when.month, when.day, when.hour, when.minute, when.second)
    done = 0
    with zipfile.ZipFile(into, "x", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL) as archive:
        for path in files:
            info = zipfile.ZipInfo(
                path.name, stamp
            )  # not the file's own time, so that a repeated copy gives the same zip
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            with open(path, "rb") as source, archive.open(info, "w", force_zip64=_is_huge(path)) as entry:
                while piece := source.read(_PIECE):
                    if stop.is_set():
                        raise Stopped
                    entry.write(piece)
                    done += len(piece)
                    progress(done / whole)
    return _pack_of(into, f"{name}.zip", stop)


def cut(pack: Pack, limit_bytes: int) -> list[Stretch]:
    """The pack in parts of at most `limit_bytes`, named .001, .002 … as 7-Zip and `cat` join them."""
    count = max(1, -(-pack.size_bytes // limit_bytes))
    if count == 1:
        return [Stretch(start=0, length=pack.size_bytes, name=pack.name)]
    digits = max(3, len(str(count)))
    return [
        Stretch(
            start=start,
            length=min(limit_bytes, pack.size_bytes - start),
            name=f"{pack.name}.{number:0{digits}}",
        )
        for number, start in enumerate(range(0, pack.size_bytes, limit_bytes), 1)
    ]


def need_room(folder: Path, size_bytes: int) -> None:
    """Raises NoRoom where the disk would be filled."""
    free = shutil.disk_usage(folder).free
    if free < size_bytes + _SPARE_BYTES:
        raise NoRoom(f"The disk has {free / 1e6:.0f} MB left; {(size_bytes + _SPARE_BYTES) / 1e6:.0f} MB are required.")


def _is_huge(path: Path) -> bool:
    """What zip of old cannot count; the newer kind is not for every unpacker, so it is kept for where it must be."""
    return path.stat().st_size > 2**31 - 2**20


def _pack_of(path: Path, name: str, stop: threading.Event) -> Pack:
    digest = hashlib.sha256()
    size = 0
    with open(path, "rb") as file:
        while piece := file.read(_PIECE):
            if stop.is_set():
                raise Stopped
            digest.update(piece)
            size += len(piece)
    return Pack(path=path, name=name, size_bytes=size, sha256=digest.hexdigest())

"""Writes a small file whole or not at all, or sets it aside under a free name.

After a loss of power a file holds either the old content or the new, and what cannot be read is never overwritten.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

_LONGEST_NAME = 100  # bytes of the name that the new file's own name repeats: 255 are possible

_MOST = 1000


def write(path: Path, content: bytes, *, mode: int | None = None) -> None:
    """Replaces the file, with `mode` whatever the umask is; None: as the umask gives it.

    Raises OSError, and then leaves the old file as it was.
    """
    new = _write_new(path, content, mode)
    try:
        os.replace(new, path)
    except BaseException:
        _remove(new)
        raise
    sync_folder(path.parent)


def create(path: Path, content: bytes, *, mode: int | None = None) -> bool:
    """Writes the file where there is none; False where another process made one meanwhile. Raises OSError."""
    new = _write_new(path, content, mode)
    try:
        try:
            os.link(new, path)
        except FileExistsError:
            return False
        except OSError:  # a file system without hard links, such as FAT
            os.replace(new, path)
    finally:
        _remove(new)
    sync_folder(path.parent)
    return True


def sync_folder(folder: Path) -> None:
    """Makes the names in a folder survive a loss of power. Raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write_new(path: Path, content: bytes, mode: int | None) -> Path:
    """A new file beside `path` with the content, written through to the disk."""
    new = path.with_name(f".{os.fsdecode(os.fsencode(path.name)[:_LONGEST_NAME])}.{secrets.token_hex(4)}.new")
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        with os.fdopen(os.open(new, flags, 0o666 if mode is None else mode), "wb") as file:
            if mode is not None:
                os.fchmod(file.fileno(), mode)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except BaseException:
        _remove(new)
        raise
    return new


def _remove(new: Path) -> None:
    with contextlib.suppress(OSError):
        new.unlink()


def free_name(path: Path, label: str = "unusable") -> Path:
    """`settings.toml` → `settings.unusable.toml`, then `settings.unusable-2.toml`, the first that does not exist."""
    first = path.with_name(f"{path.stem}.{label}{path.suffix}")
    others = (path.with_name(f"{path.stem}.{label}-{number}{path.suffix}") for number in range(2, _MOST))
    for name in (first, *others):
        if not os.path.lexists(name):
            return name
    raise FileExistsError(17, f"{_MOST} files beside {path.name} are set aside already")


def set_aside(path: Path, label: str = "unusable") -> Path:
    """Renames the file; its new name. Raises OSError: the file is where it was then."""
    aside = free_name(path, label)
    os.rename(path, aside)
    return aside

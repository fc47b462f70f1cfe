"""Writes to a path that a person gave: a file is replaced whole or not at all, anything else is written into.

A rename over a device, a pipe or a link takes its place: as root it would replace the machine's /dev/null by a file.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_LINKS = 40  # as many as the system follows
_DESCRIPTOR = re.compile(r"/(?:dev/fd|proc/(?:self|thread-self|\d+)/(?:task/\d+/)?fd)/(\d+)")
_STANDARD = {"/dev/stdin": 0, "/dev/stdout": 1, "/dev/stderr": 2}


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """The target of a path: `file` is created or replaced; otherwise data is written into the existing target."""

    path: Path  # as the person gave it
    file: Path | None = None  # behind all links
    descriptor: int | None = None  # one of our own, as /dev/stdout and a shell's >(…) name it

    @property
    def is_stdout(self) -> bool:
        """Whether it is our own standard output, by whatever name."""
        with contextlib.suppress(OSError):
            there = os.fstat(self.descriptor) if self.descriptor is not None else os.stat(self.path)
            return os.path.samestat(there, os.fstat(1))
        return False


def output_of(path: Path) -> Output:
    """What a path leads to. Raises OSError where nothing can be written there."""
    descriptor = _descriptor(path)
    if descriptor is not None:
        os.fstat(descriptor)
        return Output(path=path, descriptor=descriptor)
    try:
        there = os.stat(path)
    except FileNotFoundError:
        file = Path(os.path.realpath(path))  # a link may lead to what is not there yet
        if not file.parent.is_dir():
            shown = file.parent if path.is_symlink() else path.parent
            raise FileNotFoundError(errno.ENOENT, f"{shown} does not exist") from None
        return Output(path=path, file=file)
    if stat.S_ISDIR(there.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a directory")
    if stat.S_ISBLK(there.st_mode):
        raise OSError(errno.ENOTSUP, "it is a disk")
    if stat.S_ISSOCK(there.st_mode):
        raise OSError(errno.ENOTSUP, "it is a socket")
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return Output(path=path, file=Path(os.path.realpath(path)) if stat.S_ISREG(there.st_mode) else None)


@contextlib.contextmanager
def writing(output: Output) -> Iterator[Path]:
    """The path of a new file to write; at the end of the block it becomes the output. Raises OSError."""
    folder = output.file.parent if output.file is not None else None
    with tempfile.TemporaryDirectory(prefix=".export-", dir=folder) as name:
        new = Path(name) / "new"
        yield new
        if output.file is None:
            _pour(new, output)
            return
        with new.open("rb") as file:
            os.fsync(file.fileno())
        _take_after(new, output.file)
        os.replace(new, output.file)


def write(output: Output, content: bytes) -> None:
    """The content becomes the output. Raises OSError."""
    with writing(output) as new:
        new.write_bytes(content)


def _pour(new: Path, output: Output) -> None:
    descriptor = os.dup(output.descriptor) if output.descriptor is not None else os.open(output.path, os.O_WRONLY)
    with open(descriptor, "wb") as target, new.open("rb") as source:
        if stat.S_ISREG(os.fstat(descriptor).st_mode) and output.descriptor is None:
            raise OSError(errno.EBUSY, "it was replaced by a file meanwhile")
        shutil.copyfileobj(source, target, 1 << 20)


def _take_after(new: Path, old: Path) -> None:
    """Owner and mode of a file that is replaced are those of the new one."""
    with contextlib.suppress(OSError):
        there = os.stat(old)
        os.chmod(new, stat.S_IMODE(there.st_mode) & 0o777)
        os.chown(new, there.st_uid, there.st_gid)


def _descriptor(path: Path) -> int | None:
    """The number of our own descriptor that a path names; None: it names none."""
    at = Path(os.path.abspath(path))
    for _ in range(_LINKS):
        if (number := _STANDARD.get(str(at))) is not None:
            return number
        if (found := _DESCRIPTOR.fullmatch(str(at))) is not None:
            owner = re.match(r"/proc/(\d+)/", str(at))
            return int(found[1]) if owner is None or int(owner[1]) == os.getpid() else None
        if not at.is_symlink():
            return None
        at = Path(os.path.abspath(at.parent / os.readlink(at)))
    return None

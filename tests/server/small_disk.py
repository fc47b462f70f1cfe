"""A small disk that a test may fill. It is real: mounted for the test, which needs a user who may."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest


@contextlib.contextmanager
def small_disk(root: Path, size: int) -> Iterator[Path]:
    """A disk of `size` bytes at `root`; skips the test where this user may not mount one."""
    root.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(root)], capture_output=True, text=True
    )
    if done.returncode:
        pytest.skip(f"this user may not mount a disk: {done.stderr.strip()}")
    yield root
    subprocess.run(["umount", "--lazy", str(root)], check=True)


def fill(disk: Path, *, leave: int = 0) -> Path:
    """Another program takes the rest of the disk."""
    other = disk / "other"
    with other.open("ab", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass
        file.truncate(max(0, file.seek(0, 2) - leave))
    return other

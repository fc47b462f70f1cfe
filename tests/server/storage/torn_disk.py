"""A disk whose power can be cut: an ext4 on a loop device with direct I/O, above a disk with a volatile cache.

A copy has what the file system flushed, none of its page cache, and by chance some sectors of later writes.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

MEGABYTES = 64


def run(*command: str | Path) -> str:
    """What it prints. Raises CalledProcessError."""
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout.strip()


@contextlib.contextmanager
def mounted(image: Path, at: Path) -> Iterator[Path]:
    """The ext4 of an image, mounted by a loop device with direct I/O. Raises CalledProcessError."""
    at.mkdir()
    device = run("losetup", "--find", "--show", "--direct-io=on", image)
    try:
        run("mount", device, at)
        try:
            yield at
        finally:
            run("umount", "--lazy", at)
    finally:
        run("losetup", "--detach", device)


class TornDisk:
    """`folder` is on it."""

    def __init__(self, process: subprocess.Popen[str], folder: Path) -> None:
        self._process = process
        self.folder = folder

    def cut(self, copy: Path, seed: int) -> Path:
        """What a loss of power would leave now, as an image."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{seed} {copy}\n")
        self._process.stdin.flush()
        assert self._process.stdout.readline() == "cut\n"
        return copy


@contextlib.contextmanager
def torn_disk(folder: Path) -> Iterator[TornDisk]:
    """A disk of which copies are made; skips where loop devices or FUSE are not permitted."""
    if os.geteuid() != 0 or not all(map(shutil.which, ("losetup", "mkfs.ext4"))) or not Path("/dev/fuse").exists():
        pytest.skip("needs root, losetup, mkfs.ext4 and /dev/fuse")
    image, cache = folder / "disk.img", folder / "cache"
    with image.open("wb") as file:
        file.truncate(MEGABYTES * 2**20)
    run("mkfs.ext4", "-q", image)
    try:
        with mounted(image, folder / "trial"):
            pass
    except subprocess.CalledProcessError as why:
        pytest.skip(f"loop devices are not permitted: {why.stderr.strip()}")
    cache.mkdir()
    command = [sys.executable, "-m", "tests.server.storage.volatile_disk", str(image), str(cache)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        if process.stdout.readline() != "ready\n":
            pytest.skip("FUSE is not permitted")
        try:
            with mounted(cache / "disk", folder / "disk") as inner:
                yield TornDisk(process, inner)
        finally:
            run("umount", "--lazy", cache)
    finally:
        process.communicate()

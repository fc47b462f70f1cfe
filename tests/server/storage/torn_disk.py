"""A disk whose power can be cut: a copy of it at any moment, without what the page cache of its file system holds.

The disk is an image file behind a loop device with direct I/O: a write of its ext4 is in the file, or it is not. The
file is in a second ext4, which is frozen for the copy, so that the copy is of one moment.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

OUTER_MB, INNER_MB = 192, 128


def run(*command: str | Path) -> str:
    """What it prints. Raises CalledProcessError."""
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout.strip()


@contextlib.contextmanager
def mounted(image: Path, at: Path) -> Iterator[Path]:
    """The ext4 of an image, mounted by a loop device with direct I/O."""
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


def made(image: Path, megabytes: int) -> Path:
    """An image with an empty ext4."""
    with image.open("wb") as file:
        file.truncate(megabytes * 2**20)
    run("mkfs.ext4", "-q", image)
    return image


def demand_loop_devices(folder: Path) -> None:
    """Skips where they are not permitted."""
    if os.geteuid() != 0 or not all(map(shutil.which, ("losetup", "mkfs.ext4", "fsfreeze"))):
        pytest.skip("loop devices need root, losetup, mkfs.ext4 and fsfreeze")
    try:
        with mounted(made(folder / "trial.img", 8), folder / "trial"):
            pass
    except subprocess.CalledProcessError as why:
        pytest.skip(f"loop devices are not permitted: {why.stderr.strip()}")


class TornDisk:
    """`folder` is on it."""

    def __init__(self, outer: Path, folder: Path) -> None:
        self._outer = outer
        self.folder = folder

    def cut(self, copy: Path) -> Path:
        """What a loss of power would leave now, as an image."""
        run("fsfreeze", "--freeze", self._outer)
        try:
            run("cp", "--sparse=always", self._outer / "disk.img", copy)
        finally:
            run("fsfreeze", "--unfreeze", self._outer)
        return copy


@contextlib.contextmanager
def torn_disk(folder: Path) -> Iterator[TornDisk]:
    """A disk of which copies are made; skips where loop devices are not permitted."""
    demand_loop_devices(folder)
    with mounted(made(folder / "outer.img", OUTER_MB), folder / "outer") as outer:
        with mounted(made(outer / "disk.img", INNER_MB), folder / "disk") as inner:
            yield TornDisk(outer, inner)

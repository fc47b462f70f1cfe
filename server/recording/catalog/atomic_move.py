"""Moves a recording with what people said of it, so that a kill at any moment parts them not."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path

from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.discovery import files_of, logs_of


def move(source: Path, target: Path) -> bool:
    """Links the files of a recording and copies its annotations, renames its first file, and only then removes the
    rest at the old place. False: it is not there. Nothing else that is in its folder is touched.

    Whenever the server is killed meanwhile, one place has the whole recording with its annotations beside it; only the
    parts of a split bag can be at both places, where the disk has no hard links. Raises OSError, and then nothing was
    moved.
    """
    with annotation_store.CHANGING:  # else what is written meanwhile would stay behind
        media, media_there = annotation_store.media_beside(source), annotation_store.media_beside(target)
        said, there = annotation_store.beside(source), annotation_store.beside(target)
        files = moves(source, target)
        if not files:
            return False
        second = os.rename if source.is_dir() else shutil.copy2  # parts are too large to be copied
        brought: list[tuple[Path, Path]] = []
        try:
            files[0][1].parent.mkdir(parents=True, exist_ok=True)
            there.unlink(missing_ok=True)  # what an earlier kill left there is not of this one
            for old in logs_of(target):
                old.unlink(missing_ok=True)
            with contextlib.suppress(FileNotFoundError):
                shutil.copyfile(said, there)
            remove_folder(media_there)
            if media.is_dir():
                shutil.copytree(media, media_there, copy_function=_link)
            for file, new in files[1:]:
                _link(file, new, second)
                brought.append((file, new))
            is_there = files[0][0].exists()
            if is_there:
                os.rename(*files[0])
        except OSError:
            for file, new in brought:
                with contextlib.suppress(OSError):
                    new.unlink() if file.exists() else os.rename(new, file)
            with contextlib.suppress(OSError):
                there.unlink()
            with contextlib.suppress(OSError):
                remove_folder(media_there)
            raise
        for file in (*(file for file, _ in brought), said):
            with contextlib.suppress(OSError):
                file.unlink()
        with contextlib.suppress(OSError):
            remove_folder(media)
        return is_there


def moves(source: Path, target: Path) -> list[tuple[Path, Path]]:
    """Where each file of a recording is and where it comes to; empty: it is no recording."""
    if source.is_dir():
        return [(file, target / file.name) for file in files_of(source)]
    return [(file, target.with_name(target.name + file.name.removeprefix(source.name))) for file in files_of(source)]


def remove(recording: Path) -> None:
    """The files of a recording, where they are there, and nothing else that is in its folder. Raises OSError."""
    for file in files_of(recording):
        file.unlink(missing_ok=True)


def remove_folder(folder: Path) -> None:
    """A folder and what is in it, where there is one. Raises OSError."""
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(folder)


def _link(
    source: str | Path, target: str | Path, second: Callable[[str | Path, str | Path], object] = shutil.copy2
) -> None:
    """The same file under another name, where the disk has hard links; else by the second way. Raises OSError."""
    try:
        os.link(source, target)
    except FileExistsError:
        raise
    except OSError:
        second(source, target)


def tidy(path: Path, up_to: Path) -> None:
    """Empty folders that a recording left behind, itself among them."""
    with contextlib.suppress(OSError):
        for folder in (path, *path.parents) if path.is_dir() else path.parents:
            if folder == up_to or not folder.is_relative_to(up_to):
                break
            folder.rmdir()

"""Moves a recording with what people said of it, so that a kill at any moment parts them not."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.discovery import logs_of


def move(source: Path, target: Path) -> None:
    """Copies the annotations, renames the file, and only then removes the first copy of the annotations; so with the
    files of marks.

    Whenever the server is killed meanwhile, the recording has its annotations beside it. Raises OSError, and then
    nothing was moved.
    """
    with annotation_store.CHANGING:  # else what is written meanwhile would stay behind
        media, media_there = annotation_store.media_beside(source), annotation_store.media_beside(target)
        said, there = annotation_store.beside(source), annotation_store.beside(target)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            there.unlink(missing_ok=True)  # what an earlier kill left there is not of this one
            with contextlib.suppress(FileNotFoundError):
                shutil.copyfile(said, there)
            remove_folder(media_there)
            if media.is_dir():
                shutil.copytree(media, media_there, copy_function=_link)
            with contextlib.suppress(FileNotFoundError):
                os.rename(source, target)
            for log, moved in zip(logs_of(source), logs_of(target), strict=True):
                with contextlib.suppress(FileNotFoundError):
                    os.rename(log, moved)
        except OSError:
            with contextlib.suppress(OSError):
                there.unlink()
            with contextlib.suppress(OSError):
                remove_folder(media_there)
            raise
        with contextlib.suppress(OSError):
            said.unlink()
        with contextlib.suppress(OSError):
            remove_folder(media)


def remove(recording: Path) -> None:
    """A recording's file with what belongs to it, or its folder, where it is there. Raises OSError."""
    if recording.is_dir() and not recording.is_symlink():
        remove_folder(recording)
        return
    for file in (recording, *logs_of(recording)):
        file.unlink(missing_ok=True)


def remove_folder(folder: Path) -> None:
    """A folder and what is in it, where there is one. Raises OSError."""
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(folder)


def _link(source: str, target: str) -> None:
    """The same file under another name, where the disk has hard links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def tidy(path: Path, up_to: Path) -> None:
    """Empty folders that a file left behind."""
    with contextlib.suppress(OSError):
        for folder in path.parents:
            if folder == up_to or not folder.is_relative_to(up_to):
                break
            folder.rmdir()

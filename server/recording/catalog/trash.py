"""Deletes recordings, takes them back and destroys them: files and entries together.

A recording is moved with its annotations; a kill at any moment does not separate them.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from server.protocol.answers import Total
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.catalog_db import Entry
from server.recording.catalog.discovery import TRASH, files_of, logs_of
from server.recording.catalog.entries import Entries, NotThere, Refused
from server.recording.catalog.folder_listing import FolderListing
from server.recording.folder import WRITING, is_id


def move(source: Path, target: Path) -> bool:
    """Links the files of a recording and copies its annotations, renames its first file, and only then removes the
    rest at the old place. False: it is not there. Nothing else that is in its folder is touched.

    Whenever the server is killed meanwhile, one place has the whole recording with its annotations beside it; only the
    parts of a split bag can be at both places, where the disk has no hard links. Raises OSError, and then nothing was
    moved.
    """
    with annotation_store.CHANGING:  # else what is written meanwhile would stay behind
        media, media_there = annotation_store.media_beside(source), annotation_store.media_beside(target)
        annotations, there = annotation_store.beside(source), annotation_store.beside(target)
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
                shutil.copyfile(annotations, there)
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
        for file in (*(file for file, _ in brought), annotations):
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


class Trash:
    """Of one folder. Its methods may be called from any thread."""

    def __init__(self, folder: Path, entries: Entries, listing: FolderListing, *, wall_ms: Callable[[], int]) -> None:
        self._folder = folder
        self._entries = entries
        self._listing = listing
        self._wall_ms = wall_ms

    def delete(self, id: str) -> Entry:
        """Into the trash, where it stays until somebody empties it. Raises NotThere, Refused."""
        with self._entries.lock:
            if is_id(id) and any(self._folder.glob(f"*/{id}{WRITING}")):
                raise Refused("It is being recorded now: stop recording first.")
            entry = self._listing.need(id)
            now_ms = max(self._wall_ms(), 1)
            while (self._folder / TRASH / str(now_ms)).exists():  # a folder for each: see discovery
                now_ms += 1
            moved = replace(entry, path=f"{TRASH}/{now_ms}/{entry.path}", trashed_ms=now_ms)
            self._move(entry, moved)
            return moved

    def restore(self, id: str) -> Entry:
        """Out of the trash, to where it was. Raises NotThere, Refused."""
        with self._entries.lock:
            return self.put_back(self._listing.need(id, is_trashed=True))

    def put_back(self, entry: Entry) -> Entry:
        """Exactly this one. Raises NotThere, Refused."""
        with self._entries.lock:
            back = replace(entry, path=entry.path.split("/", 2)[2], trashed_ms=None)
            if self._is_taken(self._folder / entry.path, self._folder / back.path):
                raise Refused("A recording of that name exists: rename its file first.")
            self._move(entry, back)
            return back

    def destroy(self, id: str | None) -> Total:
        """For good: one of the trash, or with None all of it; how many and how large. Raises NotThere, Refused."""
        with self._entries.lock:
            chosen = (
                [self._listing.need(id, is_trashed=True)]
                if id
                else self._entries.select("WHERE trashed_ms IS NOT NULL", [])
            )
            return self.destroy_entries(chosen)

    def destroy_entries(self, chosen: Sequence[Entry]) -> Total:
        """Exactly these of the trash. Raises Refused."""
        with self._entries.lock:
            gone: list[Entry] = []
            try:
                for entry in chosen:
                    path = self._folder / entry.path
                    if files_of(path):  # else its folder holds others by now, which are listed by themselves
                        remove(path)
                        annotation_store.beside(path).unlink(missing_ok=True)
                        remove_folder(annotation_store.media_beside(path))
                    gone.append(entry)
            except OSError as why:
                raise Refused(f"It cannot be deleted: {(why.strerror or str(why)).lower()}.") from None
            finally:
                self._entries.forget([entry.path for entry in gone])
                for entry in gone:
                    tidy(self._folder / entry.path, self._folder / TRASH)
            return {"count": len(gone), "bytes": sum(entry.size for entry in gone)}

    def _is_taken(self, source: Path, target: Path) -> bool:
        """Whether something is where it would come to; of a folder, its files are put beside what is there now."""
        files = moves(source, target)
        return any(new.exists() for _, new in (files if source.is_dir() else files[:1]))

    def _move(self, old: Entry, new: Entry) -> None:
        source, target = self._folder / old.path, self._folder / new.path
        if not files_of(source):
            raise Refused("Its folder holds other recordings by now: look for its parts in the list.")
        try:
            is_moved = move(source, target)
        except OSError as why:
            raise Refused(f"It cannot be moved: {(why.strerror or str(why)).lower()}.") from None
        if not is_moved:
            self._entries.forget([old.path])
            raise NotThere("The recording no longer exists.")
        self._entries.forget([old.path])
        self._entries.put([new])
        if old.trashed_ms is not None:
            tidy(source, self._folder / TRASH)

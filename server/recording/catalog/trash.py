"""Deletes recordings, takes them back and destroys them: files and entries together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from server.protocol.answers import Total
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog import atomic_move
from server.recording.catalog.catalog_db import Entry
from server.recording.catalog.discovery import TRASH, files_of
from server.recording.catalog.entries import Entries
from server.recording.catalog.errors import NotThere, Refused
from server.recording.catalog.folder_listing import FolderListing
from server.recording.folder import WRITING, is_id


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
            while (self._folder / TRASH / str(now_ms)).exists():  # what was deleted lies alone: see discovery
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
                        atomic_move.remove(path)
                        annotation_store.beside(path).unlink(missing_ok=True)
                        atomic_move.remove_folder(annotation_store.media_beside(path))
                    gone.append(entry)
            except OSError as why:
                raise Refused(f"It cannot be deleted: {(why.strerror or str(why)).lower()}.") from None
            finally:
                self._entries.forget([entry.path for entry in gone])
                for entry in gone:
                    atomic_move.tidy(self._folder / entry.path, self._folder / TRASH)
            return {"count": len(gone), "bytes": sum(entry.size for entry in gone)}

    def _is_taken(self, source: Path, target: Path) -> bool:
        """Whether something is where it would come to; of a folder, its files are put beside what is there now."""
        files = atomic_move.moves(source, target)
        return any(new.exists() for _, new in (files if source.is_dir() else files[:1]))

    def _move(self, old: Entry, new: Entry) -> None:
        source, target = self._folder / old.path, self._folder / new.path
        if not files_of(source):
            raise Refused("Its folder holds other recordings by now: look for its parts in the list.")
        try:
            is_moved = atomic_move.move(source, target)
        except OSError as why:
            raise Refused(f"It cannot be moved: {(why.strerror or str(why)).lower()}.") from None
        if not is_moved:
            self._entries.forget([old.path])
            raise NotThere("The recording no longer exists.")
        self._entries.forget([old.path])
        self._entries.put([new])
        if old.trashed_ms is not None:
            atomic_move.tidy(source, self._folder / TRASH)

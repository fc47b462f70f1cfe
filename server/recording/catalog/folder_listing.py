"""Lists the files of a folder: what was just recorded, and what is found there by walking it."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Container
from pathlib import Path

from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.catalog_db import Entry
from server.recording.catalog.discovery import TRASH, files_below, files_of, id_of, shape_of, started_ms_of, vehicle_of
from server.recording.catalog.entries import Entries, NotThere
from server.recording.catalog.survey import VERSION

GROWS_MS = 120_000  # a file that changed this recently may still be copied
MAX_FRESH = 1000  # finished recordings that wait to be listed; more are found by walking the folder


class FolderListing:
    """Of one folder, which need not exist yet. Its methods may be called from any thread."""

    def __init__(self, folder: Path, entries: Entries, *, wall_ms: Callable[[], int]) -> None:
        self._folder = folder
        self._entries = entries
        self._wall_ms = wall_ms
        self._fresh: deque[Path] = deque(maxlen=MAX_FRESH)
        self._shape: object = None  # of the folders, when they were last walked

    def add(self, path: Path) -> None:
        """A recording was finished: list it at the next scan."""
        self._fresh.append(path)

    @property
    def has_fresh(self) -> bool:
        """Whether a finished recording waits to be listed."""
        return bool(self._fresh)

    def entry(self, id: str, *, is_trashed: bool = False) -> Entry | None:
        """One recording; None: it is not there."""
        self.list_fresh()
        return self._entries.by_id(id, is_trashed=is_trashed)

    def need(self, id: str, *, is_trashed: bool = False) -> Entry:
        """One recording. Raises NotThere."""
        entry = self.entry(id, is_trashed=is_trashed)
        if entry is None:
            raise NotThere("The recording is not in the trash." if is_trashed else "There is no such recording.")
        return entry

    def walk(self) -> None:
        """List what is in the folder: new and changed files; remove those that no longer exist."""
        known = {entry.path: entry for entry in self._entries.select("", [])}
        seen: set[str] = set()
        changed: list[Entry] = []
        for path in files_below(self._folder):
            entry = self.look(path, known.get(path.relative_to(self._folder).as_posix()))
            if entry is None:
                continue
            seen.add(entry.path)
            if entry != known.get(entry.path):
                changed.append(entry)
        # What was moved or renamed while the folder was walked is looked at once more.
        with self._entries.lock:
            self._entries.forget([path for path in known if path not in seen and self._is_gone(path, seen)])
            now = [self.look(self._folder / entry.path, known.get(entry.path)) for entry in changed]
            self._entries.put([entry for entry in now if entry is not None])

    def _is_gone(self, path: str, seen: Container[str]) -> bool:
        """Whether a file is there no more, or is now listed with others as one recording; or a folder is none."""
        place = self._folder / path
        return path.rpartition("/")[0] in seen or not place.exists() or (place.is_dir() and not files_of(place))

    def walk_if_changed(self) -> None:
        """Walks only where a folder or a file has changed.

        Looking at a thousand files takes the interpreter from the judge for some 50 ms, at their folders for 1.
        """
        shape = shape_of(self._folder)
        still_ns = (self._wall_ms() - GROWS_MS) * 1_000_000
        if shape != self._shape or self._entries.select("WHERE changed_ns > ? LIMIT 1", [still_ns]):
            self.walk()
            self._shape = shape

    def look(self, path: Path, known: Entry | None) -> Entry | None:
        """What is known of a file without reading it, and what was read of it if it is still the same."""
        try:
            stats = [file.stat() for file in files_of(path)]
        except OSError:
            return None
        if not stats:
            return None
        size, changed_ns = sum(stat.st_size for stat in stats), max(stat.st_mtime_ns for stat in stats)
        inside = path.relative_to(self._folder).as_posix()
        trashed_ms, origin = None, inside
        if inside.startswith(f"{TRASH}/"):
            _, stamp, origin = inside.split("/", 2)
            trashed_ms = int(stamp)
        is_same = known is not None and (known.size, known.changed_ns) == (size, changed_ns)
        found = known.found if is_same and known is not None else None
        if found is not None and found.get("survey") != VERSION:
            found = None
        return Entry(
            path=inside,
            id=id_of(origin),
            trashed_ms=trashed_ms,
            vehicle=vehicle_of(found, origin),
            started_ms=started_ms_of(found, path.name, changed_ns),
            size=size,
            changed_ns=changed_ns,
            found=found,
            annotations=annotation_store.read(path),
        )

    def list_fresh(self) -> None:
        """Lists what was added since; when it returns, that is listed, whichever thread did it."""
        with self._entries.lock:
            paths = list(self._fresh)
            entries = []
            for path in paths:
                with contextlib.suppress(ValueError):  # it is elsewhere
                    entry = self.look(path, None)
                    if entry is not None:
                        entries.append(entry)
            if entries:
                self._entries.put(entries)
            for path in paths:
                with contextlib.suppress(ValueError):  # more were added than are kept
                    self._fresh.remove(path)

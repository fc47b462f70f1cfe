"""The recordings that are in the store, of all cars: listed from their rows, and read as one file again."""

from __future__ import annotations

import hashlib
import logging
import re
import threading
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from server.protocol.answers import StoredList
from server.recording.catalog.entries import NotThere, Refused
from server.recording.store import names, row
from server.recording.store.object_store import Found, ObjectStore
from server.recording.store.row import BadRow, RowPart, StoredRow
from server.recording.store.trouble import Kind, StoreTrouble

log = logging.getLogger("catgraph.store")

FAILED_S = 5.0  # after a failure the list is not requested from the store
_WAITS_S = 2.0  # for the list that another request fetches
FRESH_S = 10.0  # the list is requested from the store again after this time
MOST_LISTED = 50_000
MAX_ROWS = 100  # a page
MOST_KEPT = 5_000  # rows in memory
MOST_DOWNLOADS = 4
_STAMP = re.compile(r"\d{8}T\d{6}Z")
Place = tuple[str, str]  # folder of the vehicle, id


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredFile:
    """A file in the store, to be read."""

    name: str
    size: int
    sha256: str
    keys: tuple[tuple[str, int], ...]  # object and its size, in order


class StoredRecordings:
    """Its methods may be called from any thread but the event loop's, and raise StoreTrouble."""

    def __init__(self, store: ObjectStore, *, now: Callable[[], float]) -> None:
        self._store = store
        self._now = now
        self._lock = threading.Lock()
        self._listed: list[tuple[Place, Found]] = []
        self._listed_s: float | None = None
        self._failed: tuple[float, StoreTrouble] | None = None  # when, and what
        self._rows: dict[str, tuple[str, StoredRow | None]] = {}  # key → version, and what it holds
        self._downloads = threading.BoundedSemaphore(MOST_DOWNLOADS)

    @property
    def address(self) -> str:
        return self._store.address.text

    def page(self, *, vehicle: str | None, cursor: str | None, limit: int) -> StoredList:
        """Newest first, by the time in the name. Raises Refused."""
        folder = None if vehicle is None else names.vehicle_folder(vehicle)
        listed = [one for one in self._list() if folder is None or one[0][0] == folder]
        start = 0
        if cursor is not None:
            places = ["/".join(place) for place, _ in listed]
            if cursor not in places:
                raise Refused("That page of the list does not exist: start again.")
            start = places.index(cursor) + 1
        chosen = listed[start : start + max(1, min(limit, MAX_ROWS))]
        rows = [found for one in chosen if (found := self._row(*one)) is not None]
        more = start + len(chosen) < len(listed)
        return {
            "store": self.address,
            "recordings": [one.as_json() for one in rows],
            "next": "/".join(chosen[-1][0]) if more and chosen else None,
            "count": len(listed),
        }

    def file(self, folder: str, id: str) -> StoredFile:
        """The whole file of a recording. Raises NotThere."""
        found = self._need(folder, id).stored_file
        if found is None:
            raise NotThere("The whole file is not in the store.")
        return StoredFile(
            name=found.name, size=found.size, sha256=found.sha256, keys=self._keys(folder, id, found.parts, found.size)
        )

    def clip(self, folder: str, id: str, name: str) -> StoredFile:
        """One of its clips. Raises NotThere."""
        for clip in self._need(folder, id).stored_clips:
            if clip.name == name:
                return StoredFile(
                    name=f"{id}_{name}",
                    size=clip.size,
                    sha256=clip.sha256,
                    keys=self._keys(folder, id, [clip], clip.size),
                )
        raise NotThere("There is no such clip in the store.")

    def read(self, file: StoredFile) -> Iterator[bytes]:
        """Its content. Raises Refused before the first byte where too many are read already."""
        if not self._downloads.acquire(blocking=False):
            raise Refused(f"{MOST_DOWNLOADS} files are being fetched from the store already: try again later.")
        return _Reading(self._portions(file), self._downloads.release)

    def _portions(self, file: StoredFile) -> Iterator[bytes]:
        """The last portion comes only where the whole is what was verified: else the download breaks off."""
        digest, held = hashlib.sha256(), b""
        for key, size in file.keys:
            for portion in self._store.read(key, size):
                digest.update(portion)
                if held:
                    yield held
                held = portion
        if digest.hexdigest() != file.sha256:
            raise StoreTrouble(Kind.OTHER, "The copy in the store is not what it was.")
        yield held

    def _need(self, folder: str, id: str) -> StoredRow:
        if not names.is_place(folder, id):
            raise NotThere("There is no such recording in the store.")
        try:
            return row.read(self._store.get(f"{names.ROWS}{folder}/{id}.json", most=row.MOST_BYTES), folder, id)
        except StoreTrouble as why:
            if why.kind is Kind.MISSING:
                raise NotThere("There is no such recording in the store.") from None
            raise
        except BadRow as why:
            raise NotThere(str(why)) from None

    def _keys(
        self, folder: str, id: str, parts: list[RowPart] | list[row.RowClip], size: int
    ) -> tuple[tuple[str, int], ...]:
        if sum(part.size for part in parts) != size:
            raise NotThere("The row in the store contradicts itself.")
        return tuple((f"files/{folder}/{id}/{part.name}", part.size) for part in parts)

    def _list(self) -> list[tuple[Place, Found]]:
        if not self._lock.acquire(timeout=_WAITS_S):
            raise StoreTrouble(Kind.BUSY, "The list of the store is being fetched: the store is slow. Try again later.")
        try:
            if self._listed_s is not None and self._now() - self._listed_s <= FRESH_S:
                return self._listed
            if self._failed is not None and self._now() - self._failed[0] < FAILED_S:
                raise StoreTrouble(self._failed[1].kind, str(self._failed[1]))
            try:
                self._listed = self._fetched()
            except StoreTrouble as why:
                self._failed = (self._now(), why)
                raise
            self._listed_s, self._failed = self._now(), None
            return self._listed
        finally:
            self._lock.release()

    def _fetched(self) -> list[tuple[Place, Found]]:
        found = []
        for one in self._store.list(names.ROWS):
            place = names.place_of(one.key)
            if place is not None and one.size <= row.MOST_BYTES:
                found.append((place, one))
            if len(found) >= MOST_LISTED:
                log.warning("store_list_cut most=%d", MOST_LISTED)
                break
        return sorted(found, key=lambda one: (_stamp(one[0][1]), one[0]), reverse=True)

    def _row(self, place: Place, found: Found) -> StoredRow | None:
        """None: what is there is no row."""
        known = self._rows.get(found.key)
        if known is not None and known[0] == found.version:
            return known[1]
        try:
            read = row.read(self._store.get(found.key, most=row.MOST_BYTES), *place)
        except BadRow as why:
            log.warning("store_row_unreadable key=%s why=%s", found.key, why)
            read = None
        except StoreTrouble as why:
            if why.kind is not Kind.MISSING:
                raise
            return None
        if len(self._rows) >= MOST_KEPT:
            self._rows.clear()
        self._rows[found.key] = (found.version, read)
        return read


class _Reading(Iterator[bytes]):
    """Gives its place among the downloads free at its end, also where nobody reads on."""

    def __init__(self, portions: Iterator[bytes], release: Callable[[], object]) -> None:
        self._portions = portions
        self._close = weakref.finalize(self, release)

    def __next__(self) -> bytes:
        try:
            return next(self._portions)
        except BaseException:
            self._close()
            raise


def _stamp(id: str) -> str:
    """The time in a name, as the recorder gives it; what has none comes last."""
    found = _STAMP.search(id)
    return found.group() if found is not None else ""

"""What is done next: all rows before all clips, all clips before any whole file, and deletions last."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from server.protocol.answers import Recording
from server.recording.catalog.catalog import Catalog
from server.recording.catalog.entries import Refused
from server.recording.store.row import digest_of
from server.recording.store.rules import CLIP_PRIORITIES, Situation, StoreRule
from server.recording.store.uploads import Upload, Uploads

_PAGE = 20  # recordings at once: reading more would hold the interpreter for longer
FIRST_BACKOFF_MS, LAST_BACKOFF_MS = 5_000, 600_000

Kind = Literal["row", "clips", "file", "delete"]
_RANKS: dict[Kind, int] = {"row": 0, "clips": 1, "file": 2, "delete": 3}


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One step for one recording."""

    kind: Kind
    row: Recording

    @property
    def id(self) -> str:
        return self.row["id"]


def is_another(row: Recording, upload: Upload) -> bool:
    """Whether the store has a recording of this name that was deleted here, and is not this one."""
    proof = upload.verified
    return upload.is_deleted and proof is not None and (proof.size, proof.sha256) != (row["size_bytes"], row["sha256"])


def is_deletion_due(rule: StoreRule, upload: Upload) -> bool:
    """Whether the file is to be deleted here. What was deleted and came back is deleted again only on request."""
    return upload.is_deletion_asked or (rule.deletes and not upload.is_deleted)


def backoff_ms(tries: int) -> int:
    """The pause after that number of failures in succession."""
    return min(LAST_BACKOFF_MS, FIRST_BACKOFF_MS << min(tries - 1, 20))


class Plan:
    """Of the recordings of one server."""

    def __init__(
        self,
        catalog: Catalog,
        uploads: Uploads,
        situation: Callable[[Recording], Situation],
        why_not: Callable[[Recording, Upload], str | None],
        *,
        wall_ms: Callable[[], int],
    ) -> None:
        """`why_not` returns why the whole file is not sent now; None: it is."""
        self._catalog = catalog
        self._uploads = uploads
        self._situation = situation
        self._why_not = why_not
        self._wall_ms = wall_ms

    def next(self) -> Job | None:
        """The step that comes first; None: there is nothing to do."""
        best: Job | None = None
        best_place: tuple[int, int, int] | None = None
        for row in self._rows():
            upload = self._uploads.get(row["id"])
            kind = self._step(row, upload)
            if kind is None:
                continue
            newest_first = -row["started_ms"]
            order = newest_first if kind in ("row", "clips") else row["started_ms"]
            place = (_RANKS[kind], 0 if upload.is_asked or row["is_clip"] else 1, order)
            if best_place is None or place < best_place:
                best, best_place = Job(kind=kind, row=row), place
                if kind == "row":
                    return best  # the list begins with the newest
        return best

    def is_stored(self, row: Recording, upload: Upload) -> bool:
        """Whether the copy was verified and the file is still what it was then."""
        proof = upload.verified
        return proof is not None and (proof.size, proof.sha256) == (row["size_bytes"], row["sha256"] or proof.sha256)

    def _step(self, row: Recording, upload: Upload) -> Kind | None:
        if row["state"] == "waiting":
            return None  # it is read soon
        if is_another(row, upload):
            return None
        if upload.row != digest_of(row, upload):
            return "row" if upload.failure is None or self._is_due(upload) else None
        if not self._is_due(upload):
            return None
        rule = self._situation(row).rule
        if rule.clips and not upload.clips_are_made and not row["is_clip"] and _has_moments(row):
            return "clips"
        if not self.is_stored(row, upload):
            return "file" if self._why_not(row, upload) is None else None
        return "delete" if is_deletion_due(rule, upload) else None

    def _is_due(self, upload: Upload) -> bool:
        return upload.failure is None or self._wall_ms() >= upload.failure.next_ms

    def _rows(self) -> Iterator[Recording]:
        cursor: str | None = None
        while True:
            try:
                page = self._catalog.rows(cursor=cursor, limit=_PAGE)
            except Refused:
                return
            yield from page.rows
            cursor = page.next
            if cursor is None:
                return


def _has_moments(row: Recording) -> bool:
    alarms = row["alarms"] or {}
    return any(alarms.get(priority, 0) for priority in CLIP_PRIORITIES)  # type: ignore[call-overload]

"""Recordings as a page gets them: one row each, newest first, a page at a time."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

import orjson

from server.protocol.answers import Recording, VerificationAnswer
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog import catalog_db
from server.recording.catalog.annotations import LATE
from server.recording.catalog.catalog_db import Entry, Which
from server.recording.catalog.discovery import SEVERAL
from server.recording.catalog.entries import Entries, Refused
from server.recording.catalog.verifications import Verifications
from server.recording.folder import DAMAGED, FINISHED, FOLDER

MAX_ROWS = 200  # a page
_CURSOR = re.compile(r"(-?\d{1,16})\.([A-Za-z0-9][A-Za-z0-9_-]{0,89})")


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """Some rows, newest first, and where the next page begins; None: there is none."""

    rows: list[Recording]
    next: str | None


def page_of(entries: Entries, which: Which, verifications: Verifications, *, cursor: str | None, limit: int) -> Page:
    """Newest first; those deleted last first among the deleted. Raises Refused."""
    where, values = catalog_db.condition(which)
    order = "trashed_ms" if which.is_trashed else "started_ms"
    if cursor is not None:
        at = _CURSOR.fullmatch(cursor)
        if at is None:
            raise Refused("That page of the list does not exist: start again.")
        where += f" AND ({order}, id) < (?, ?)"
        values += [int(at[1]), at[2]]
    limit = max(1, min(limit, MAX_ROWS))
    found = entries.select(f"WHERE {where} ORDER BY {order} DESC, id DESC LIMIT ?", [*values, limit + 1])
    page = found[:limit]
    more = len(found) > limit
    last = page[-1] if page else None
    at_ms = (last.trashed_ms if which.is_trashed else last.started_ms) if last else None
    return Page(
        rows=[_found(row_of(entry, verifications.of(entry)), entry, which.text) for entry in page],
        next=f"{at_ms}.{last.id}" if more and last else None,
    )


def _found(row: Recording, entry: Entry, text: str | None) -> Recording:
    """The row with the first mark in which the text of a search is."""
    if text:
        for mark in entry.marks:
            if text.casefold() in catalog_db.mark_text(mark):
                return {**row, "matched": mark}
    return row


def _format(name: str) -> str:
    """By the ending of the file; without one it is a folder."""
    return "mcap" if name.endswith((FINISHED, DAMAGED)) else Path(name).suffix[1:] or FOLDER


def _digest_of_late(entry: Entry) -> str:
    """Of the marks and descriptions beside the file; none: empty."""
    late = [getattr(entry.annotations, name) for name in LATE]
    return hashlib.sha256(orjson.dumps(late)).hexdigest()[:16] if any(late) else ""


def row_of(entry: Entry, verified: VerificationAnswer | None = None) -> Recording:
    """A recording as docs/protocol.md has it."""
    found = entry.found or {}
    problem = found.get("problem")
    name = Path(entry.path).name
    row: Recording = {
        "id": entry.id,
        "vehicle": entry.vehicle,
        "session": found.get("session"),
        "part": found.get("part"),
        "started_ms": entry.started_ms,
        "length_s": found.get("length_s"),
        "size_bytes": entry.size,
        "distance_m": found.get("distance_m"),
        "top_speed_mps": found.get("top_speed_mps"),
        "alarms": found.get("alarms"),
        "title": entry.annotations.title,
        "note": entry.annotations.note,
        "weather": entry.annotations.weather,
        "tags": list(entry.annotations.tags),
        "marks": len(entry.marks),
        "state": "waiting" if entry.found is None else "unreadable" if problem else "read",
        "problem": problem,
        "damage": found.get("damage", []),
        "unread": found.get("unread", []),
        "left_out": found.get("left_out", []),
        "left_out_count": found.get("left_out_count", 0),
        "not_received": found.get("not_received", []),
        "not_received_count": found.get("not_received_count", 0),
        "ros_version": found.get("ros_version"),
        "ended": found.get("ended"),
        "ended_why": found.get("ended_why"),
        "is_clip": found.get("is_clip", False),
        "clip_of": found.get("clip_of"),
        "file": annotation_store.line(name),
        "format": _format(name),
        "several_files": found.get("several_files") or (SEVERAL if _format(name) == FOLDER else None),
        "sha256": found.get("sha256"),
        "head": found.get("head"),
        "verified": verified,
        "thumbnail": f"/api/recordings/{entry.id}/track.svg",
        "sketch": found.get("sketch"),
        "trashed_ms": entry.trashed_ms,
    }
    if late := _digest_of_late(entry):
        row["late"] = late
    return row

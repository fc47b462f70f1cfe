"""Marks in events of the log, in entries of a recording and in files beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from server.protocol.marks import DriveMark
from server.system.clean_text import clean

CHANGES = ("mark", "mark_changed", "mark_removed")
MOST_WORDS = 2000
MOST_CATEGORY = 40
MOST_NAME = 200
_INFO = 2  # level of a line of a log, as foxglove.Log numbers them
MARK_ID = re.compile(r"[A-Za-z0-9-]{1,40}")
COMPARED = ("marked_ms", "category", "words", "voice", "photo")  # in which two events of a mark may differ


def row_of(event: Mapping[str, Any]) -> DriveMark | None:
    """The mark in an event or an entry of a recording; None: there is none."""
    mark, marked_ms, category, text = (event.get(name) for name in ("mark", "marked_ms", "category", "words"))
    source, by = event.get("source"), event.get("by")
    if not isinstance(mark, str) or not MARK_ID.fullmatch(mark) or not isinstance(marked_ms, int):
        return None
    if isinstance(marked_ms, bool) or abs(marked_ms) >= 2**53:
        return None
    return {
        "mark": mark,
        "marked_ms": marked_ms,
        "category": clean(category, MOST_CATEGORY) if isinstance(category, str) and category else None,
        "words": clean(text, MOST_WORDS) if isinstance(text, str) else "",
        "voice": event.get("voice") is True,
        "photo": event.get("photo") is True,
        "source": source if source in ("page", "http", "car") else "page",
        "by": clean(by, MOST_NAME) if isinstance(by, str) else None,
    }


def folded(events: Iterable[Mapping[str, Any]]) -> tuple[dict[str, DriveMark], set[str]]:
    """The marks after all their events, in order, and the ids of those that were taken back."""
    rows: dict[str, DriveMark] = {}
    removed: set[str] = set()
    for one in events:
        row, mark = row_of(one), one.get("mark")
        if not isinstance(mark, str):
            continue
        if one.get("change") == "mark_removed":
            removed.add(mark)
        elif row is not None:
            rows[mark] = row
    return {mark: row for mark, row in rows.items() if mark not in removed}, removed


def has_same_content(one: DriveMark, other: DriveMark | None) -> bool:
    """Whether both have the same content."""
    return other is not None and all(one[name] == other[name] for name in COMPARED)  # type: ignore[literal-required]


def entry(row: DriveMark, change: str) -> dict[str, Any]:
    """As the recording has it: a line of a log for viewers, and all of the mark."""
    shown = row["words"] or row["category"] or "Mark"
    if row["words"] and row["category"]:
        shown = f"{row['category']}: {row['words']}"
    prefix = {"mark": "", "mark_changed": "Changed: ", "mark_removed": "Taken back: "}[change]
    sec, ms = divmod(row["marked_ms"], 1000)
    return {
        "timestamp": {"sec": sec, "nsec": ms * 1_000_000},
        "level": _INFO,
        "message": f"{prefix}{shown}",
        "name": row["by"] or "car",
        "file": "",
        "line": 0,
        "change": change,
        **{name: value for name, value in row.items() if name not in ("at_s", "late")},
    }


def merged(recorded: Iterable[DriveMark], late: Iterable[DriveMark], removed: Iterable[str]) -> list[DriveMark]:
    """Marks of a recording with what came after it was complete, which holds; in the order of their moments."""
    found: dict[str, DriveMark] = {row["mark"]: row for row in recorded}
    for row in late:
        found[row["mark"]] = {**row, "late": True}
    gone = set(removed)
    return sorted((row for mark, row in found.items() if mark not in gone), key=lambda row: row["marked_ms"])

"""How long ago each car was checked before a drive, what was driven since, and which items are overdue."""

from __future__ import annotations

from collections.abc import Sequence

from server.protocol.departure import RecurringItem
from server.protocol.logbook import LogbookCheck, LogbookDrive, LogbookDue

MOST_VEHICLES = 200
DAY_MS = 86_400_000


def checks_of(drives: Sequence[LogbookDrive], now_ms: int) -> list[LogbookCheck]:
    """One for each car, by name. `drives`: all of them, oldest first, whatever else was requested."""
    by_vehicle: dict[str, list[LogbookDrive]] = {}
    for drive in drives:
        by_vehicle.setdefault(drive["vehicle"], []).append(drive)
    return [_check(vehicle, by_vehicle[vehicle], now_ms) for vehicle in sorted(by_vehicle)[:MOST_VEHICLES]]


def _check(vehicle: str, drives: Sequence[LogbookDrive], now_ms: int) -> LogbookCheck:
    """The drive that was checked counts as driven since, not as a drive without."""
    place = max((n for n, drive in enumerate(drives) if drive["departure"] == "signed"), default=None)
    signed = None if place is None else drives[place]
    since = drives[place or 0 :]
    without = since if signed is None else since[1:]
    distance_m, unmeasured = _driven(since)
    due = [] if signed is None else [_due(row, drives, now_ms) for row in signed["recurring"]]
    return {
        "vehicle": vehicle,
        "signed_ms": None if signed is None else signed["departure_ms"] or signed["started_ms"],
        "by": "" if signed is None else signed["departure_by"],
        "failed": 0 if signed is None else signed["departure_failed"],
        "failed_items": [] if signed is None else signed["failed_items"],
        "distance_m": distance_m,
        "unmeasured": unmeasured,
        "drives": len(without),
        "not_known": sum(drive["departure"] is None for drive in without),
        "recurring": sorted(due, key=lambda one: (not one["is_overdue"], _left(one), one["title"])),
    }


def _due(row: RecurringItem, drives: Sequence[LogbookDrive], now_ms: int) -> LogbookDue:
    """Counted from the newest signed check in which it was done. What was driven without being measured makes nothing
    late, and nothing certain."""
    places = [n for n, drive in enumerate(drives) if drive["departure"] == "signed" and _is_done(row["item"], drive)]
    done = drives[places[-1]] if places else None
    distance_m, unmeasured = (None, 0) if done is None else _driven(drives[places[-1] :])
    done_ms = None if done is None else done["departure_ms"] or done["started_ms"]
    days, km = row["every_days"], row["every_km"]
    due_days = None if days is None or done_ms is None else (done_ms + days * DAY_MS - now_ms) // DAY_MS
    due_km = None if km is None or distance_m is None else round(km - distance_m / 1000, 1)
    return {
        "item": row["item"],
        "title": row["title"],
        "every_days": days,
        "every_km": km,
        "done_ms": done_ms,
        "distance_m": distance_m,
        "is_least": unmeasured > 0,
        "due_days": due_days,
        "due_km": due_km,
        "is_overdue": done is None or (due_days is not None and due_days < 0) or (due_km is not None and due_km < 0),
    }


def _is_done(item: str, drive: LogbookDrive) -> bool:
    return any(row["item"] == item and row["is_done"] for row in drive["recurring"])


def _driven(drives: Sequence[LogbookDrive]) -> tuple[float | None, int]:
    """How far [m], None: not known; and of how many drives the distance is not known."""
    metres = [drive["distance_m"] for drive in drives if drive["distance_m"] is not None]
    return (round(sum(metres), 1) if metres else None), len(drives) - len(metres)


def _left(due: LogbookDue) -> float:
    """What is left of its interval, as a part of it; negative: late, never done: as late as can be."""
    if due["done_ms"] is None:
        return float("-inf")
    days, km, due_days, due_km = due["every_days"], due["every_km"], due["due_days"], due["due_km"]
    parts = [left / whole for left, whole in ((due_days, days), (due_km, km)) if left is not None and whole]
    return min(parts, default=float("inf"))

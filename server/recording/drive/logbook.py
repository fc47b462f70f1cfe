"""The logbook of a car: all its drives, week by week, from the figures that the catalog keeps of each; and how long ago
each car was checked before a drive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from statistics import median
from typing import Any, Literal

import orjson

from monitor.driving_summary import per_km
from server.protocol.departure import RecurringItem
from server.protocol.logbook import LogbookAnswer, LogbookCheck, LogbookDrive, LogbookDue, LogbookTotals, LogbookWeek
from server.recording.drive.modes import MODES
from server.recording.marks.rows import merged

DAY_MS = 86_400_000
WEEK_MS = 7 * DAY_MS
MONDAY_MS = 4 * DAY_MS  # the first Monday after 1970 began
MEDIAN_OF = 5
LEAST_M = 100.0  # in a week: of less, a rate on 100 km has no meaning
MOST_WEEKS = 520
MOST_STOPPED_MS = 3_600_000  # between two recordings of one drive, with a restart of the server between them
MOST_DRIVES = MOST_PEOPLE = MOST_VEHICLES = 200

Rated = Literal["interventions", "alarms"]


def drives_of(rows: Iterable[Sequence[Any]]) -> list[LogbookDrive]:
    """One for each session, whose parts are recordings, and for what follows after a restart of the server; oldest
    first. `rows`: see catalog_db.figures."""
    found: dict[tuple[str, str], LogbookDrive] = {}
    resumed: set[tuple[str, str]] = set()
    for id, vehicle, started_ms, title, tags, session, _, body, *later in rows:
        figures = with_later(orjson.loads(body), *later)
        part = _drive(id, vehicle, started_ms, title, orjson.loads(tags), figures)
        key = (vehicle, session or f"/{id}")
        before = found.get(key)
        found[key] = part if before is None else _joined(before, part)
        if figures.get("resumes"):
            resumed.add(key)
    return _joined_over_restarts(sorted(found.items(), key=lambda one: (one[1]["started_ms"], one[1]["id"])), resumed)


def _joined_over_restarts(
    drives: Sequence[tuple[tuple[str, str], LogbookDrive]], resumed: Set[tuple[str, str]]
) -> list[LogbookDrive]:
    """A session that resumes belongs to the drive before it, unless that was too long ago to be the same."""
    found: list[LogbookDrive] = []
    newest: dict[str, int] = {}  # vehicle → place of its newest drive
    ended_ms: dict[str, float] = {}
    for key, drive in drives:
        vehicle = drive["vehicle"]
        place = newest.get(vehicle)
        if place is not None and key in resumed and drive["started_ms"] - ended_ms[vehicle] < MOST_STOPPED_MS:
            found[place] = _joined(found[place], drive)
        else:
            newest[vehicle] = len(found)
            found.append(drive)
        ended_ms[vehicle] = drive["started_ms"] + drive["driven_s"] * 1000
    return found


def with_later(figures: dict[str, Any], late: str, marks: str | None, undescribed: str | None) -> dict[str, Any]:
    """Figures with what came beside the recording after they were computed, each as JSON. Without a log nothing is
    known."""
    beside, found = orjson.loads(late), dict(figures)
    if marks is not None and found["marks"] is not None and (beside["marks"] or beside["removed"]):
        found["marks"] = len(merged(orjson.loads(marks), beside["marks"], beside["removed"]))
    if undescribed is not None and found.get("undescribed") is not None:
        described = {row["intervention"] for row in beside.get("described", ())}
        found["undescribed"] = len(set(orjson.loads(undescribed)) - described)
    return found


def logbook(
    drives: Sequence[LogbookDrive],
    *,
    person: str | None = None,
    now_ms: int,
    every: Sequence[LogbookDrive] | None = None,
    unread: int = 0,
) -> LogbookAnswer:
    """`person`: only drives in which they were on duty. `every`: all drives of the cars, for when they were checked;
    None: these are all. `unread`: recordings whose drives are missing, as they are yet to be read."""
    people = sorted({name for drive in drives for name in drive["people"]}, key=str.casefold)
    chosen = [drive for drive in drives if person is None or person in drive["people"]]
    return {
        "totals": _totals(chosen),
        "weeks": weeks_of(chosen),
        "components": _components(chosen),
        "drives": list(chosen[-MOST_DRIVES:][::-1]),
        "people": people[:MOST_PEOPLE],
        "checks": checks_of(drives if every is None else every, now_ms),
        "unread": unread,
    }


def weeks_of(drives: Sequence[LogbookDrive]) -> list[LogbookWeek]:
    """Every week from the first drive to the last; one without a drive has no rate, and ends the run of medians."""
    by_week: dict[int, list[LogbookDrive]] = {}
    for drive in drives:
        by_week.setdefault((drive["started_ms"] - MONDAY_MS) // WEEK_MS, []).append(drive)
    if not by_week:
        return []
    last = max(by_week)
    first = max(min(by_week), last - MOST_WEEKS + 1)
    weeks: list[LogbookWeek] = []
    runs: dict[str, list[float]] = {"interventions": [], "alarms": []}
    for number in range(first, last + 1):
        of = by_week.get(number, [])
        week: LogbookWeek = {
            "from_ms": number * WEEK_MS + MONDAY_MS,
            "drives": len(of),
            "modes_m": {mode: round(sum(drive["modes_m"].get(mode) or 0.0 for drive in of), 1) for mode in MODES},
            "interventions": rate(of, "interventions", LEAST_M),
            "alarms": rate(of, "alarms", LEAST_M),
            "interventions_median": None,
            "alarms_median": None,
        }
        week["interventions_median"] = _median(runs["interventions"], week["interventions"], is_empty=not of)
        week["alarms_median"] = _median(runs["alarms"], week["alarms"], is_empty=not of)
        weeks.append(week)
    return weeks


def rate(drives: Sequence[LogbookDrive], what: Rated, least_m: float = 0.0) -> float | None:
    """How many on 100 km, over the drives that know: alarms of all that was driven, interventions of what the car
    drove by itself. None: too short a distance."""
    known = [drive for drive in drives if _count(drive, what) is not None and drive["distance_m"] is not None]
    metres = sum(_metres(drive, what) for drive in known)
    count = sum(_count(drive, what) or 0 for drive in known)
    on_km = per_km(metres, metres, count, count)[what]
    return None if on_km is None or metres <= least_m else round(on_km * 100, 2)


def _metres(drive: LogbookDrive, what: Rated) -> float:
    return (drive["modes_m"].get("autonomous") if what == "interventions" else drive["distance_m"]) or 0.0


def _count(drive: LogbookDrive, what: Rated) -> int | None:
    return drive["interventions"] if what == "interventions" else drive["alarms"]


def _median(run: list[float], value: float | None, *, is_empty: bool) -> float | None:
    if is_empty:
        run.clear()
    if value is None:
        return None
    run.append(value)
    return round(median(run[-MEDIAN_OF:]), 2)


def _totals(drives: Sequence[LogbookDrive]) -> LogbookTotals:
    modes_m = {mode: round(sum(drive["modes_m"].get(mode) or 0.0 for drive in drives), 1) for mode in MODES}
    modes_s = {mode: round(sum(drive["modes_s"].get(mode) or 0.0 for drive in drives), 1) for mode in MODES}
    checked = [drive for drive in drives if drive["departure"] is not None]
    return {
        "drives": len(drives),
        "distance_m": round(sum(drive["distance_m"] or 0.0 for drive in drives), 1),
        "driven_s": round(sum(drive["driven_s"] for drive in drives), 1),
        "modes_m": modes_m,
        "modes_s": modes_s,
        "interventions": rate(drives, "interventions"),
        "alarms": rate(drives, "alarms"),
        "checks_missing": sum(drive["departure"] != "signed" for drive in checked),
        "checks_known": len(checked),
    }


def _components(drives: Sequence[LogbookDrive]) -> dict[str, int]:
    found: dict[str, int] = {}
    for drive in drives:
        for name, number in drive["components"].items():
            found[name] = found.get(name, 0) + number
    return dict(sorted(found.items(), key=lambda one: (-one[1], one[0]))[:30])


def _drive(
    id: str, vehicle: str, started_ms: int, title: str, tags: list[str], figures: Mapping[str, Any]
) -> LogbookDrive:
    modes, check = figures["modes"], figures.get("check") or {}
    return {
        "id": id,
        "parts": 1,
        "recordings": [id],
        "vehicle": vehicle,
        "started_ms": started_ms,
        "title": title,
        "tags": tags,
        "people": figures["people"],
        "distance_m": figures["distance_m"],
        "driven_s": figures["driven_s"],
        "modes_m": {mode: modes[mode]["m"] for mode in MODES},
        "modes_s": {mode: modes[mode]["s"] or 0.0 for mode in MODES},
        "interventions": figures["interventions"],
        "undescribed": figures.get("undescribed"),
        "alarms": figures["alarms"],
        "marks": figures["marks"],
        "blind_s": figures["blind_s"],
        "departure": figures["departure"],
        "departure_ms": check.get("at_ms"),
        "departure_by": check.get("by", ""),
        "departure_failed": check.get("failed", 0),
        "failed_items": check.get("items", []),
        "recurring": check.get("recurring", []),
        "components": figures["components"],
    }


def _joined(drive: LogbookDrive, part: LogbookDrive) -> LogbookDrive:
    """With its next part. A part whose log has no departure check does not count for it."""
    newest = part["departure"]
    checked = part if newest in ("open", "signed") or not drive["departure"] else drive
    components = dict(drive["components"])
    for name, number in part["components"].items():
        components[name] = components.get(name, 0) + number
    return {
        **drive,
        "parts": drive["parts"] + part["parts"],
        "recordings": [*drive["recordings"], *part["recordings"]],
        "title": drive["title"] or part["title"],
        "tags": list(dict.fromkeys([*drive["tags"], *part["tags"]])),
        "people": list(dict.fromkeys([*drive["people"], *part["people"]])),
        "distance_m": _sum(drive["distance_m"], part["distance_m"]),
        "driven_s": round(drive["driven_s"] + part["driven_s"], 1),
        "modes_m": {mode: _sum(drive["modes_m"].get(mode), part["modes_m"].get(mode)) for mode in MODES},
        "modes_s": {mode: round(drive["modes_s"][mode] + part["modes_s"][mode], 1) for mode in MODES},
        "interventions": _count_of(drive["interventions"], part["interventions"]),
        "undescribed": _count_of(drive["undescribed"], part["undescribed"]),
        "alarms": _count_of(drive["alarms"], part["alarms"]),
        "marks": _count_of(drive["marks"], part["marks"]),
        "blind_s": round(drive["blind_s"] + part["blind_s"], 1),
        "departure": checked["departure"],
        "departure_ms": checked["departure_ms"],
        "departure_by": checked["departure_by"],
        "departure_failed": checked["departure_failed"],
        "failed_items": checked["failed_items"],
        "recurring": checked["recurring"],
        "components": components,
    }


def _sum(one: float | None, other: float | None) -> float | None:
    return other if one is None else one if other is None else round(one + other, 1)


def _count_of(one: int | None, other: int | None) -> int | None:
    """Not known where one part does not know: its distance counts, and a rate must not seem better by it."""
    return None if one is None or other is None else one + other


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

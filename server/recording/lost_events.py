"""Events that recordings hold and the log does not: it was lost, restored from an older copy, or not written.

A recording has each event of its time as the log numbered it. Of a log with events, only recordings count that were
written to after its newest event and that are shown to be of this log: by an event that both have, or by numbers that
continue. Of an empty log each recording of the vehicle counts, the newest one first, since numbers began anew where a
log was lost before. The search is bounded in time: a server waits for it before it opens its port.
"""

from __future__ import annotations

import logging
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

import orjson
from pydantic import TypeAdapter, ValidationError

from server.bus.journal_db import Kept
from server.protocol.alarm_state import LogEvent
from server.protocol.rate_limit import nests_deeper
from server.recording.event_channels import ALARMS
from server.recording.folder import WRITING, RecordingsFolder, first_part, id_of, part_number
from server.recording.mcap.channel_rows import Check, channel_rows, metadata_of

log = logging.getLogger("catgraph.recording")

WITHIN_S = 2.0  # the start waits so long
WITHIN_OF_EMPTY_S = 20.0  # as long as no vehicle has an event
MOST_EVENTS = 50_000  # of a vehicle; some 25 MB of the log
MOST_OF_CUT = 64 << 20  # bytes at the end of a recording that was never closed, which are read first
MOST_BETWEEN = 200  # numbers between two recordings: of events while nothing was recorded
_BUFFER = 1 << 16  # bytes
_MOST_BYTES = 1 << 16  # of an event
_MOST_DEPTH = 16
_MOST = 1 << 43  # of a number, and of a time of day [ms]; the clock of this machine may be wrong at the start
_COMPARED = 100  # events that both the log and a recording have

# What every event has since, in place of what those of older recordings lack.
_LATER: Mapping[str, Any] = {"alarm": None, "text": "", "by": None, "settings_version": 0}
_EVENT: TypeAdapter[LogEvent] = TypeAdapter(LogEvent)

Rows = Sequence[dict[str, Any]]


def lost_events(
    root: Path, vehicles: Iterable[str], kept: Kept, *, now: Callable[[], float] = time.monotonic
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Vehicle and event, in no order, of what `kept` lacks. Raises TimeoutError behind what was found in time."""
    until_s = now() + (WITHIN_S if kept.newest else WITHIN_OF_EMPTY_S)

    def check() -> None:
        if now() > until_s:
            raise TimeoutError("it would delay the start")

    folder = RecordingsFolder(root)
    try:
        paths = sorted([*folder.finished(), *folder.unfinished()], key=_age)
        for vehicle in vehicles:
            own = [path for path in paths if path.parent == folder.place(vehicle, "any").parent]
            lost = _behind(own, vehicle, kept, check) if vehicle in kept.newest else _all(own, vehicle, check)
            yield from ((vehicle, event) for event in islice(lost, MOST_EVENTS))
    except TimeoutError:
        raise
    except OSError as error:
        log.warning("recordings not all searched for events: error=%s", error)


def _age(path: Path) -> tuple[str, int]:
    return first_part(id_of(path)), part_number(id_of(path))


def _all(paths: Sequence[Path], vehicle: str, check: Check) -> Iterator[dict[str, Any]]:
    least = math.inf
    for path in reversed(paths):
        if rows := [row for row in _newest_of(path, vehicle, 0, check) if row["n"] < least]:
            yield from rows
            least = rows[0]["n"]


def _behind(paths: Sequence[Path], vehicle: str, kept: Kept, check: Check) -> Iterator[dict[str, Any]]:
    """What follows the newest event of the log."""
    newest = top = kept.newest[vehicle]
    at_ms = (kept.find(vehicle, newest) or (0,))[0]
    for path in paths:
        check()
        if _stat(path)[0] * 1000 <= at_ms:
            continue
        rows = _newest_of(path, vehicle, newest, check)
        behind = [row for row in rows if row["n"] > newest]
        known = [(row, kept.find(vehicle, row["n"])) for row in rows if row["n"] <= newest][-_COMPARED:]
        same = [found == _identity(row) for row, found in known if found is not None]
        goes_on = not known and behind and behind[0]["n"] <= top + MOST_BETWEEN and behind[0]["at_ms"] >= at_ms
        if all(same) if same else goes_on:
            is_whole = [row["n"] for row in behind] == list(range(newest + 1, newest + 1 + len(behind)))
            was_cut = is_whole and top == newest and path is paths[-1] and path.name.endswith(WRITING)
            cut: dict[str, Any] = {"was_cut": True} if was_cut else {}
            yield from ({**row, **cut} for row in behind if row["n"] > top)
            top = behind[-1]["n"] if behind else top
    check()


def _newest_of(path: Path, vehicle: str, newest: int, check: Check) -> Rows:
    """As `_events_of`; where the time does not suffice for a long recording that was never closed, those of its end, so
    that their numbers are not given again."""
    rows = _events_of(path, vehicle, MOST_OF_CUT, check)
    is_long = path.name.endswith(WRITING) and _stat(path)[1] > MOST_OF_CUT
    if is_long and (not rows or rows[0]["n"] > newest):  # events before its end may be lost too
        with suppress(TimeoutError):
            rows = _events_of(path, vehicle, None, check)
    return rows


def _stat(path: Path) -> tuple[float, int]:
    """When it was written to last, in s since 1970, and its bytes; 0 of a file that is no longer there."""
    try:
        found = path.stat()
    except OSError as error:
        log.warning("recording not searched for events: path=%s error=%s", path, error)
        return 0.0, 0
    return found.st_mtime, found.st_size


def _identity(row: Mapping[str, Any]) -> tuple[int, str | None, str]:
    return row["at_ms"], row["alarm"], row["change"]


def _events_of(path: Path, vehicle: str, most_of_cut: int | None, check: Check) -> Rows:
    """The events of a recording by their numbers; none where it cannot be read, or is not the vehicle's. Raises
    TimeoutError."""
    check()
    try:
        with path.open("rb", buffering=_BUFFER) as file:
            metadata = metadata_of(file)
            if metadata.get("vehicle") != vehicle or "clip_of" in metadata:
                return []
            found = channel_rows(file, ALARMS, most_of_cut=most_of_cut, check=check)
            rows = deque((event for raw in found if (event := _event(raw, id_of(path)))), MOST_EVENTS)
    except TimeoutError:
        raise
    except Exception as error:  # damage makes the readers fail in every way there is
        log.warning("recording not searched for events: path=%s error=%s", path, error)
        return []
    events = {row["n"]: row for row in rows}
    return [events[n] for n in sorted(events)]


def _event(raw: bytes, recording: str) -> dict[str, Any] | None:
    """The event, without what is of another type than declared; None: it is no event."""
    if len(raw) > _MOST_BYTES:
        return None
    try:
        row = orjson.loads(raw)
    except orjson.JSONDecodeError:
        return None
    if not isinstance(row, dict) or nests_deeper(row, _MOST_DEPTH):
        return None
    row = {**_LATER, **row}
    large = {name for name, value in row.items() if isinstance(value, (int, float)) and abs(value) > _MOST}
    wrong = _wrong(row) | large
    if wrong & {"n", "at_ms", "alarm", "change"} or row["n"] <= 0 or row["at_ms"] < 0:
        return None
    right = {name: value for name, value in row.items() if name not in wrong | {"time_ms", "was_cut"}}
    return {**_LATER, **right, "brought_from": recording}


def _wrong(row: Mapping[str, Any]) -> set[str]:
    """The fields that are missing or of another type than declared."""
    try:
        _EVENT.validate_json(orjson.dumps(row), strict=True)
    except ValidationError as error:
        return {str(one["loc"][0]) for one in error.errors(include_url=False) if one["loc"]}
    return set()

"""Events that recordings hold and the log does not: it was lost, restored from an older copy, or not written.

A recording has each event of its time as the log numbered it. Recordings are read from the newest one back, until one
has an event that the log has. A number is taken from the newest recording that has it, since numbers began anew where a
log was lost before. What is older than the newest event of the log, or has no connection to it, is left where it is.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from itertools import groupby
from pathlib import Path
from typing import Any

from server.bus.journal_db import Newest
from server.recording.event_channels import ALARMS
from server.recording.folder import RecordingsFolder, first_part, id_of, part_number
from server.recording.mcap.mcap_file import McapFile, is_cut
from server.recording.mcap.own_entries import own_entries

log = logging.getLogger("catgraph.recording")

MOST_EVENTS = 50_000  # of a vehicle; some 25 MB of the log
MOST_CUT_BYTES = 64 << 20  # one that was never closed is read from its beginning: a longer one for an empty log only
_NONE = Newest(n=0, at_ms=-math.inf)
# What every event has since, in place of what those of older recordings lack.
_LATER: Mapping[str, Any] = {"alarm": None, "text": "", "by": None, "settings_version": 0}


def lost_events(root: Path, newest: Mapping[str, Newest]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Vehicle and event, in no order; `newest`: the newest event of each vehicle in the log. Raises nothing."""
    folder = RecordingsFolder(root)
    try:
        paths = sorted([*folder.finished(), *folder.unfinished()], key=lambda path: path.parent)
    except OSError as error:
        log.warning("recordings not searched for events: error=%s", error)
        return
    for _, of_vehicle in groupby(paths, key=lambda path: path.parent):
        yield from _lost_of(of_vehicle, newest)


def _lost_of(paths: Iterable[Path], newest: Mapping[str, Newest]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Those of one folder."""
    found: list[tuple[str, dict[str, Any]]] = []
    least, is_joined = math.inf, False
    for path in sorted(paths, key=lambda path: (first_part(id_of(path)), part_number(id_of(path))), reverse=True):
        vehicle, rows = _events_of(path, may_be_long=not newest)
        if not rows:
            continue
        have = newest.get(vehicle, _NONE)
        lost = [row for row in rows if have.n < row["n"] < least and row["at_ms"] >= have.at_ms]
        found += ((vehicle, {**_LATER, **row, "brought_from": id_of(path)}) for row in lost)
        least = lost[0]["n"] if lost else least
        known = [row for row in rows if row["n"] <= have.n]
        has_all = least == have.n + 1
        is_joined = have is _NONE or has_all or (bool(known) and all(row["at_ms"] <= have.at_ms for row in known))
        if known or has_all or len(found) >= MOST_EVENTS:
            break
    if is_joined:  # else they are numbered by another log, as those of a recording that was copied here
        yield from found


def _events_of(path: Path, *, may_be_long: bool) -> tuple[str, list[dict[str, Any]]]:
    """The vehicle, and its events by their numbers; none where the file cannot be read."""
    try:
        with path.open("rb") as file:
            if is_cut(file) and not may_be_long and path.stat().st_size > MOST_CUT_BYTES:
                return "", []
        with closing(McapFile(path)) as source:
            rows = [row for row in own_entries(source, ALARMS) if _is_event(row)]
            vehicle = source.metadata.get("vehicle", "")
    except Exception as error:  # damage makes the readers fail in every way there is
        log.warning("recording not searched for events: path=%s error=%s", path, error)
        return "", []
    events = {row["n"]: {name: value for name, value in row.items() if name != "time_ms"} for row in rows}
    return vehicle, [events[n] for n in sorted(events)] if vehicle else []


def _is_event(row: Mapping[str, Any]) -> bool:
    n, at_ms, alarm = row.get("n"), row.get("at_ms"), row.get("alarm")
    is_numbered = type(n) is int and 0 < n < 1 << 53 and type(at_ms) is int
    return is_numbered and isinstance(row.get("change"), str) and (alarm is None or isinstance(alarm, str))

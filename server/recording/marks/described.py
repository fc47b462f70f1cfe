"""Descriptions of interventions after the recording that holds them was complete: kept beside it, as late marks.

The log has all descriptions; beside a recording are those that it does not hold itself, or holds otherwise.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, cast, get_args

from monitor.interventions import By
from server.protocol.driving_state import InterventionDescription
from server.recording.mcap.mcap_file import McapFile, finished, own_entries
from server.recording.own import PREFIX
from server.system.clean_text import clean

CHANGE = "intervention_described"
MOST = 1000  # of one recording
MOST_WORDS = 2000
MOST_CATEGORY = 60
MOST_NAME = 120
MOST_EVENTS = 50_000  # of the log of one recording
COMPARED = ("what", "category", "initiated_by", "by")  # in which two descriptions may differ
_ID = re.compile(r"[A-Za-z0-9-]{1,60}")
_INITIATORS = get_args(By)


def description_of(event: Mapping[str, Any]) -> InterventionDescription | None:
    """The description in an event or in a value of a file; None: it is none."""
    id, category, begun, by = (event.get(name) for name in ("intervention", "category", "initiated_by", "by"))
    at_ms = event.get("described_ms", event.get("at_ms"))
    if not isinstance(id, str) or not _ID.fullmatch(id) or not isinstance(at_ms, int) or abs(at_ms) >= 2**53:
        return None
    what = event.get("what")
    return {
        "intervention": id,
        "described_ms": at_ms,
        "what": clean(what, MOST_WORDS) if isinstance(what, str) else "",
        "category": clean(category, MOST_CATEGORY) if isinstance(category, str) and category else None,
        "initiated_by": cast(By, begun) if begun in _INITIATORS else None,
        "by": clean(by, MOST_NAME) if isinstance(by, str) else None,
    }


def newest(events: Iterable[Mapping[str, Any]]) -> dict[str, InterventionDescription]:
    """The last of each intervention, of events in the order of the log."""
    found: dict[str, InterventionDescription] = {}
    for event in events:
        if event.get("change") == CHANGE and (row := description_of(event)) is not None:
            found[row["intervention"]] = row
    return found


def listed(value: object) -> tuple[InterventionDescription, ...]:
    """The descriptions in a value of a file; what is none is left out."""
    found = [description_of(one) for one in value[:MOST] if isinstance(one, dict)] if isinstance(value, list) else []
    return tuple(row for row in found if row is not None)


def as_event(row: InterventionDescription) -> dict[str, Any]:
    """The event that logs it."""
    fields = {name: value for name, value in row.items() if name != "described_ms" and value is not None}
    return {**fields, "change": CHANGE, "at_ms": row["described_ms"], "alarm": None}


def late_of(path: Path, logged: Mapping[str, InterventionDescription]) -> list[InterventionDescription] | None:
    """Of the interventions that a file holds, the descriptions that it lacks; None: it cannot be read. Raises OSError.

    `logged`: what the log has of interventions of the vehicle.
    """
    if path.is_dir():  # a bag of others
        return None
    try:
        with contextlib.closing(finished(path)) as source:
            interventions, described = _in_file(_entries(source))
    except OSError:
        raise
    except Exception:  # damage makes the readers fail in every way there is
        return None
    mine = (row for id, row in logged.items() if id in interventions)
    return [row for row in mine if not has_same_content(row, described.get(row["intervention"]))]


def holds(path: Path, intervention: str) -> bool:
    """Whether a file has this intervention; of one that cannot be read it is not known. Raises OSError."""
    if path.is_dir():
        return False
    try:
        with contextlib.closing(finished(path)) as source:
            return any(
                one.get("change") == "intervention" and one.get("intervention") == intervention
                for one in _entries(source)
            )
    except OSError:
        raise
    except Exception:  # damage makes the readers fail in every way there is
        return False


def has_same_content(one: InterventionDescription, other: InterventionDescription | None) -> bool:
    """Whether both have the same content."""
    return other is not None and all(one[name] == other[name] for name in COMPARED)  # type: ignore[literal-required]


def _in_file(entries: Iterable[Mapping[str, Any]]) -> tuple[set[str], dict[str, InterventionDescription]]:
    """The ids of the interventions, and their descriptions."""
    events = [event for event in entries if event.get("change") in ("intervention", CHANGE)]
    ids = (event.get("intervention") for event in events if event["change"] == "intervention")
    return {id for id in ids if isinstance(id, str)}, newest(events)


def _entries(source: McapFile) -> Iterator[Mapping[str, Any]]:
    return islice(own_entries(source, f"{PREFIX}alarms"), MOST_EVENTS)

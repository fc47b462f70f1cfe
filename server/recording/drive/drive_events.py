"""The events of a drive's log, valid and in order, as all readers of this package take them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import orjson

from server.recording.drive.parts import DrivePart, parts_of
from server.recording.read.read import Recording
from server.recording.standing import read_standing
from server.system.clean_text import clean

ALARMS = "/catgraph/alarms"
MOST = 50_000  # events of one recording: a day with one every two seconds
LONGEST = 4000  # characters of a text
MOST_LATE_MS = 3_600_000  # between what happened and its event

Event = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class PartEvents:
    """The log of one part: what stood when it began, the signed departure check, and what was logged in it."""

    stood: Sequence[Event]
    signed: Sequence[Event]
    logged: Sequence[Event]

    @property
    def all(self) -> list[Event]:
        return [*self.stood, *self.signed, *self.logged]


def read_drive_events(recording: Recording) -> list[Event] | None:
    """What stood when the recording began, then what was logged in it; None: it has no log. Invalid ones are left out.

    Reads the whole channel. Raises RecordingUnreadable.
    """
    parts = read_part_events(recording)
    return None if parts is None else joined(parts)


def joined(parts: Sequence[PartEvents]) -> list[Event]:
    """Of the whole drive. What stood before a later part is taken from there where no part before has it: it came
    between two parts, or in one that is elsewhere."""
    found: list[Event] = []
    before: set[tuple[object, ...]] = set()
    for part in parts:
        found += [event for event in part.stood if _key(event) not in before]
        found += [*part.signed, *part.logged]
        before.update(map(_key, part.all))
    return found


def _key(event: Event) -> tuple[object, ...]:
    """By its number in the log, which a step of the clock does not change; events of older versions have none."""
    number = event.get("n")
    return number if isinstance(number, int) else event["at_ms"], event["change"], event.get("alarm")


def read_part_events(recording: Recording, parts: Sequence[DrivePart] | None = None) -> list[PartEvents] | None:
    """One of each part, and one where there are none; None: no log. As `read_drive_events`."""
    rows = list(islice(recording.own(ALARMS), MOST))
    if not rows and not recording.metadata:
        return None
    parts = parts_of(recording) if parts is None else parts
    begins = [recording.start_s + part.from_s for part in parts]
    logged: list[list[Event]] = [[] for _ in range(max(1, len(parts)))]
    for at_s, event in rows:
        if _is_event(event):
            logged[max(0, bisect_right(begins, at_s + 1e-6) - 1)].append(event)
    found = []
    for metadata, events in zip([part.metadata for part in parts] or [recording.metadata], logged, strict=True):
        stood = [event for event in read_standing(metadata) if _is_event(event)]
        signed = [event for event in _signature(metadata) if _is_event(event)]
        found.append(PartEvents(stood=stood, signed=signed, logged=events))
    return found


def _signature(metadata: Mapping[str, str]) -> list[dict[str, Any]]:
    """Of a departure check that was signed before the recording began, as the event that it was."""
    try:
        found = orjson.loads(metadata.get("departure") or "null")
    except orjson.JSONDecodeError:
        return []
    return [{**found, "change": "departure", "step": "signed", "alarm": None}] if isinstance(found, dict) else []


def of_change(events: Sequence[Event], *changes: str) -> Iterator[Event]:
    """The events of these kinds."""
    return (event for event in events if event["change"] in changes)


def text_of(event: Event, name: str, most: int = LONGEST) -> str:
    """A text of an event, as one that can be shown; "" where it has none."""
    value = event.get(name)
    return clean(value, most) if isinstance(value, str) else ""


def number_of(event: Event, name: str) -> float | None:
    """A finite number of an event; None where it has none."""
    value = event.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if abs(value) < 1e15 else None


def moment_of(event: Event) -> int:
    """When it happened [ms since 1970], which is a moment before some are logged."""
    moment_ms, at_ms = event.get("moment_ms"), int(event["at_ms"])
    is_moment = isinstance(moment_ms, int) and not isinstance(moment_ms, bool) and abs(moment_ms - at_ms) < MOST_LATE_MS
    return int(moment_ms) if is_moment and moment_ms is not None else at_ms


def whole_of(event: Event, name: str) -> int:
    """A count of an event; 0 where it has none."""
    value = number_of(event, name)
    return 0 if value is None else max(0, int(value))


def _is_event(event: Any) -> bool:
    return (
        isinstance(event, dict)
        and isinstance(event.get("at_ms"), int)
        and abs(event["at_ms"]) < 2**53
        and isinstance(event.get("change"), str)
        and isinstance(event.get("alarm", None), str | None)
    )

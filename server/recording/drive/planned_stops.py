"""The planned stops of a drive. Times are ms since 1970."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from monitor.planned_stop import REASONS, reason_of
from server.recording.drive.drive_events import Event, number_of, of_change, text_of

MOST = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedStopInDrive:
    """One. `from_ms` may be before the drive began; `to_ms` None: it did not end in it."""

    reason: str  # as text
    by: str
    from_ms: int
    to_ms: int | None = None
    ended: str = ""  # the text of its end
    ended_by: str = ""  # "": it ended by itself


def planned_stops_of(events: Sequence[Event]) -> list[PlannedStopInDrive]:
    """All of them, in order. After a restart of the server it is the same one; another reason is another."""
    found: list[PlannedStopInDrive] = []
    for event in of_change(events, "planned_stop", "planned_stop_ended"):
        at_ms, newest = event["at_ms"], found[-1] if found and found[-1].to_ms is None else None
        if event["change"] == "planned_stop_ended":
            if newest is not None:
                ended, by = text_of(event, "text", 300), text_of(event, "by", 120)
                found[-1] = replace(newest, to_ms=at_ms, ended=ended, ended_by=by)
            continue
        reason = REASONS[reason_of(event.get("reason"))]
        since_ms = number_of(event, "since_ms")
        if newest is not None and newest.reason == reason:
            continue
        if newest is not None:
            found[-1] = replace(newest, to_ms=at_ms)
        if len(found) < MOST:
            from_ms = at_ms if since_ms is None else round(since_ms)
            found.append(PlannedStopInDrive(reason=reason, by=text_of(event, "by", 120), from_ms=from_ms))
    return found

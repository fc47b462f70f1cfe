"""Reads the channels of our own of a recording: alarms, pauses, planned stops, settings, phones, slow-downs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

from pydantic import ValidationError

from monitor.phones import PhoneReport
from monitor.planned_stop import PlannedStop, reason_of
from server.judge import recorded_events
from server.judge.logged_transition import number_of, text_of, transition_of
from server.judge.phone_report import phone_report
from server.judge.recorded_events import (
    ChosenPhone,
    NewSettings,
    OwnerChange,
    Pause,
    RecordedEvent,
    RecordedEvents,
    StopChange,
)
from server.protocol.commands import Position
from server.recording.read.read import Recording
from server.recording.standing import read_standing

ALARMS, PHONE, SETTINGS = "/catgraph/alarms", "/catgraph/phone", "/catgraph/settings"
MOST_SETTINGS = 200  # changes of the settings: each is a file to read
MOST_NAME = 200  # characters of who acknowledged
MOST = 50_000  # rows of one channel: a day of a phone; a file that holds more is not of our making


def read_recorded_events(recording: Recording) -> RecordedEvents:
    """Reads the recording's own channels. What is invalid in them is left out, and reported."""
    events: list[tuple[float, RecordedEvent]] = []
    left_out = changes = 0
    metadata: Mapping[str, str] = getattr(recording, "metadata", {})
    at_first: str | None = metadata.get("settings") or None
    newest = at_first
    rows = [(0.0, event) for event in read_standing(metadata)] + list(_rows(recording, ALARMS))
    for at_s, row in rows:
        event = _of_event(row, at_s, recording.start_s)
        if event is not None:
            events.append((at_s, event))
    for at_s, row in _rows(recording, PHONE):
        try:
            events.append((at_s, _of_phone(at_s, row)))
        except (ValidationError, TypeError, ValueError, KeyError):
            left_out += 1
    for at_s, row in _rows(recording, SETTINGS):
        toml = row.get("toml")
        if not isinstance(toml, str):
            left_out += 1
        elif at_first is None:
            at_first = newest = toml
        elif toml != newest and changes < MOST_SETTINGS:
            events.append((at_s, NewSettings(toml=toml)))
            newest, changes = toml, changes + 1
        elif toml != newest:
            left_out += 1
    events.sort(key=lambda event: event[0])  # stable: of one moment, each channel keeps its order
    notes = [f"{left_out} invalid entries of catgraph's own channels are left out."] if left_out else []
    clock_set = [row for _, row in rows if row.get("change") == "clock_set"]
    notes += [text for row in clock_set[:1] if isinstance(text := row.get("text"), str)]
    has_alarms = bool(rows) or "session" in metadata
    return RecordedEvents(
        events=tuple(events),
        has_alarms=has_alarms,
        settings=at_first,
        clock_was_set=bool(clock_set),
        notes=tuple(notes),
    )


def _rows(recording: Recording, topic: str) -> Iterator[tuple[float, Mapping[str, Any]]]:
    """A channel's rows with their time since the beginning."""
    own = getattr(recording, "own", None)
    if own is not None:
        yield from ((at_s - recording.start_s, row) for at_s, row in islice(own(topic), MOST))


def _of_event(row: Mapping[str, Any], at_s: float, start_s: float) -> RecordedEvent | None:
    change = row.get("change")
    if change in ("paused", "resumed"):
        by = row.get("by")
        return Pause(is_paused=change == "paused", by=by if isinstance(by, str) else None)
    if change in ("planned_stop", "planned_stop_ended"):
        since_s = number_of(row.get("since_ms"), number_of(row.get("at_ms"), 0.0)) / 1000 - start_s
        stop = PlannedStop(reason=reason_of(row.get("reason")), since_s=since_s, by=text_of(row.get("by")))
        return StopChange(stop=stop if change == "planned_stop" else None)
    if change == "owner":
        off_duty_ms = row.get("off_duty_ms")
        owner = str(row.get("owner"))[:MOST_NAME]
        return OwnerChange(owner=owner, off_duty_ms=off_duty_ms if type(off_duty_ms) is int else None)
    if change == "ride":
        phone = row.get("phone")
        return ChosenPhone(phone=phone if isinstance(phone, str) else None)
    if (slow_down := recorded_events.read_slowdown(row)) is not None:
        return slow_down
    if not isinstance(row.get("alarm"), str):
        return None
    return transition_of(row, lambda at_ms: at_ms / 1000 - start_s, lambda until_ms: until_ms / 1000 - start_s)


def _of_phone(at_s: float, row: Mapping[str, Any]) -> PhoneReport:
    """As the session received it. `wall_ms` is when the server did."""
    command = Position.model_validate({**row, "kind": "position"})
    wall_ms = float(row["time_ms"]) if isinstance(row.get("time_ms"), (int, float)) else None
    if wall_ms is None:  # the delay of the page is not recorded: the fix is as old as the page stated
        fix = command.fix
        wall_ms = fix.heard_ms + fix.held_s * 1000 if fix is not None else 0.0
    by = row.get("by")
    return phone_report(command, at_s, wall_ms, by if isinstance(by, str) else "")

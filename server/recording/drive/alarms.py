"""The alarms of a drive: when they were raised, acknowledged and over, and which part of the car each is about.

Times are ms since 1970.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

from monitor import catalog
from monitor.alarm import LEVEL, AlarmState
from monitor.signals import SIGNALS
from server.judge.logged_transition import spec_of
from server.recording.drive.drive_events import Event, text_of

MOST_ALARMS = 5000
PAUSED = "paused"  # among what suppresses an alarm: not an alarm but the pause
MARKS = {
    "planned_stop": "planned stop",
    "shelved": "shelved",
    "paused": "suppressed: monitoring was paused",
    "suppressed": "suppressed by another alarm",
}
_ABOUT_NEEDS = {check.id: sorted(check.needs) for check in catalog.CHECKS}
# The first part of an alarm's id, where its check names no signal.
_BY_PREFIX = (
    ("laser", "Laser"),
    ("link", "Link"),
    ("connect", "Link"),
    ("no_message", "Link"),
    ("car_silent", "Link"),
    ("bridge", "Link"),
    ("all_slow", "Link"),
    ("phone", "Phone"),
    ("slow_down", "Slow-down"),
    ("clock", "Clock"),
    ("record", "Recorder"),
    ("disk", "Recorder"),
    ("log_", "Recorder"),
    ("reach", "Operators"),
    ("paused", "Operators"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmInDrive:
    """From raising to clearing; None: not, or not in this drive."""

    alarm: str
    title: str
    priority: str
    text: str
    component: str
    raised_ms: int
    acknowledged_ms: int | None = None
    acknowledged_by: str = ""
    cleared_ms: int | None = None
    planned_stop: bool = False  # it was raised in a planned stop
    shelved: bool = False  # somebody had it hidden for a time
    suppressed: bool = False  # another alarm explained it for a time
    paused: bool = False  # it was hidden while monitoring was paused

    @property
    def to_acknowledge_s(self) -> float | None:
        """How long nobody acknowledged it."""
        return None if self.acknowledged_ms is None else (self.acknowledged_ms - self.raised_ms) / 1000


def alarms_of(events: Sequence[Event]) -> list[AlarmInDrive]:
    """Those that were raised in the drive, in order; what stood before it began was raised in another."""
    found: list[AlarmInDrive] = []
    standing: dict[str, int] = {}
    for event in events:
        alarm, change = event.get("alarm"), event["change"]
        if not isinstance(alarm, str):
            continue
        if change == "raised" and len(found) < MOST_ALARMS:
            standing[alarm] = len(found)
            found.append(_raised(alarm, event))
        if (place := standing.get(alarm)) is None:
            continue
        found[place] = _hidden(found[place], event)
        if change == "acknowledged" and found[place].acknowledged_ms is None:
            by = text_of(event, "person", 60) or text_of(event, "by", 120)
            found[place] = replace(found[place], acknowledged_ms=event["at_ms"], acknowledged_by=by)
        elif change == "cleared" and found[place].cleared_ms is None:
            found[place] = replace(found[place], cleared_ms=event["at_ms"])
            if event.get("state") != "RTN_UNACKED":
                standing.pop(alarm)
    return found


def marks_of(alarm: Mapping[str, Any]) -> str:
    """The marks of an alarm of a report, beside its text; empty: none."""
    return " · ".join(text for name, text in MARKS.items() if alarm[name])


def percentile(values: Sequence[float], share: float) -> float | None:
    """By nearest rank; the middle of two for the half. None: of nothing."""
    if not values:
        return None
    if share == 0.5:
        return median(values)
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)]


def by_component(alarms: Sequence[AlarmInDrive]) -> dict[str, int]:
    """How many alarms of each component, most first."""
    return dict(Counter(alarm.component for alarm in alarms).most_common(40))


def _hidden(alarm: AlarmInDrive, event: Event) -> AlarmInDrive:
    """With the mark of the state in which an event left it."""
    state, causes = event.get("state"), event.get("suppressed_by")
    if state == AlarmState.SHELVED:
        return replace(alarm, shelved=True)
    if state != AlarmState.SUPPRESSED:
        return alarm
    is_paused = isinstance(causes, list) and PAUSED in causes
    is_explained = not is_paused or causes != [PAUSED]
    return replace(alarm, paused=alarm.paused or is_paused, suppressed=alarm.suppressed or is_explained)


def _raised(alarm: str, event: Event) -> AlarmInDrive:
    causes, spec = event.get("causes"), spec_of(event)
    named = [text for text in causes[:10] if isinstance(text, str)] if isinstance(causes, list) else []
    return AlarmInDrive(
        alarm=alarm[:120],
        title=text_of(event, "title", 120) or spec.title,
        priority=spec.priority,
        text=text_of(event, "text", 300),
        component=component_of(alarm, named),
        raised_ms=event["at_ms"],
        planned_stop=isinstance(event.get("planned_stop"), str),
    )


def component_of(alarm_id: str, causes: Sequence[str] = ()) -> str:
    """A name for people. Diagnostics name the component themselves, as their cause."""
    check_id, _, signal = alarm_id.partition(".")
    if check_id.startswith("diagnostics"):
        return next((cause[:60] for cause in causes if cause and not cause.startswith(LEVEL)), "Diagnostics")
    if signal in SIGNALS:
        return SIGNALS[signal].label
    for prefix, name in _BY_PREFIX:
        if check_id.startswith(prefix):
            return name
    needs = _ABOUT_NEEDS.get(check_id)
    return SIGNALS[needs[0]].label if needs else "Other"

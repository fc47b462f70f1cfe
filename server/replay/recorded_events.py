"""Recorded events of a drive for the time line of a replay: marks, interventions and driving modes."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from server.protocol.marks import DriveMark
from server.protocol.messages import DrivenSpan, ReplayIntervention
from server.recording.drive.drive_events import Event, read_drive_events
from server.recording.drive.modes import Intervention, are_modes_known, interventions_of, mode_spans
from server.recording.marks.described import as_event
from server.recording.marks.of_drive import described_late, marks_of
from server.recording.read.read import Recording

log = logging.getLogger("catgraph.playback")

MOST = 400  # of each on a time line
MOST_WORDS = 300  # letters


@dataclass(frozen=True, slots=True, kw_only=True)
class TimelineEvents:
    """Oldest first; texts are shortened."""

    flags: Sequence[DriveMark] = ()
    interventions: Sequence[ReplayIntervention] = ()
    modes: Sequence[DrivenSpan] = ()


NOTHING = TimelineEvents()


def read_timeline_events(open_recording: Callable[[], Recording]) -> TimelineEvents:
    """Read them from a recording and its annotations; what cannot be read is left out and logged."""
    found = NOTHING
    try:
        with open_recording() as recording:
            found = TimelineEvents(flags=_flags(recording))
            events = read_drive_events(recording)
            if events is not None and are_modes_known(events):
                interventions, modes = _interventions(recording, events), _modes(recording, events)
                found = TimelineEvents(flags=found.flags, interventions=interventions, modes=modes)
    except Exception:
        log.exception("recorded events unreadable: replayed without marks, interventions or driving modes")
    return found


def _flags(recording: Recording) -> list[DriveMark]:
    return [{**row, "words": row["words"][:MOST_WORDS]} for row in marks_of(recording)]


def _interventions(recording: Recording, events: Sequence[Event]) -> list[ReplayIntervention]:
    start_ms = recording.start_s * 1000
    found = interventions_of([*events, *map(as_event, described_late(recording))])
    return [_row(one, (one.at_ms - start_ms) / 1000) for one in found[:MOST]]


def _row(one: Intervention, at_s: float) -> ReplayIntervention:
    return {
        "at_s": max(0.0, round(at_s, 3)),
        "kind_of": one.kind_of,
        "category": one.category or None,
        "what": one.what[:MOST_WORDS],
    }


def _modes(recording: Recording, events: Sequence[Event]) -> list[DrivenSpan]:
    start_ms = round(recording.start_s * 1000)
    spans = mode_spans(events, start_ms, start_ms + round(recording.duration_s * 1000))
    return [
        {"mode": one.mode, "from_s": (one.from_ms - start_ms) / 1000, "to_s": (one.to_ms - start_ms) / 1000}
        for one in spans[:MOST]
    ]

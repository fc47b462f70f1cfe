"""The alarm log of a recording of ours, and the settings in force.

A later judgement is what the checks find in the messages; this is what the operator had.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from server.analysis.episodes import Announcement, Episode, Load, load_of
from server.judge.logged_transition import spec_of, transition_of
from server.recording.drive.parts import recorded_s
from server.recording.read.read import Recording
from server.recording.standing import read_standing

MOST_ENTRIES = 2000  # of the log on the page; the whole of it is in the recording and in its tables
_ANNOUNCES = ("raised", "recaused", "unshelved", "unacknowledged")


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One line of the log."""

    at_s: float  # since the beginning of the recording
    at_ms: int  # since 1970
    change: str
    title: str  # of the alarm; "" for what monitoring itself did
    priority: str
    text: str
    by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedLog:
    """The whole log. Times are seconds since the beginning of the recording."""

    entries: Sequence[Entry]
    left_out: int  # entries beyond the first MOST_ENTRIES
    episodes: tuple[Episode, ...]
    load: Load
    titles: Mapping[str, str]
    settings: Sequence[tuple[float, str]]  # when they came into force, as TOML
    clip_of: str | None  # the recording it was cut from
    clip_at_s: float | None  # the moment it is about


def read_recorded_log(recording: Recording) -> RecordedLog | None:
    """Read the log; None where the recording was not made by catgraph."""
    if not recording.metadata:
        return None
    start_s = recording.start_s
    stood = [event for event in read_standing(recording.metadata) if _is_event(event)]
    events = [*stood, *(event for _, event in recording.own("/catgraph/alarms") if _is_event(event))]
    entries = [_entry(event, start_s) for event in events]
    return RecordedLog(
        entries=entries[:MOST_ENTRIES],
        left_out=max(0, len(entries) - MOST_ENTRIES),
        episodes=_episodes(events, start_s, recording.duration_s),
        load=_load(events, start_s, recorded_s(recording)),
        titles={event["alarm"]: spec_of(event).title for event in events if event["alarm"]},
        settings=_settings(recording),
        clip_of=recording.metadata.get("clip_of") or None,
        clip_at_s=_clip_at_s(recording),
    )


def _is_event(event: Any) -> bool:
    return (
        isinstance(event, dict)
        and isinstance(event.get("at_ms"), int)
        and isinstance(event.get("change"), str)
        and isinstance(event.get("alarm", 0), str | None)
    )


def _entry(event: Mapping[str, Any], start_s: float) -> Entry:
    return Entry(
        at_s=event["at_ms"] / 1000 - start_s,
        at_ms=event["at_ms"],
        change=event["change"],
        title=spec_of(event).title if event["alarm"] else "",
        priority=spec_of(event).priority if event["alarm"] else "",
        text=str(event.get("text") or ""),
        by=str(event.get("by") or ""),
    )


def _episodes(events: Iterable[Mapping[str, Any]], start_s: float, end_s: float) -> tuple[Episode, ...]:
    """From raising to clearing; what stood before the recording begins with it."""
    standing: dict[str, Episode] = {}
    hidden_s: dict[str, float] = {}
    closed: list[Episode] = []
    for event in events:
        alarm_id = event["alarm"]
        if not alarm_id:
            continue
        at_s = max(0.0, event["at_ms"] / 1000 - start_s)
        change = event["change"]
        episode = standing.get(alarm_id)
        if episode is None and (change == "raised" or event.get("state") in ("UNACKED", "ACKED", "SHELVED")):
            standing[alarm_id] = _opened(event, at_s, end_s)
            continue
        if episode is None:
            continue
        if change == "cleared":
            closed.append(replace(_shown(standing.pop(alarm_id), hidden_s, at_s), cleared_s=at_s, until_s=at_s))
        elif change == "suppressed":
            hidden_s[alarm_id] = at_s
        elif change == "unsuppressed":
            standing[alarm_id] = _shown(episode, hidden_s, at_s)
        elif change in _ANNOUNCES:
            announcement = Announcement(at_s=at_s, text=str(event.get("text") or ""), change=change)
            standing[alarm_id] = replace(episode, announcements=(*episode.announcements, announcement))
    still = [_shown(episode, hidden_s, end_s) for episode in standing.values()]
    return tuple(sorted((*closed, *still), key=lambda e: (e.raised_s, e.priority.rank, e.alarm_id)))


def _opened(event: Mapping[str, Any], at_s: float, end_s: float) -> Episode:
    text = str(event.get("text") or "")
    return Episode(
        alarm_id=event["alarm"],
        title=spec_of(event).title,
        priority=spec_of(event).priority,
        raised_s=at_s,
        cleared_s=None,
        until_s=max(at_s, end_s),
        trip_text=text,
        worst=None,
        causes=tuple(map(str, event.get("causes") or ())),
        announcements=(Announcement(at_s=at_s, text=text, change=event["change"]),),
    )


def _shown(episode: Episode, hidden_s: dict[str, float], at_s: float) -> Episode:
    since_s = hidden_s.pop(episode.alarm_id, None)
    return episode if since_s is None else replace(episode, suppressed=(*episode.suppressed, (since_s, at_s)))


def _load(events: Iterable[Mapping[str, Any]], start_s: float, length_s: float) -> Load:
    found = (
        transition_of(event, lambda at_ms: at_ms / 1000 - start_s, lambda until_ms: until_ms / 1000 - start_s)
        for event in events
        if event["alarm"] and event["at_ms"] / 1000 >= start_s
    )
    transitions = [transition for transition in found if transition is not None]
    return load_of(transitions, length_s, 0)


def _settings(recording: Recording) -> list[tuple[float, str]]:
    found: list[tuple[float, str]] = []
    for at_s, row in recording.own("/catgraph/settings"):
        toml = row.get("toml")
        if isinstance(toml, str) and (not found or found[-1][1] != toml):
            found.append((max(0.0, at_s - recording.start_s), toml))
    if not found and recording.metadata.get("settings"):
        found.append((0.0, recording.metadata["settings"]))
    return found


def _clip_at_s(recording: Recording) -> float | None:
    try:
        at_s = float(recording.metadata["clip_at_ms"]) / 1000 - recording.start_s
    except (KeyError, ValueError):
        return None
    return at_s if math.isfinite(at_s) else None

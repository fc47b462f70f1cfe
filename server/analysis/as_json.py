"""The report as JSON, for scripts; numbers in SI, times in seconds since the beginning of the recording."""

from __future__ import annotations

import math
from typing import Any

from monitor.check import Finding, Quantity, Verdict
from server.analysis.episodes import Episode
from server.analysis.rehearse import Rehearsed
from server.analysis.report import Report, differences
from server.version import catgraph_version


def as_json(report: Report) -> dict[str, Any]:
    """Plain values only; what is unknown is null."""
    run = report.run
    found: dict[str, Any] = {
        "catgraph": catgraph_version(),
        "recording": _recording(report),
        "judged": _judged(report),
        "settings": _settings(report),
        "signals": _signals(report),
        "questions": list(run.questions),
        "other_topics": dict(run.other_topics),
        "alarms": [episode_json(episode) for episode in run.episodes],
        "slow_downs": _slow_downs(run),
        "checks": _checks(run),
        "never_checked": [{"check": one.check_id, "label": one.label, "why": one.why} for one in run.unchecked],
        "load": _load(run),
        "transitions": _transitions(run),
        "injected": [
            {"fault": one.name, "from_s": one.from_s, "to_s": one.to_s, "touched": one.touched} for one in run.faults
        ],
        "notes": list(run.notes),
    }
    if report.before is not None:
        found["compared"] = _compared(report, report.before)
    return found


def _recording(report: Report) -> dict[str, Any]:
    """What was read, and whether it was read to its end."""
    recording, run, when = report.recording, report.run, report.recorded
    return {
        "files": list(report.files),
        "ros_version": recording.ros_version,
        "start_s": recording.start_s if recording.count else None,
        "recorded": None if when is None else when.isoformat(),
        "duration_s": _number(recording.duration_s),
        "messages": recording.count,
        "complete": run.broke_off is None and not run.damage,
        "broke_off": run.broke_off,
        "damage": list(run.damage),
        "verified": [{"file": one.path.name, **one.as_json()} for one in report.verified],
    }


def _judged(report: Report) -> dict[str, Any]:
    """Which part was judged, and how fast."""
    run = report.run
    return {
        "from_s": _number(run.from_s),
        "to_s": _number(run.to_s),
        "messages": run.messages,
        "nothing_why": report.why_nothing,
        "took_s": _number(report.took_s),
        "times_real_time": _number(report.times_real, 1),
    }


def _settings(report: Report) -> dict[str, Any]:
    """The settings of the run."""
    run = report.run
    return {
        "file": run.override.name or None,
        "profile": run.tuning.profile.name,
        "changed": {name: value for name, _, value, _ in report.settings()},
        "topics": dict(run.tuning.settings.topics),
        "units": dict(run.tuning.settings.units),
    }


def _signals(report: Report) -> list[dict[str, Any]]:
    """Each signal with its topic, rate and range."""
    return [
        {
            "signal": row.name,
            "label": row.label,
            "topic": row.topic,
            "type": row.type,
            "why": row.why,
            "note": row.note,
            "count": row.count,
            "rate_hz": _number(row.rate_hz, 2),
            "expected_hz": _number(row.expected_hz, 2),
            "rejected": row.rejected,
            "rejected_why": row.why_rejected,
            "lowest": _number(row.lowest),
            "highest": _number(row.highest),
            "unit": row.unit,
        }
        for row in report.signals()
    ]


def _slow_downs(run: Rehearsed) -> list[dict[str, Any]]:
    """The times at which the settings would have slowed the car."""
    return [
        {
            "trigger": one.trigger,
            "title": one.title,
            "text": one.text,
            "countdown_s": _number(one.countdown_s),
            "at_s": _number(one.at_s),
        }
        for one in run.simulated_orders
    ]


def _checks(run: Rehearsed) -> list[dict[str, Any]]:
    """The time of each check in each verdict."""
    return [
        {
            "label": timeline.label,
            **{f"{verdict}_s": _number(timeline.seconds(verdict), 1) for verdict in Verdict},
            "not_checked_why": timeline.why_not or None,
        }
        for timeline in run.timelines
    ]


def _load(run: Rehearsed) -> dict[str, Any]:
    """The alarm load."""
    return {
        "announced": run.load.announced,
        "in_10_min": _number(run.load.in_10_min, 2),
        "most_in_10_min": run.load.most_in_10_min,
        "chattering": list(run.load.chattering),
        "standing_at_end": run.load.standing,
        "verdict": run.load.verdict,
    }


def _transitions(run: Rehearsed) -> list[dict[str, Any]]:
    """Every step of every alarm."""
    return [
        {
            "at_s": _number(one.at_s),
            "alarm": one.alarm_id,
            "occurrence": one.occurrence,
            "change": one.change,
            "text": one.text,
            "announces": one.announces,
        }
        for one in run.transitions
    ]


def episode_json(episode: Episode) -> dict[str, Any]:
    """One alarm."""
    return {
        "alarm": episode.alarm_id,
        "title": episode.title,
        "priority": str(episode.priority),
        "raised_s": _number(episode.raised_s),
        "cleared_s": _number(episode.cleared_s),
        "for_s": _number(episode.for_s),
        "trip_text": episode.trip_text,
        "worst": _finding(episode.worst),
        "causes": list(episode.causes),
        "announcements": [{"at_s": _number(s.at_s), "change": s.change, "text": s.text} for s in episode.announcements],
        "suppressed": [[_number(from_s), _number(to_s)] for from_s, to_s in episode.suppressed],
    }


def _compared(report: Report, before: Rehearsed) -> dict[str, Any]:
    return {
        "with": "the recording without the injected faults"
        if report.run.faults
        else before.override.name or "defaults",
        "settings": [
            {"label": label, "before": old, "after": new, "unit": unit}
            for label, old, new, unit in differences(before, report.run)
        ],
        "alarms_before": [episode_json(episode) for episode in before.episodes],
        "changes": [
            {
                "change": change.kind,
                "alarm": change.episode.alarm_id,
                "title": change.episode.title,
                "priority": str(change.episode.priority),
                "before": _span(change.before),
                "after": _span(change.after),
            }
            for change in report.changes
        ],
    }


def _span(episode: Episode | None) -> dict[str, Any] | None:
    if episode is None:
        return None
    return {"raised_s": _number(episode.raised_s), "cleared_s": _number(episode.cleared_s)}


def _finding(finding: Finding | None) -> dict[str, Any] | None:
    if finding is None:
        return None
    return {"text": finding.text, "measured": _quantity(finding.measured), "limit": _quantity(finding.limit)}


def _quantity(quantity: Quantity | None) -> dict[str, Any] | None:
    if quantity is None:
        return None
    return {"label": quantity.label, "value": _number(quantity.value), "unit": quantity.unit}


def _number(value: float | None, digits: int = 4) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), digits)

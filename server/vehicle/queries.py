"""A session's answers beyond its state: track, further topics, one check in detail, reasons of refusals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from monitor.catalog import AnyCheck
from monitor.check import Finding
from monitor.runner import Monitor, Refused
from monitor.signals import SIGNALS
from monitor.state import Snapshot, TrackPoint
from monitor.tiles import NOT_YET
from monitor.trends import STEP_S, TRENDS, CheckCourse, CheckMinute
from server.control.lease import NotInControl
from server.judge.reception_stats import Reception
from server.judge.settings import BadSetting, Conflict
from server.protocol import commands, serialize
from server.protocol import drive_trends as drive
from server.protocol.alarm_state import CheckAnswer, CheckEnd, CheckMinuteState, TileCheck
from server.protocol.answers import SignalsAnswer, TrackPoints
from server.protocol.messages import Answer
from server.protocol.questions import TopicOffer
from server.rosbridge import connection_errors
from server.rosbridge.address import BadAddress
from server.vehicle.judgement import Judgement

REFUSALS = (
    commands.NotUnderstood,
    BadAddress,
    Refused,
    BadSetting,
    Conflict,
    OSError,
)  # those for which `refusal` has a text


def refusal(why: Exception) -> Answer:
    """The reply to a refused command, one of REFUSALS."""
    match why:
        case BadAddress():
            problem = connection_errors.of_bad_address(why)
            return {
                "ok": False,
                "reason": f"{problem.title} {problem.hint}".strip(),
                "problem": {**problem.as_json(), "suggestion": why.suggestion},
            }
        case NotInControl():
            return {"ok": False, "reason": why.reason, "held_by": why.holder.name if why.holder else None}
        case Refused():
            return {"ok": False, "reason": why.reason}
        case BadSetting():
            return {"ok": False, "reason": str(why), "field": why.field}
        case Conflict():
            return {"ok": False, "reason": str(why), "conflict": True}
        case OSError():
            return {"ok": False, "reason": f"The settings cannot be kept: {why.strerror or why}."}
    return {"ok": False, "reason": str(why)}


def track(snapshot: Snapshot) -> dict[str, Any]:
    """The positions since connecting, thinned, as a GeoJSON MultiLineString (longitude, latitude; WGS84).

    A line ends where the way to the next point is not known: the position leapt, or none came for a while. A line has
    two points at least (RFC 7946, 3.1.4), so a point alone is left out.
    """
    lines: list[list[list[float]]] = []
    for point in snapshot.track:
        if not lines or point.is_jump or point.is_after_gap:
            lines.append([])
        lines[-1].append([round(point.lon_deg, 7), round(point.lat_deg, 7)])
    return {
        "type": "Feature",
        "geometry": {"type": "MultiLineString", "coordinates": [line for line in lines if len(line) > 1]},
        "properties": {"length_m": serialize.plain(snapshot.track_m, 1)},
    }


def track_points(snapshot: Snapshot, *, number: int, after: int) -> TrackPoints:
    """The points of track `number` beyond point `after`, oldest first, as docs/protocol.md has them."""
    rows = [
        (p.number, round(p.lat_deg, 7), round(p.lon_deg, 7), round(p.at_s, 1), _joins(p))
        for p in snapshot.track
        if p.number > after
    ]
    return {"number": number, "points": rows}


def drive_trends(
    judgement: Judgement, message: Mapping[str, Any], now_s: float, wall_ms: int
) -> drive.DriveTrendsAnswer:
    """A part of the drive since this car was dialled."""
    trends = judgement.drive_trends
    length_s = max(0.0, now_s - trends.since_s)
    facts = drive.DriveFacts(
        now_s=now_s,
        start_ms=round(wall_ms - length_s * 1000),
        length_s=length_s,
        marks=judgement.marks,
        marks_left_out=judgement.marks.left_out,
    )
    return drive.answer(trends, drive.Wanted.of(message), facts)


def _joins(point: TrackPoint) -> int:
    """How a point joins the one before it: 0 driven, 1 after a time without positions, 2 the position leapt."""
    return 2 if point.is_jump else 1 if point.is_after_gap else 0


def signals(
    candidates: dict[str, list[TopicOffer]] | None, unmapped: Mapping[str, str], reception: Reception
) -> SignalsAnswer:
    """The possible topics of each signal (None: not known), topics beyond the signals (topic → type), unreadable
    frames."""
    return {
        "candidates": candidates,
        "topics": [{"topic": name, "type": kind} for name, kind in sorted(unmapped.items())],
        "rejected": {
            SIGNALS[name].label: dict(tally.reasons) for name, tally in reception.by_signal.items() if tally.rejected
        },
        "unreadable_frames": dict(reception.frames.reasons),
        "unasked": reception.unasked,
    }


def check_answer(monitor: Monitor, name: str, now_s: float, minute: CheckMinute) -> CheckAnswer | Answer:
    """One check in detail, for a page that opens it: of the live car or of a replay.

    What is known of it, or why it is not.
    """
    check = next((one for one in monitor.checks if one.id == name), None)
    if check is None:
        return {"ok": False, "reason": "There is no such check."}
    finding = monitor.findings.get(name, NOT_YET)
    course = minute.course(name)
    spec, alarm = check.alarm, monitor.alarms[name]
    return {
        "id": name,
        "label": check.label,
        "tile": check.tile_label,
        "checks": [_listed(one, monitor) for one in monitor.checks if one.tile_label == check.tile_label],
        "verdict": finding.verdict,
        "text": finding.text,
        "for_s": _for_s(course, now_s),
        "measured": serialize.quantity(finding.measured),
        "limit": serialize.quantity(finding.limit),
        "checked_when": check.checked_when,
        "settings": [f"{check.limits_group}.{field}" for field in check.limits.model_fields],
        "title": spec.title,
        "priority": spec.priority,
        "delays": {"on_s": spec.on_delay_s, "off_s": spec.off_delay_s},
        "ends": _ends(check, monitor),
        "advice": spec.advice,
        "suppressed_by": serialize.explained_by(alarm, monitor.alarms),
        "signal": _signal(check, finding),
        "minute": _minute(course),
    }


def _ends(check: AnyCheck, monitor: Monitor) -> CheckEnd | None:
    """By the limits in force."""
    if check.ends is None:
        return None
    side, value, unit = check.ends(getattr(monitor.limits, check.limits_group, None) or check.limits())
    return {"side": side, "value": serialize.plain(value, 3), "unit": unit}


def _listed(check: AnyCheck, monitor: Monitor) -> TileCheck:
    finding = monitor.findings.get(check.id, NOT_YET)
    return {
        "id": check.id,
        "label": check.label,
        "verdict": finding.verdict,
        "text": finding.text,
        "priority": check.alarm.priority,
    }


def _for_s(course: CheckCourse, now_s: float) -> float | None:
    return None if course.since_s is None else serialize.plain(now_s - course.since_s, 1)


def _minute(course: CheckCourse) -> CheckMinuteState:
    return {
        "step_s": STEP_S,
        "values": [serialize.plain(value, 3) for value in course.values],
        "limits": [serialize.plain(value, 3) for value in course.limits],
    }


def _signal(check: AnyCheck, finding: Finding) -> str | None:
    """The trend of the one signal that it needs."""
    names = [name for name in TRENDS if name in check.needs]
    return names[0] if len(names) == 1 else None

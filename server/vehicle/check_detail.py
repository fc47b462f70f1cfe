"""One check in detail, for a page that opens it: of the live car or of a replay."""

from __future__ import annotations

from monitor.catalog import AnyCheck
from monitor.check import Finding
from monitor.check_minute import CheckCourse, CheckMinute
from monitor.runner import Monitor
from monitor.tiles import NOT_YET
from monitor.trends import STEP_S, TRENDS
from server.protocol import serialize
from server.protocol.check_state import CheckAnswer, CheckEnd, CheckMinuteState, TileCheck
from server.protocol.messages import Answer


def check_answer(monitor: Monitor, name: str, now_s: float, minute: CheckMinute) -> CheckAnswer | Answer:
    """What is known of it, or why it is not."""
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
    return {"id": check.id, "label": check.label, "verdict": finding.verdict, "text": finding.text}


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

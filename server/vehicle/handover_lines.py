"""The lines of the list when control is handed over: alarms, shelved ones, limits changed from their default, who is in
the car, who drives, the departure check, the slow-down and a pause."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

from monitor.planned_stop import REASONS, PlannedStop
from monitor.values import Mode
from server.control.handover import Line
from server.control.lease import Operator
from server.protocol.alarm_state import StandingAlarm
from server.protocol.answers import SettingsAnswer
from server.protocol.departure import DepartureState
from server.protocol.driving_state import ModeState, WhyUnknown
from server.protocol.operator_state import LineKind
from server.protocol.slow_down_state import SlowDownPhase

MOST_ALARMS = 20  # each with a line of its own; more of them are one line
MOST_LIMITS = 20
_SLOW_DOWN: dict[SlowDownPhase, str] = {
    "not_available": "Slow-down is not available",
    "not_armed": "Slow-down is not armed",
    "armed": "Slow-down is armed",
    "ordered": "The car is being slowed",
    "holding": "The car is held",
}
_DRIVES: dict[Mode, str] = {
    "autonomous": "The car drives itself",
    "manual": "A person drives the car",
    "unknown": "Who drives is not known",
}
_WHY: dict[WhyUnknown, str] = {
    "no_source": "The car has no topic for it.",
    "silent": "The topic for it is silent.",
    "flickers": "The mode flickers.",
    "unclear": "The car does not report it.",
}


def alarm_lines(standing: Sequence[StandingAlarm]) -> list[Line]:
    """Of each alarm one line, the most urgent first; shelved ones after the others."""
    active = [alarm for alarm in standing if alarm["state"] != "SHELVED"]
    lines = [
        Line(
            key=alarm_key("alarm", alarm["id"], alarm["occurrence"]),
            kind="alarm",
            title=alarm["title"] if alarm["active"] else alarm["ended_title"],
            text=f"{alarm['text'] or alarm['trip_text']} {_answered(alarm)}".strip(),
            priority=alarm["priority"],
            since_ms=alarm["raised_ms"],
            off_duty_ms=alarm.get("off_duty_ms"),
        )
        for alarm in active[:MOST_ALARMS]
    ]
    if rest := active[MOST_ALARMS:]:
        keys = [f"{alarm['id']}:{alarm['occurrence']}" for alarm in rest]
        lines.append(Line(key=_joined("alarms", keys), kind="alarm", title=f"{len(rest)} more alarms"))
    if not active:
        lines.append(Line(key="alarms:none", kind="alarm", title="No alarm is active"))
    return lines + [
        Line(
            key=alarm_key("shelved", alarm["id"], alarm["occurrence"]),
            kind="shelved",
            title=f"Shelved: {alarm['title']}",
            text=f"{alarm['text']} {f'By {by}.' if (by := alarm['shelved_by']) else ''}".strip(),
            priority=alarm["priority"],
            until_ms=alarm["shelved_until_ms"],
        )
        for alarm in standing
        if alarm["state"] == "SHELVED"
    ]


def alarm_key(kind: LineKind, alarm: str, occurrence: int) -> str:
    """The key of the line that one alarm has for itself."""
    return f"{kind}:{alarm}:{occurrence}"


def _answered(alarm: StandingAlarm) -> str:
    by = alarm["acknowledged_by"]
    return f"Acknowledged by {by}." if by else "" if alarm["state"] == "ACKED" else "Not acknowledged."


def limit_lines(settings: SettingsAnswer) -> list[Line]:
    """Of each limit that differs from its default one line."""
    lines = []
    changed = settings["changed"]
    for name in changed[:MOST_LIMITS]:
        field, value, default = settings["schema"][name], settings["values"].get(name), settings["defaults"].get(name)
        unit = field["unit"]
        title = f"{field['title']}: {value:g} {unit}".strip()
        text = "" if default is None else f"Default: {default:g} {unit}".strip()
        lines.append(Line(key=f"limit:{name}:{value:g}", kind="limit", title=title, text=text))
    if rest := changed[MOST_LIMITS:]:
        keys = [f"{name}:{settings['values'].get(name)}" for name in rest]
        lines.append(Line(key=_joined("limits", keys), kind="limit", title=f"{len(rest)} more changed limits"))
    return lines


def in_car_line(people: Sequence[Operator], phone: str | None) -> Line:
    """Who is in the car: who is signed on as safety driver with a page of this car, and the phone that is in it."""
    names = sorted({one.person.name for one in people if one.person is not None and one.person.role == "safety_driver"})
    where = f"Phone in the car: {phone}." if phone else "No phone is known to be in the car."
    title = (
        f"In the car: {' and '.join(names)}, safety driver{'s' if len(names) > 1 else ''}"
        if names
        else "Who is in the car is not known"
    )
    text = where if names else f"Nobody is signed on as safety driver. {where}"
    return Line(key=_joined("rides", [*names, phone or ""]), kind="rides", title=title, text=text)


def driving_line(mode: ModeState) -> Line:
    """Who drives; another mode, or another reason not to know it, is another line."""
    text = "" if mode["why"] is None else _WHY[mode["why"]]
    since_ms = mode["since_ms"] if mode["mode"] != "unknown" else None
    key = f"driving:{mode['mode']}:{mode['why'] or ''}"
    return Line(key=key, kind="driving", title=_DRIVES[mode["mode"]], text=text, since_ms=since_ms)


def departure_line(check: DepartureState, failed_items: Mapping[str, str]) -> Line:
    """The departure check of this drive; one that is signed, opened or begun meanwhile, or of which an
    other item fails, is another line. `failed_items`: id → title."""
    if check["state"] == "none":
        return Line(key="departure:none", kind="departure", title="No departure check was made")
    is_signed, failed, at_ms = check["state"] == "signed", check["failed"], check["at_ms"]
    counts = [f"{check['done']} of {check['of']} items done"]
    counts += [f"{check['not_applicable']} not applicable"] if check["not_applicable"] else []
    which = ": " + ", ".join(failed_items.values()) if failed_items else ""
    counts += [f"{failed} failed{which}"] if failed else []
    title = "Departure check is not signed"
    if is_signed:
        title = f"Departure check signed{' with failed items' if failed else ''}"
    by = f"{'Signed' if is_signed else 'Begun'} by {check['by'] or 'nobody known'}"
    text = f"{by}: {', '.join(counts)}."
    key = _joined(f"departure:{check['state']}:{at_ms}", sorted(failed_items))
    return Line(key=key, kind="departure", title=title, text=text, since_ms=at_ms)


def stop_lines(stop: PlannedStop | None, now_s: float, wall_ms: int) -> list[Line]:
    """A planned stop."""
    if stop is None:
        return []
    text = "Its alarms are marked; only critical ones sound." + (f" By {stop.by}." if stop.by else "")
    since_ms = round(wall_ms - (now_s - stop.since_s) * 1000)
    title = f"Planned stop: {REASONS[stop.reason]}"
    return [Line(key=f"planned_stop:{stop.reason}", kind="planned_stop", title=title, text=text, since_ms=since_ms)]


def mode_lines(slow_down: SlowDownPhase, why: str | None, paused_by: str | None, *, is_paused: bool) -> list[Line]:
    """Whether the car can be slowed, and a pause."""
    text = why if why and slow_down == "not_available" else ""
    lines = [Line(key=f"slow_down:{slow_down}", kind="slow_down", title=_SLOW_DOWN[slow_down], text=text)]
    if is_paused:
        by = f"By {paused_by}." if paused_by else ""
        lines.append(
            Line(key="paused", kind="paused", title="Monitoring is paused", text=f"No alarm is raised. {by}".strip())
        )
    return lines


def _joined(kind: str, keys: Sequence[str]) -> str:
    """A key of several things."""
    return f"{kind}:{hashlib.sha256(chr(0).join(keys).encode()).hexdigest()[:12]}"

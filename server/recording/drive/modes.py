"""Who drove and what was done in a drive: spans of driving modes, interventions, planned stops, orders to slow down.

Times are ms since 1970.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from monitor.planned_stop import REASONS, reason_of
from server.recording.drive.drive_events import Event, moment_of, number_of, of_change, text_of, whole_of

MODES = ("autonomous", "manual", "unknown")
MOST_INTERVENTIONS = 1000
_KINDS = {
    "to_manual": "change to manual",
    "brake": "brake against the command",
    "steer": "steering against the command",
}
_INITIATORS = ("driver", "operator", "system")
MOST_PLANNED_STOPS = 500
MOST_SLOW_DOWNS = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeSpan:
    """One mode from a moment to another."""

    mode: str
    from_ms: int
    to_ms: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervention:
    """One, with its description where somebody gave one. None: not known."""

    intervention: str
    at_ms: int
    kind_of: str
    kind: str  # as text
    speed_mps: float | None
    lat_deg: float | None
    lon_deg: float | None
    initiated_by: str  # driver, operator, system or unknown
    active: tuple[str, ...]  # alarms
    before: tuple[tuple[float, float], ...]  # seconds relative to it, speed
    what: str = ""
    category: str = ""
    described_by: str = ""


def mode_spans(events: Sequence[Event], start_ms: int, end_ms: int) -> list[ModeSpan]:
    """The whole drive without a gap; what is not in the log is unknown. Neighbours of one mode are one span."""
    changes: list[tuple[int, str]] = []
    first = "unknown"
    for event in sorted(of_change(events, "mode"), key=moment_of):
        if not changes and moment_of(event) > start_ms:
            first = _mode(event.get("before"))
        changes.append((max(start_ms, moment_of(event)), _mode(event.get("mode"))))
    spans: list[ModeSpan] = []
    for (from_ms, mode), (to_ms, _) in zip([(start_ms, first), *changes], [*changes, (end_ms, "")], strict=True):
        to_ms = min(max(to_ms, from_ms), max(end_ms, start_ms))
        if spans and spans[-1].mode == mode:
            spans[-1] = replace(spans[-1], to_ms=max(to_ms, spans[-1].to_ms))
        elif to_ms > from_ms:
            spans.append(ModeSpan(mode=mode, from_ms=from_ms, to_ms=to_ms))
    return spans


def are_modes_known(events: Sequence[Event]) -> bool:
    """Whether the car's mode was ever known: without one no number of interventions is."""
    return any(
        _mode(event.get("mode")) != "unknown" or _mode(event.get("before")) != "unknown"
        for event in of_change(events, "mode")
    ) or any(True for _ in of_change(events, "intervention"))


def interventions_of(events: Sequence[Event]) -> list[Intervention]:
    """All of them in order of time, each with its newest description; what that leaves open is as the data say."""
    found: dict[str, Intervention] = {}
    begun: dict[str, str] = {}  # by whom, as the data say
    for event in of_change(events, "intervention", "intervention_described"):
        id = text_of(event, "intervention", 60)
        if not id:
            continue
        if event["change"] == "intervention":
            if id not in found and len(found) < MOST_INTERVENTIONS:
                found[id] = _intervention(id, event)
                begun[id] = found[id].initiated_by
        elif id in found:
            found[id] = replace(
                found[id],
                what=text_of(event, "what", 2000),
                category=text_of(event, "category", 60),
                described_by=text_of(event, "by", 120),
                initiated_by=begun[id] if event.get("initiated_by") is None else _initiator(event),
            )
    return sorted(found.values(), key=lambda one: one.at_ms)


def _mode(value: object) -> str:
    return str(value) if value in MODES else "unknown"


def _intervention(id: str, event: Event) -> Intervention:
    kind = event.get("kind_of")
    active, before = event.get("active"), event.get("before")
    return Intervention(
        intervention=id,
        at_ms=moment_of(event),
        kind_of=text_of(event, "kind_of", 20),
        kind=_KINDS.get(kind, "kind not known") if isinstance(kind, str) else "kind not known",
        speed_mps=number_of(event, "speed_mps"),
        lat_deg=number_of(event, "lat_deg"),
        lon_deg=number_of(event, "lon_deg"),
        initiated_by=_initiator(event),
        active=tuple(text[:80] for text in active[:50] if isinstance(text, str)) if isinstance(active, list) else (),
        before=_before(before) if isinstance(before, list) else (),
    )


def _initiator(event: Event) -> str:
    initiated = event.get("initiated_by")
    return str(initiated) if initiated in _INITIATORS else "unknown"


def _before(rows: list[object]) -> tuple[tuple[float, float], ...]:
    found = []
    for row in rows[:200]:
        if isinstance(row, dict):
            at_s, speed_mps = number_of(row, "at_s"), number_of(row, "speed_mps")
            if at_s is not None and speed_mps is not None:
                found.append((at_s, speed_mps))
    return tuple(found)


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
        if len(found) < MOST_PLANNED_STOPS:
            from_ms = at_ms if since_ms is None else round(since_ms)
            found.append(PlannedStopInDrive(reason=reason, by=text_of(event, "by", 120), from_ms=from_ms))
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowDownInDrive:
    """One order. None: that did not happen, or not in this drive."""

    order: int
    by: str
    why: str
    ordered_ms: int
    sent_ms: int | None = None  # the first command
    slows_ms: int | None = None  # the car's speed proved it
    proof: str = ""  # the text of the proof
    not_confirmed_ms: int | None = None
    released_ms: int | None = None
    steps: int = 1


_MOMENTS = {"sent": "sent_ms", "slows": "slows_ms", "not_confirmed": "not_confirmed_ms"}


def slow_downs_of(events: Sequence[Event]) -> list[SlowDownInDrive]:
    """All orders, in order."""
    found: dict[int, SlowDownInDrive] = {}
    for event in of_change(events, "slow_down"):
        number, step = whole_of(event, "order"), text_of(event, "step", 20)
        if not number:
            continue
        order = found.get(number)
        if order is None:
            if len(found) >= MOST_SLOW_DOWNS:
                continue
            by = text_of(event, "ordered_by", 120) or text_of(event, "by", 120)
            order = SlowDownInDrive(order=number, by=by, why=text_of(event, "why", 300), ordered_ms=event["at_ms"])
        found[number] = _after_step(order, step, event)
    return list(found.values())


def _after_step(order: SlowDownInDrive, step: str, event: Event) -> SlowDownInDrive:
    order = replace(order, steps=order.steps + 1)
    if step in ("slows", "not_confirmed", "stands"):
        order = replace(order, proof=text_of(event, "text", 300))
    if step in _MOMENTS and getattr(order, _MOMENTS[step]) is None:
        return replace(order, **{_MOMENTS[step]: event["at_ms"]})
    if step in ("released", "ended"):
        return replace(order, released_ms=event["at_ms"])
    return order

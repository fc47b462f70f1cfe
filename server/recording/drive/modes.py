"""Who drove: spans of driving modes, and interventions. Times are ms since 1970."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from server.recording.drive.drive_events import Event, moment_of, number_of, of_change, text_of

MODES = ("autonomous", "manual", "unknown")
MOST_INTERVENTIONS = 1000
_KINDS = {
    "to_manual": "change to manual",
    "brake": "brake against the command",
    "steer": "steering against the command",
}
_INITIATORS = ("driver", "operator", "system")


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

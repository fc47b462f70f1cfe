"""The transition of an alarm from its event in the log, which an older or a newer version may have written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import StrEnum
from typing import Any, TypeVar, cast, get_args

from monitor.alarm import LEVEL, AlarmState, Change, Transition
from monitor.alarm_spec import AlarmSpec, Place, Priority, Sound, priority_of
from monitor.catalog import CHECKS
from monitor.check import Finding, Quantity, fault
from monitor.runner import IMPAIRED, IMPAIRED_SPEC

Clock = Callable[[float], float]
Named = TypeVar("Named", bound=StrEnum)
_CHANGES = frozenset(get_args(Change))
_LETTERS = 120  # of a title

_SPECS = {check.id: check.alarm for check in CHECKS} | {IMPAIRED: IMPAIRED_SPEC}
_UNKNOWN = AlarmSpec(title="", priority=Priority.CRITICAL, place=Place.DIALOG, sound=Sound.HIGH, needs_ack=True)
_SHOWN = {  # where an alarm of this priority is shown and how it sounds, if its event does not say it
    Priority.CRITICAL: (_UNKNOWN.place, _UNKNOWN.sound),
    Priority.WARNING: (Place.SNACKBAR, Sound.MEDIUM),
    Priority.ADVISORY: (Place.LIST, Sound.LOW),
}
_STATE_AFTER: Mapping[str, AlarmState] = {  # if its event does not say it; of any other change: it waits for a person
    "cleared": AlarmState.NORMAL,
    "acknowledged": AlarmState.ACKED,
    "handed_over": AlarmState.ACKED,
    "shelved": AlarmState.SHELVED,
    "suppressed": AlarmState.SUPPRESSED,
}
_ANNOUNCE = ("raised", "recaused", "unshelved", "unacknowledged")  # if its event does not say it
_CHANGE_TO: Mapping[AlarmState, Change] = {  # if its event names a change that this version does not know
    AlarmState.NORMAL: "cleared",
    AlarmState.ACKED: "acknowledged",
    AlarmState.RTN_UNACKED: "cleared",
    AlarmState.SHELVED: "shelved",
    AlarmState.SUPPRESSED: "suppressed",
}


def spec_of(event: Mapping[str, Any]) -> AlarmSpec:
    """The alarm as its event declares it. What the event leaves out is as in this version; an alarm or a priority that
    this version does not know is shown and sounds as the most urgent one."""
    known = _SPECS.get(alarm := str(event["alarm"]))
    declared = event.get("priority")
    priority = known.priority if known is not None and declared is None else priority_of(declared)
    is_same = known is not None and known.priority is priority
    place, sound = (known.place, known.sound) if known is not None and is_same else _SHOWN[priority]
    if declared == priority:
        place, sound = _named(Place, event.get("place"), place), _named(Sound, event.get("sound"), sound)
    title = text_of(event.get("title")) or (known.title if known is not None else alarm)
    return replace(known or _UNKNOWN, title=title[:_LETTERS], priority=priority, place=place, sound=sound)


def transition_of(event: Mapping[str, Any], moment_s: Clock, shelf_s: Clock) -> Transition | None:
    """The transition, or None where the event has no moment or no change. An alarm, a priority, a state or a change
    that this version does not know is no reason to leave it out."""
    change = event.get("change")
    if not isinstance(change, str) or not isinstance(event.get("at_ms"), (int, float)):
        return None
    state = _named(AlarmState, event.get("state"), _STATE_AFTER.get(change, AlarmState.UNACKED))
    until_ms = event.get("shelved_until_ms")
    causes = _texts(event.get("causes"))
    return Transition(
        alarm_id=str(event["alarm"]),
        spec=spec_of(event),
        occurrence=int(number_of(event.get("occurrence"), 0)),
        change=cast(Change, change) if change in _CHANGES else _CHANGE_TO.get(state, "recaused"),
        at_s=moment_s(event["at_ms"]),
        text=text_of(event.get("text")) or "",
        by=text_of(event.get("by")),
        announces=event.get("announces", change in _ANNOUNCE) is True,
        state=state,
        finding=_finding(event, causes),
        causes=causes,
        suppressed_by=_texts(event.get("suppressed_by")),
        shelved_until_s=shelf_s(until_ms) if isinstance(until_ms, (int, float)) else None,
        worst=_worst(event),
    )


def _named(kind: type[Named], name: object, otherwise: Named) -> Named:
    try:
        return kind(str(name))
    except ValueError:
        return otherwise


def _finding(event: Mapping[str, Any], causes: tuple[str, ...]) -> Finding:
    return fault(
        text_of(event.get("text")) or "",
        measured=_quantity(event.get("measured")),
        limit=_quantity(event.get("limit")),
        causes=tuple(name for name in causes if not name.startswith(LEVEL)),
        level=sum(name.startswith(LEVEL) for name in causes),
    )


def _worst(event: Mapping[str, Any]) -> Finding | None:
    measured = _quantity(event.get("worst"))
    return None if measured is None else fault("", measured=measured, limit=_quantity(event.get("limit")))


def _quantity(body: Any) -> Quantity | None:
    match body:
        case {"label": str(label), "value": float() | int() as value, "unit": str(unit)}:
            return Quantity(label=label, value=float(value), unit=unit)
    return None


def text_of(value: Any) -> str | None:
    return value if isinstance(value, str) else None


def _texts(value: Any) -> tuple[str, ...]:
    return tuple(name for name in value if isinstance(name, str)) if isinstance(value, list) else ()


def number_of(value: Any, otherwise: float) -> float:
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else otherwise

"""The transition of an alarm from its event in the log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast, get_args

from monitor.alarm import LEVEL, AlarmState, Change, Transition
from monitor.check import Finding, Quantity, fault

Clock = Callable[[float], float]
_CHANGES = frozenset(get_args(Change))


def transition_of(event: Mapping[str, Any], moment_s: Clock, shelf_s: Clock) -> Transition | None:
    """The transition, or None where the event holds none that can be used: the log may be older than this program."""
    change = event.get("change")
    if not isinstance(change, str) or change not in _CHANGES or not isinstance(event.get("at_ms"), (int, float)):
        return None
    try:
        state = AlarmState(event.get("state", ""))
    except ValueError:
        return None
    until_ms = event.get("shelved_until_ms")
    causes = _texts(event.get("causes"))
    return Transition(
        alarm_id=str(event["alarm"]),
        occurrence=int(number_of(event.get("occurrence"), 0)),
        change=cast(Change, change),
        at_s=moment_s(event["at_ms"]),
        text=text_of(event.get("text")) or "",
        by=text_of(event.get("by")),
        announces=event.get("announces") is True,
        state=state,
        finding=_finding(event, causes),
        causes=causes,
        suppressed_by=_texts(event.get("suppressed_by")),
        shelved_until_s=shelf_s(until_ms) if isinstance(until_ms, (int, float)) else None,
        worst=_worst(event),
    )


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

"""The departure check of before this run, from the log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, cast, get_args

from server.bus.bus import SessionBus
from server.control.departure import Result, Signature
from server.judge.logged_transition import number_of, text_of
from server.protocol.departure import DepartureCounts, DepartureResult
from server.protocol.people import ROLES

MOST_EVENTS = 3000  # of one check: 60 items that turn 20 times each, and what people do besides
_PORTION = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class DeparturePast:
    """What stood when the server ended."""

    id: str | None = None  # None: no check stood
    by: str | None = None
    begun_ms: int = 0
    results: Mapping[str, Result] = field(default_factory=dict)
    signature: Signature | None = None
    signed: Mapping[str, Any] | None = None  # its event
    is_without_logged: bool = False  # it is in the log that the car drives without one
    is_of_drive: bool = False  # a car was monitored


def recall(bus: SessionBus, vehicle: str) -> DeparturePast:
    """Reads the log. Monitoring that was stopped ended its check."""
    started, stopped = (_newest(bus, vehicle, change) for change in ("started", "stopped"))
    events: list[Mapping[str, Any]] = []
    for event in _backwards(bus, vehicle):
        if _number(event) < stopped or len(events) >= MOST_EVENTS:
            break
        events.insert(0, event)
        if event.get("step") == "begun":
            break
    is_without_logged = any(event.get("step") == "without" for event in events)
    if not events or events[0].get("step") != "begun":
        return DeparturePast(is_without_logged=is_without_logged, is_of_drive=started > stopped)
    begun, signed = events[0], None
    results: dict[str, Result] = {}
    for one in events[1:]:
        match one.get("step"):
            case "item" if (name := text_of(one.get("item"))) is not None:
                results[name] = _result(one, results.get(name, Result()))
            case "signed":
                signed = one
            case "reopened":
                signed = None
    return DeparturePast(
        id=text_of(begun.get("check")) or "",
        by=text_of(begun.get("by")),
        begun_ms=_moment_ms(begun),
        results=results,
        signature=None if signed is None else _signature(signed),
        signed=signed,
        is_without_logged=is_without_logged,
        is_of_drive=started > stopped,
    )


def _result(event: Mapping[str, Any], had: Result) -> Result:
    found = event.get("result")
    result = cast(DepartureResult, found) if found in get_args(DepartureResult) else "open"
    given_for = text_of(event.get("hash")) or text_of(event.get("item_title")) or ""
    return Result(
        given_for=given_for,
        result=result,
        value=text_of(event.get("value")) or "",
        note=text_of(event.get("note")) or "",
        by=text_of(event.get("by")),
        at_ms=None if result == "open" else _moment_ms(event),
        is_fixed=had.given_for == given_for and (had.is_fixed or had.result == "failed"),
    )


def _signature(event: Mapping[str, Any]) -> Signature:
    counts: DepartureCounts = {
        "done": int(number_of(event.get("done"), 0)),
        "failed": int(number_of(event.get("failed"), 0)),
        "not_applicable": int(number_of(event.get("not_applicable"), 0)),
        "of": int(number_of(event.get("of"), 0)),
    }
    return Signature(
        by=text_of(event.get("by")) or "",
        role=next((title for role, title in ROLES.items() if role == event.get("role")), ""),
        at_ms=_moment_ms(event),
        counts=counts,
        fixed=int(number_of(event.get("fixed"), 0)),
        hash=text_of(event.get("hash")) or "",
    )


def _moment_ms(event: Mapping[str, Any]) -> int:
    """When it happened; it is logged a moment later."""
    return int(number_of(event.get("moment_ms"), number_of(event.get("at_ms"), 0)))


def _number(event: Mapping[str, Any]) -> int:
    return int(number_of(event.get("n"), 0))


def _newest(bus: SessionBus, vehicle: str, change: str) -> int:
    found = bus.past_events(vehicle, change=change, limit=1)
    return _number(found[0]) if found else -1


def _backwards(bus: SessionBus, vehicle: str) -> Iterator[dict[str, Any]]:
    before: int | None = None
    while events := bus.past_events(vehicle, change="departure", before=before, limit=_PORTION):
        yield from events
        before = events[-1]["n"]

"""The orders to slow the car in a drive, and what proved them. Times are ms since 1970."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from server.recording.drive.drive_events import Event, of_change, text_of, whole_of

MOST = 500


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
            if len(found) >= MOST:
                continue
            by = text_of(event, "ordered_by", 120) or text_of(event, "by", 120)
            order = SlowDownInDrive(order=number, by=by, why=text_of(event, "why", 300), ordered_ms=event["at_ms"])
        found[number] = _after(order, step, event)
    return list(found.values())


def _after(order: SlowDownInDrive, step: str, event: Event) -> SlowDownInDrive:
    order = replace(order, steps=order.steps + 1)
    if step in ("slows", "not_confirmed", "stands"):
        order = replace(order, proof=text_of(event, "text", 300))
    if step in _MOMENTS and getattr(order, _MOMENTS[step]) is None:
        return replace(order, **{_MOMENTS[step]: event["at_ms"]})
    if step in ("released", "ended"):
        return replace(order, released_ms=event["at_ms"])
    return order

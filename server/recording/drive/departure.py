"""The departure check of a drive as its log has it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from server.protocol.departure import RecurringItem
from server.recording.drive.drive_events import Event, number_of, of_change, text_of, whole_of

MOST_ITEMS = 200
MOST_FAILED = 20  # that the logbook names
_RESULTS = ("done", "failed", "not_applicable", "open")


@dataclass(frozen=True, slots=True, kw_only=True)
class DepartureItem:
    """One item, as it was last."""

    item: str
    title: str
    result: str  # done, failed, not_applicable or open
    value: str  # what was seen
    note: str
    at_ms: int
    by: str
    had_failed: bool  # in this check: done, it was fixed


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """The last check that was begun. `none`: no departure check was made."""

    state: Literal["none", "open", "signed"] = "none"
    by: str = ""
    at_ms: int | None = None  # when it was signed
    done: int = 0
    failed: int = 0
    not_applicable: int = 0
    of: int = 0
    hash: str = ""  # of the list and its results
    items: tuple[DepartureItem, ...] = ()
    recurring: tuple[RecurringItem, ...] = ()  # of the signed one


def departure_of(events: Sequence[Event]) -> Departure:
    """The departure check by the log; items of an earlier check do not count for a later one."""
    check: object = None
    items: dict[str, DepartureItem] = {}
    newest: Event | None = None
    signed: Event | None = None
    for event in of_change(events, "departure"):
        step = event.get("step")
        if step == "without":  # the drive began without one; one that is signed or goes on later counts, all of it
            newest = signed = None
            continue
        if event.get("check") != check or step == "begun":
            check, items, signed = event.get("check"), {}, None
        if step == "item" and len(items) < MOST_ITEMS:
            name = text_of(event, "item", 80)
            items[name] = _item(event, items.get(name))
        signed = event if step == "signed" else None if step in ("reopened", "begun", "item") else signed
        newest = event
    if newest is None:
        return Departure()
    latest = signed or newest
    return Departure(
        state="open" if signed is None else "signed",
        by=text_of(latest, "by", 120),
        at_ms=None if signed is None else signed["at_ms"],
        done=whole_of(latest, "done"),
        failed=whole_of(latest, "failed"),
        not_applicable=whole_of(latest, "not_applicable"),
        of=whole_of(latest, "of"),
        hash="" if signed is None else text_of(signed, "hash", 64),
        items=tuple(items.values()),
        recurring=() if signed is None else tuple(_recurring(signed)),
    )


def check_of(departure: Departure) -> dict[str, Any] | None:
    """A signed one for the logbook; None: it is not signed. A recording that began later does not name its items."""
    if departure.state != "signed":
        return None
    failed = [item.title for item in departure.items if item.result == "failed"]
    return {
        "at_ms": departure.at_ms,
        "by": departure.by,
        "failed": max(departure.failed, len(failed)),
        "items": failed[:MOST_FAILED],
        "recurring": list(departure.recurring),
    }


def _recurring(event: Event) -> Iterator[RecurringItem]:
    found = event.get("recurring")
    for row in found[:MOST_ITEMS] if isinstance(found, list) else ():
        if not isinstance(row, Mapping) or not (item := text_of(row, "item", 80)):
            continue
        days, km = number_of(row, "every_days"), number_of(row, "every_km")
        yield {
            "item": item,
            "title": text_of(row, "title", 120) or item,
            "every_days": None if days is None or days < 1 else int(days),
            "every_km": None if km is None or km <= 0 else km,
            "is_done": row.get("is_done") is True,
        }


def _item(event: Event, before: DepartureItem | None) -> DepartureItem:
    result = event.get("result")
    return DepartureItem(
        item=text_of(event, "item", 80),
        title=text_of(event, "item_title", 120) or text_of(event, "item", 80),
        result=str(result) if result in _RESULTS else "open",
        value=text_of(event, "value", 120),
        note=text_of(event, "note", 500),
        at_ms=event["at_ms"],
        by=text_of(event, "by", 120),
        had_failed=before is not None and (before.had_failed or before.result == "failed"),
    )

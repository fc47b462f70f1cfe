"""Who was on duty during a drive, and who was in control when. Times are ms since 1970."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from server.protocol.people import ROLES
from server.recording.drive.drive_events import Event, text_of

MOST_PEOPLE = 100


@dataclass(slots=True, kw_only=True)
class Span:
    """A time; None: since before the drive began, or to its end."""

    from_ms: int | None
    to_ms: int | None = None


@dataclass(slots=True, kw_only=True)
class PersonInDrive:
    """One person in one role, or a device at which nobody had signed on."""

    name: str
    role: str  # its title; "": nobody signed on at this device
    on_duty: list[Span] = field(default_factory=list)
    in_control: list[Span] = field(default_factory=list)


def people_of(events: Sequence[Event], start_ms: int) -> list[PersonInDrive]:
    """Everybody who was on duty, gave an order or was in control, in the order in which they appear."""
    found: dict[str, PersonInDrive] = {}
    holder: PersonInDrive | None = None
    for event in events:
        at_ms: int | None = event["at_ms"] if event["at_ms"] > start_ms else None
        person = _person(event, found)
        if person is not None and event["change"] == "duty":
            _change_duty(person, event.get("act"), at_ms)
        if event["change"] == "control":
            if holder is not None:
                _end(holder.in_control, event["at_ms"])
            holder = _holder(text_of(event, "holder", 120), found)
            if holder is not None:
                holder.in_control.append(Span(from_ms=at_ms))
    return list(found.values())


def joined_people(parts: Sequence[tuple[int, int, Sequence[PersonInDrive]]]) -> list[PersonInDrive]:
    """Of a drive of several parts: when each began and ended, and its people. A time that continues in the next part is
    one time; else it ends with its part, because the time between is not known."""
    found: dict[str, PersonInDrive] = {}
    for number, (start_ms, end_ms, people) in enumerate(parts):
        is_last = number == len(parts) - 1
        for one in people:
            known = found.setdefault(one.name, PersonInDrive(name=one.name, role=one.role))
            known.role = known.role or one.role
            for spans, more in ((known.on_duty, one.on_duty), (known.in_control, one.in_control)):
                for span in more:
                    from_ms = start_ms if span.from_ms is None and number else span.from_ms
                    to_ms = end_ms if span.to_ms is None and not is_last else span.to_ms
                    if span.from_ms is None and spans and number and spans[-1].to_ms == parts[number - 1][1]:
                        spans[-1].to_ms = to_ms
                    else:
                        spans.append(Span(from_ms=from_ms, to_ms=to_ms))
    return list(found.values())


def names_of(people: Sequence[PersonInDrive]) -> list[str]:
    """The people by name, without devices at which nobody had signed on."""
    return list(dict.fromkeys(one.name for one in people if one.role))


def _person(event: Event, found: dict[str, PersonInDrive]) -> PersonInDrive | None:
    """The person that an event names as its subject or its author."""
    name = text_of(event, "person", 60)
    if not name:
        return None
    role = event.get("role")
    title = next((title for key, title in ROLES.items() if key == role), "role not known")
    known = found.get(name)
    if known is None and len(found) < MOST_PEOPLE:
        known = found[name] = PersonInDrive(name=name, role=title)
    elif known is not None and known.role != title and title != "role not known":
        known.role = title if not known.role else f"{known.role}, {title}" if title not in known.role else known.role
    return known


def _holder(name: str, found: dict[str, PersonInDrive]) -> PersonInDrive | None:
    """The person's name before the brackets of the device, else the device itself."""
    if not name:
        return None
    person = name.rpartition(" (")[0] if name.endswith(")") else ""
    if person in found:
        return found[person]
    if name not in found and len(found) < MOST_PEOPLE:
        found[name] = PersonInDrive(name=name, role="")
    return found.get(name)


def _change_duty(person: PersonInDrive, act: object, at_ms: int | None) -> None:
    if act == "on" and not (person.on_duty and person.on_duty[-1].to_ms is None):
        person.on_duty.append(Span(from_ms=at_ms))
    elif act == "off":
        if not person.on_duty:
            person.on_duty.append(Span(from_ms=None))
        _end(person.on_duty, at_ms)


def _end(spans: list[Span], at_ms: int | None) -> None:
    if spans and spans[-1].to_ms is None:
        spans[-1].to_ms = at_ms

"""Who is on duty: a person signs on at a device that is paired. Pure: time is an argument, in ms since 1970.

A person is on duty at one device at a time: a name in the log then shows who had the device, and an escalated
alarm or a hand-over goes to one place. Signing on elsewhere moves the duty, and only by a request that states it.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace

from monitor.runner import Refused
from server.control import display_name
from server.protocol.people import ROLES, DutyRole

MOST_PEOPLE = 50
MOST_FORMER = 3  # names of a person who was renamed
LONGEST_NAME = 30
ENDS_AFTER_H = 12.0
ENDS_WITHIN_H = (1.0, 24.0)
DAY_MS = 86_400_000
NOTE_LASTS_MS = DAY_MS  # that a duty ended is shown for a day
MOST_DUTIES = 100
OFF_STATED_MS = 7 * DAY_MS  # for so long each request to a car states that a duty ended
HOUR_MS = 3_600_000


@dataclass(frozen=True, slots=True, kw_only=True)
class OnDuty:
    """A person as an order carries them."""

    name: str
    role: DutyRole
    device: str = field(default="", compare=False)  # the key under which they are on duty

    @property
    def title(self) -> str:
        return ROLES[self.role]


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """One of the list. `role` and `last_ms`, when it began, are of the last duty."""

    id: str
    name: str
    role: DutyRole = "operator"
    last_ms: int | None = None
    off_ms: int | None = None  # when their last duty ended
    former: tuple[str, ...] = ()  # names before, the newest first: what they signed bears them
    changed_ms: int = 0
    was: str | None = None  # id under which they were removed, before they were added again

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name, *self.former)

    def is_lately_off(self, now_ms: int) -> bool:
        """Whether their last duty ended so lately that it is stated."""
        return self.off_ms is not None and now_ms - self.off_ms < OFF_STATED_MS


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyEntry:
    """What is known of one device: who is on duty, or how the last duty ended."""

    device: str  # its key: of a paired device its id, else of a page
    device_name: str
    changed_ms: int
    person: str | None = None  # id; None: nobody
    role: DutyRole = "operator"
    since_ms: int = 0
    ended: str | None = None  # a sentence, until it is dismissed


class DutyBoard:
    """The list of people and all duties of one server. Raises Refused with a sentence."""

    def __init__(self) -> None:
        self.people: dict[str, Person] = {}
        self.removed: dict[str, int] = {}  # ids of people who were removed, and when: nobody brings them back
        self.gone: dict[str, Person] = {}  # of those, as they were: what they acknowledged has no owner on duty
        self.entries: dict[str, DutyEntry] = {}  # by device
        self.ends_after_h = ENDS_AFTER_H
        self.hours_changed_ms = 0

    # -- the list ----------------------------------------------------------------------------------------------------

    def add(self, id: str, name: object, role: object, now_ms: int, *, returns: bool = False) -> Person:
        """`returns`: who was removed from the list under this name is the same person."""
        if len(self.people) >= MOST_PEOPLE:
            raise Refused(f"The list has at most {MOST_PEOPLE} people: remove one first.")
        new_name = self._free_name(name, now_ms, returns=returns)
        person = Person(id=id, name=new_name, role=role_of(role), changed_ms=now_ms)
        if (before := self._removed_as(new_name, now_ms)) is not None:
            former = tuple(one for one in before.names if one != new_name)
            person = replace(person, last_ms=before.last_ms, off_ms=before.off_ms, former=former, was=before.id)
        self.people[id] = person
        return person

    def change(self, id: str, *, name: object, role: object, now_ms: int) -> Person:
        person = self.person(id)
        new_name = person.name if name is None else self._free_name(name, now_ms, but=id)
        new_role = person.role if role is None else role_of(role)
        former = tuple(one for one in dict.fromkeys(person.names) if one != new_name)
        if len(former) > MOST_FORMER and (self.duty_of(id) is not None or person.is_lately_off(now_ms)):
            raise Refused(
                f"{person.name} had {MOST_FORMER} other names, and {former[-1]} names what they acknowledged: another "
                f"name is possible {OFF_STATED_MS // DAY_MS} days after their last duty."
            )
        changed = replace(person, name=new_name, role=new_role, former=former[:MOST_FORMER], changed_ms=now_ms)
        self.people[id] = changed
        return changed

    def remove(self, id: str, now_ms: int) -> list[Person]:
        """As `forget`. Raises Refused: they are on duty."""
        person = self.person(id)
        entry = self.duty_of(id)
        if entry is not None:
            raise Refused(f"{person.name} is on duty at {entry.device_name}: they must sign off first.")
        return self.forget(id, now_ms)

    def forget(self, id: str, at_ms: int) -> list[Person]:
        """This person is not in the list any more, nor on duty, and nobody brings them back; of the removed so many
        are kept, and those whose duty ended lately as they were. Returns those of them that were one too many."""
        if (entry := self.duty_of(id)) is not None:  # as another web node removed them
            why = "Who was on duty here was removed from the list of people: nobody is on duty here now."
            self._end(entry, why, max(at_ms, entry.changed_ms + 1))
        gone = list(self.gone.values())
        if (person := self.people.pop(id, None)) is not None:
            gone = [one for one in (*gone, person) if one.is_lately_off(at_ms)]
            self.gone = {one.id: one for one in gone[-MOST_PEOPLE:]}
        self.removed = dict([*self.removed.items(), (id, at_ms)][-2 * MOST_PEOPLE :])
        return gone[:-MOST_PEOPLE]

    def person(self, id: str) -> Person:
        person = self.people.get(id)
        if person is None:
            raise Refused("This person is not in the list of people any more.")
        return person

    def set_hours(self, hours: float, now_ms: int = 0) -> None:
        low, high = ENDS_WITHIN_H
        if not low <= hours <= high:
            raise Refused(f"A duty ends after {low:.0f} to {high:.0f} h.")
        self.ends_after_h, self.hours_changed_ms = hours, now_ms

    def _free_name(self, name: object, now_ms: int, *, but: str | None = None, returns: bool = False) -> str:
        """A name under which nobody else has acknowledged anything lately."""
        cleaned = person_name(name)
        for one in self.people.values():
            if one.id == but:
                continue
            if _is_same(cleaned, one.name):
                raise Refused(f"{one.name} is in the list already.")
            if one.last_ms is not None and any(_is_same(cleaned, former) for former in one.former):
                raise Refused(f"{cleaned} is a former name of {one.name}, and names what they acknowledged.")
        if not returns and self._removed_as(cleaned, now_ms) is not None:
            same = "" if but else " Repeat it if it is the same person."
            raise Refused(f"{cleaned} was removed lately, and names what they acknowledged.{same}")
        return cleaned

    def _removed(self, now_ms: int) -> list[Person]:
        """Who was removed, was on duty lately, and was not added again; the newest first."""
        again = {one.was for one in (*self.people.values(), *self.gone.values())}
        return [one for one in reversed(self.gone.values()) if one.id not in again and one.is_lately_off(now_ms)]

    def _removed_as(self, name: str, now_ms: int) -> Person | None:
        """Who of them had this name."""
        return next((one for one in self._removed(now_ms) if any(_is_same(name, had) for had in one.names)), None)

    # -- duty --------------------------------------------------------------------------------------------------------

    def on_duty(self, device: str) -> OnDuty | None:
        """Who is on duty at a device."""
        entry = self.entries.get(device)
        person = self.people.get(entry.person) if entry is not None and entry.person is not None else None
        return None if entry is None or person is None else OnDuty(name=person.name, role=entry.role)

    def duty_of(self, person: str) -> DutyEntry | None:
        """Where a person is on duty."""
        return next((one for one in self.entries.values() if one.person == person), None)

    def duties(self) -> list[DutyEntry]:
        """All duties, the longest first."""
        found = [one for one in self.entries.values() if one.person in self.people]
        return sorted(found, key=lambda one: (one.since_ms, one.device))

    def sign_on(
        self, device: str, device_name: str, person: str, role: object, now_ms: int, *, moves: bool = False
    ) -> DutyEntry:
        """Put a person on duty at a device, instead of who was. `moves`: also where they are on duty at another one."""
        found = self.person(person)
        chosen = found.role if role is None else role_of(role)
        elsewhere = self.duty_of(person)
        if elsewhere is not None and elsewhere.device != device:
            if not moves:
                raise Refused(f"{found.name} is on duty at {elsewhere.device_name}: move the duty to this device.")
            self._end(elsewhere, f"{found.name} signed on at {device_name}: nobody is on duty here now.", now_ms)
        elif elsewhere is None and len(self.duties()) >= MOST_DUTIES:
            raise Refused(f"At most {MOST_DUTIES} people are on duty at a time.")
        same = elsewhere is not None and elsewhere.device == device and elsewhere.role == chosen
        if (was := self.entries.get(device)) is not None and was.person != person:
            self._end(was, None, now_ms)
        entry = DutyEntry(
            device=device,
            device_name=device_name,
            person=person,
            role=chosen,
            since_ms=elsewhere.since_ms if same and elsewhere is not None else now_ms,
            changed_ms=now_ms,
        )
        self.entries[device] = entry
        self.people[person] = replace(self.people[person], role=chosen, last_ms=now_ms, changed_ms=now_ms)
        return entry

    def sign_off(self, device: str, now_ms: int, why: str | None = None) -> bool:
        """End the duty at a device; `why`: a note that stands there. Whether there was one."""
        entry = self.entries.get(device)
        if entry is None or entry.person is None:
            return False
        self._end(entry, why, now_ms)
        return True

    def dismiss(self, device: str, now_ms: int) -> bool:
        """The note of how a duty ended was read."""
        entry = self.entries.get(device)
        if entry is None or entry.ended is None:
            return False
        self.entries[device] = replace(entry, ended=None, changed_ms=now_ms)
        return True

    def advance(self, now_ms: int) -> list[DutyEntry]:
        """End the duties that lasted too long; those that ended, as they were. A note of long ago is forgotten."""
        due = [one for one in self.duties() if now_ms - one.since_ms >= self.ends_after_h * HOUR_MS]
        for one in due:
            name = self.people[one.person or ""].name
            self._end(one, f"The duty of {name} ended by itself after {self.ends_after_h:g} h. Sign on again.", now_ms)
        over = sorted((one for one in self.entries.values() if one.person is None), key=lambda one: one.changed_ms)
        kept = {one.device for one in over[-MOST_DUTIES:] if now_ms - one.changed_ms < NOTE_LASTS_MS}
        self.entries = {key: one for key, one in self.entries.items() if one.person is not None or key in kept}
        return due

    def stated(self, now_ms: int) -> dict[str, int | None]:
        """By name: who is on duty (None), and when the duty of others ended lately; of people who were renamed by each
        of their names, and of people who were removed too. A name counts for who bears it now, where that person was on
        duty at all; of others who had it, off duty counts before on duty."""
        on = {one.person for one in self.duties()}
        borne: dict[str, int | None] = {}
        left: dict[str, int | None] = {}
        for one in (*self.people.values(), *self._removed(now_ms)):
            if one.id not in on and not one.is_lately_off(now_ms):
                continue
            for name in one.names:
                names = borne if name == one.name and one.id in self.people else left
                known = (None if one.id in on else one.off_ms, names.get(name))
                names[name] = max((at_ms for at_ms in known if at_ms is not None), default=None)
        return left | borne

    def next_ms(self) -> int | None:
        """When the next duty ends by itself; None: nobody is on duty."""
        since = [one.since_ms for one in self.duties()]
        return round(min(since) + self.ends_after_h * HOUR_MS) if since else None

    def _end(self, entry: DutyEntry, why: str | None, now_ms: int) -> None:
        if (person := self.people.get(entry.person or "")) is not None:
            self.people[person.id] = replace(person, off_ms=now_ms, changed_ms=now_ms)
        self.entries[entry.device] = DutyEntry(
            device=entry.device, device_name=entry.device_name, changed_ms=now_ms, ended=why
        )


def _is_same(name: str, other: str) -> bool:
    """Whether two names look alike."""
    one, two = (unicodedata.normalize("NFKC", found).casefold() for found in (name, other))
    return one == two


def person_name(name: object) -> str:
    """A name of a person as one line. Raises Refused where none remains, or it is too long."""
    cleaned = display_name.clean(name)
    if cleaned is None:
        raise Refused(f"A name has 1 to {LONGEST_NAME} characters that can be seen.")
    if len(cleaned) > LONGEST_NAME:
        raise Refused(f"A name has at most {LONGEST_NAME} characters: initials are enough.")
    if not any(unicodedata.category(letter)[0] in "LN" for letter in cleaned):
        raise Refused("A name needs at least one letter or digit.")
    if set(cleaned) & set("()"):
        raise Refused("A name has no brackets: the device stands in them beside the name.")
    return cleaned


def role_of(role: object) -> DutyRole:
    for known in ROLES:
        if role == known:
            return known
    raise Refused(f"A role is one of {', '.join(ROLES.values())}.")


# The name by which it is logged, and who is on duty there; None: nobody is.
acting: ContextVar[tuple[str, OnDuty] | None] = ContextVar("acting", default=None)


@contextmanager
def acting_as(name: str, person: OnDuty | None) -> Iterator[None]:
    """What is logged under `name` in this block bears this person."""
    before = acting.set(None if person is None else (name, person))
    try:
        yield
    finally:
        acting.reset(before)

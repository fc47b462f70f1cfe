"""What the web nodes of a fleet share about people and duties, in the bucket of the devices. No I/O.

Entries by their key: `person.ID` (a person, or when they were removed), `duty.DEVICE` (who is on duty there, or how the
last duty ended) and `people` (after how long a duty ends). Of two changes of one entry the later one holds, by the
nodes' clocks; a removal always holds.
"""

from __future__ import annotations

from dataclasses import asdict

import orjson

from monitor.runner import Refused
from server.access.people import People
from server.access.people_files import entry_id, entry_of, person_of, time_ms
from server.control.duty import NOTE_LASTS_MS, DutyEntry

KINDS = ("person", "duty", "people")


class BadPeopleEntry(ValueError):
    """An entry of another node that is none; `str()` says why."""


class SharedPeople:
    """Of one node."""

    def __init__(self, people: People) -> None:
        self._people = people
        self._had: dict[str, int] = {}  # when each entry was changed, as all nodes have it

    def begin(self) -> None:
        """The entries are read from the beginning."""
        self._had.clear()

    def due(self) -> dict[str, bytes]:
        """The entries that the other nodes do not have yet; from now on they are taken to have them."""
        board = self._people.board
        now: dict[str, tuple[int, object]] = {
            f"person.{id}": (at_ms, {"removed_ms": at_ms}) for id, at_ms in board.removed.items()
        }
        for person in board.people.values():
            now[f"person.{person.id}"] = person.changed_ms, asdict(person)
        for entry in board.entries.values():
            now[f"duty.{entry.device}"] = entry.changed_ms, asdict(entry)
        if board.hours_changed_ms:
            hours = {"ends_after_h": board.ends_after_h, "changed_ms": board.hours_changed_ms}
            now["people"] = board.hours_changed_ms, hours
        found = {key: value for key, (at_ms, value) in now.items() if at_ms > self._had.get(key, -1)}
        self._had |= {key: now[key][0] for key in found}
        return {key: orjson.dumps(value) for key, value in found.items()}

    def outdated(self, now_ms: int) -> list[str]:
        """The keys of duties that ended long ago."""
        gone = [
            key
            for key, at_ms in self._had.items()
            if key.startswith("duty.") and now_ms - at_ms > NOTE_LASTS_MS and key[5:] not in self._people.board.entries
        ]
        for key in gone:
            del self._had[key]
        return gone

    def take(self, key: str, value: bytes) -> None:
        """An entry of another node. Raises BadPeopleEntry: nothing changed."""
        kind, _, id = key.partition(".")
        try:
            found = orjson.loads(value)
            if kind == "people":
                self._take_hours(float(found["ends_after_h"]), time_ms(found["changed_ms"]))
            elif kind == "duty":
                self._take_duty(key, entry_of(id, found))
            elif "removed_ms" in found:
                self._take_removed(entry_id(id), time_ms(found["removed_ms"]))
            else:
                person, board = person_of(id, found), self._people.board
                self._had[key] = max(person.changed_ms, self._had.get(key, 0))
                known = board.people.get(id)
                if id in board.removed:
                    del self._had[key]  # it is shared with the others again
                    self._people.on_changed()
                    return
                if known is not None and known.changed_ms >= person.changed_ms:
                    return  # `due` has what holds
                board.people[id] = person
                self._changed()
        except Refused as why:
            raise BadPeopleEntry(why.reason) from None
        except (ValueError, KeyError, TypeError, AttributeError) as why:
            raise BadPeopleEntry(str(why)[:200]) from None

    def _take_hours(self, hours: float, changed_ms: int) -> None:
        board = self._people.board
        self._had["people"] = max(changed_ms, self._had.get("people", 0))
        if changed_ms > board.hours_changed_ms:
            board.set_hours(hours, changed_ms)
            self._changed()

    def _take_removed(self, id: str, removed_ms: int) -> None:
        board = self._people.board
        self._had[f"person.{id}"] = removed_ms
        if board.people.pop(id, None) is not None or id not in board.removed:
            board.forget(id, removed_ms)
            self._changed()

    def _take_duty(self, key: str, entry: DutyEntry) -> None:
        board = self._people.board
        self._had[key] = max(entry.changed_ms, self._had.get(key, 0))
        known = board.entries.get(entry.device)
        if known is not None and known.changed_ms >= entry.changed_ms:
            return  # `due` has what holds
        if entry.person is not None and (other := board.duty_of(entry.person)) and other.device != entry.device:
            if other.since_ms > entry.since_ms:  # they signed on elsewhere after that
                entry = DutyEntry(device=entry.device, device_name=entry.device_name, changed_ms=entry.changed_ms)
            else:
                board.sign_off(other.device, other.changed_ms + 1, f"They signed on at {entry.device_name}.")
        board.entries[entry.device] = entry
        self._changed()

    def _changed(self) -> None:
        self._people.changed()
        self._people.keep_soon()

"""What the web nodes of a fleet share about paired devices, people and duties, in one bucket. No I/O.

Entries by their key: `identity` (with what cookies are named and signed), `device.ID` (a device, or when it was
removed), `seen.ID` (its last visit), `person.ID` (a person, or when they were removed), `duty.DEVICE` (who is on duty
there, or how the last duty ended) and `people` (after how long a duty ends). Of two changes of one entry the later one
holds, by the nodes' clocks; a removal always holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import orjson

from monitor.runner import Refused
from server.access.access import Access
from server.access.devices import FORGOTTEN_AFTER_MS, SEEN_EVERY_MS, Device, device_of
from server.access.people import People, log_dropped
from server.access.people_files import entry_id, entry_of, person_of, time_ms
from server.control.duty import NOTE_LASTS_MS, DutyEntry

KINDS = ("person", "duty", "people")

IDENTITY = "identity"
LONGEST = 2000  # bytes of an entry
KEPT_MS = FORGOTTEN_AFTER_MS + 10 * 86_400_000  # an entry, after the device was removed or seen last


class BadPeopleEntry(ValueError):
    """An invalid entry of another node; `str()` is the reason."""


class SharedPeople:
    """What is shared about people and duties.

    Of one node.
    """

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
        if id in board.people or id not in board.removed:
            log_dropped(board.forget(id, removed_ms))
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


class BadEntry(ValueError):
    """An invalid entry of another node; `str()` is the reason."""


class SharedDevices:
    """What is shared about paired devices, and with them about people.

    Of one node. `wall_ms`: its time of day in ms since 1970.
    """

    def __init__(self, access: Access, *, wall_ms: Callable[[], int], people: SharedPeople | None = None) -> None:
        """`people`: who is on duty at these devices is shared with them."""
        self._access = access
        self._people = people
        self._devices = access.devices
        self._wall_ms = wall_ms
        # What all nodes have: when each device was changed, removed (of its id) and seen
        self._changed: dict[str, int] = {}
        self._removed: dict[str, int] = {}
        self._seen: dict[str, int] = {}

    @property
    def identity(self) -> bytes:
        """The entry that the first node makes, and that the others take."""
        return orjson.dumps({"server": self._devices.server, "signing_key": self._devices.signing_key})

    def begin(self) -> None:
        """The entries are read from the beginning."""
        for known in (self._changed, self._removed, self._seen):
            known.clear()
        if self._people is not None:
            self._people.begin()

    def due(self) -> dict[str, bytes]:
        """The entries that the other nodes do not have yet; from now on they are taken to have them."""
        entries: dict[str, bytes] = {}
        for id, at_ms in self._devices.removed.items():
            if id not in self._removed:
                self._removed[id] = at_ms
                entries[f"device.{id}"] = orjson.dumps({"removed_ms": at_ms})
        for device in self._devices.all():
            if device.changed_ms > self._changed.get(device.id, -1):
                self._changed[device.id] = device.changed_ms
                entries[f"device.{device.id}"] = _entry(device)
            if device.seen_ms - self._seen.get(device.id, 0) >= SEEN_EVERY_MS:
                self._seen[device.id] = device.seen_ms
                entries[f"seen.{device.id}"] = orjson.dumps(device.seen_ms)
        return entries if self._people is None else entries | self._people.due()

    def outdated(self) -> list[str]:
        """The keys of entries of devices that are in no list any more."""
        until_ms = self._wall_ms() - KEPT_MS
        gone = [id for id, at_ms in self._removed.items() if at_ms < until_ms]
        unused = [id for id, at_ms in self._changed.items() if max(at_ms, self._seen.get(id, 0)) < until_ms]
        for known in (self._changed, self._removed, self._seen):
            for id in (*gone, *unused):
                known.pop(id, None)
        keys = [f"{kind}.{id}" for id in (*gone, *unused) for kind in ("device", "seen")]
        return keys if self._people is None else keys + self._people.outdated(self._wall_ms())

    def take(self, key: str, value: bytes) -> None:
        """An entry of another node. Raises BadEntry: nothing changed."""
        if len(value) > LONGEST:
            raise BadEntry(f"{len(value)} bytes")
        kind, _, id = key.partition(".")
        if kind in KINDS:
            self._take_people(key, value)
            return
        try:
            found = orjson.loads(value)
            if kind == IDENTITY:
                self._take_identity(str(found["server"]), str(found["signing_key"]))
            elif kind == "seen":
                self._take_seen(id, int(found))
            elif kind == "device" and "removed_ms" in found:
                self._take_removed(id, int(found["removed_ms"]))
            elif kind == "device":
                self._take_device(device_of({**found, "id": id, "seen_ms": found["changed_ms"]}))
            else:
                raise BadEntry("of no kind")
        except (ValueError, KeyError, TypeError, AttributeError) as why:
            raise BadEntry(str(why)[:200]) from None

    def _take_people(self, key: str, value: bytes) -> None:
        if self._people is None:
            return
        try:
            self._people.take(key, value)
        except BadPeopleEntry as why:
            raise BadEntry(str(why)) from None

    def _take_identity(self, server: str, signing_key: str) -> None:
        if len(server) != 8 or not server.isalnum() or not 64 <= len(signing_key) <= 200:
            raise BadEntry("no identity")
        if (server, signing_key) == (self._devices.server, self._devices.signing_key):
            return
        self._devices.server, self._devices.signing_key = server, signing_key
        self._access.use_identity()
        self._keep()

    def _take_seen(self, id: str, seen_ms: int) -> None:
        self._seen[id] = max(seen_ms, self._seen.get(id, 0))
        device = self._devices.get(id)
        if device is not None and seen_ms > device.seen_ms:
            self._devices.put(replace(device, seen_ms=seen_ms))

    def _take_removed(self, id: str, removed_ms: int) -> None:
        self._removed[id] = removed_ms
        self._changed.pop(id, None)
        is_known = self._devices.get(id) is not None
        self._devices.remove(id, now_ms=removed_ms)
        if is_known:
            self._access.removed[id] = because = "This device was removed at another web node."
            self._access.visits.end(id, because)
            self._keep()

    def _take_device(self, device: Device) -> None:
        self._changed[device.id] = device.changed_ms
        before = self._devices.get(device.id)
        if device.id in self._devices.removed or (before is not None and before.changed_ms > device.changed_ms):
            return  # `due` has what holds
        if before is not None:
            device = replace(device, seen_ms=max(device.seen_ms, before.seen_ms))
        if device == before:
            return
        self._devices.put(device)
        if before is not None and (device.role, device.name) != (before.role, before.name):
            because = "The role of this device was changed."
            self._access.visits.end(device.id, because, only_sockets=device.role == before.role)
        self._keep()

    def _keep(self) -> None:
        self._devices.save_seen(now_ms=self._wall_ms())


def _entry(device: Device) -> bytes:
    fields: dict[str, Any] = asdict(device)
    del fields["id"], fields["seen_ms"]
    return orjson.dumps(fields)

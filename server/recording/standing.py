"""What is in force when a part of a drive begins: alarms, pause, planned stop, phone, slow-down, people, mode.

Its metadata states them, because no message in it does. Entries of our own channels that come while no part is open
count too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import orjson

from server.recording.own import Own

DEPARTURE = "departure"  # in the metadata: the newest signature of the departure check; "": none was signed
STANDING = "standing"  # in the metadata: the newest event of each alarm that stood and of each mode, as a JSON array
_STATES = ("UNACKED", "ACKED", "RTN_UNACKED", "SHELVED")

_MODES = {  # change → the mode that it begins or ends
    "paused": ("pause", True),
    "resumed": ("pause", False),
    "stopped": ("pause", False),
    "planned_stop": ("planned stop", True),
    "planned_stop_ended": ("planned stop", False),
    "armed": ("armed", True),
    "disarmed": ("armed", False),
    "ride": ("ride", True),
    "slow_down": ("order", False),
    "control": ("control", True),
    "mode": ("mode", True),
}
_MOST_OF_ORDER = 50  # events
_ORDER_ENDS = ("released", "ended")

_SIGNED = ("check", "at_ms", "by", "person", "role", "done", "failed", "not_applicable", "of", "hash", "recurring")

Event = Mapping[str, Any]

EARLY_AT_MOST = 200  # entries kept while no part is open: those of a gap stand at the beginning of the next part


class Stood:
    """The newest event of each alarm that is not at rest, and those of each mode that is in force."""

    def __init__(self) -> None:
        self._newest: dict[str, Event] = {}
        self._modes: dict[str, list[Event]] = {}
        self._departure: Event | None = None  # its signature

    def note_departure(self, event: Event) -> None:
        """The signature of the departure check holds until the check is opened or begun again, or the drive ends."""
        change, step = event.get("change"), event.get("step")
        if change == "departure" and step in ("signed", "begun", "reopened"):
            self._departure = event if step == "signed" else None
        elif change == "stopped":
            self._departure = None

    def note(self, event: Event) -> None:
        """One event of the log, in their order."""
        self.note_departure(event)
        alarm, state = event.get("alarm"), event.get("state")
        if not isinstance(alarm, str):
            self._note_mode(event)
        elif state in _STATES or (state is None and event.get("change") in ("raised", "recaused")):
            self._newest[alarm] = event
        elif state is not None or event.get("change") == "cleared":
            self._newest.pop(alarm, None)

    def _note_mode(self, event: Event) -> None:
        change, step = event.get("change"), event.get("step")
        if change == "slow_down" and step not in _ORDER_ENDS:
            if event.get("order") is not None:  # each event adds to what is known of the order
                self._modes["order"] = [*self._modes.get("order", []), event][-_MOST_OF_ORDER:]
            return
        mode, begins = _MODES.get(str(change), ("", False))
        if change == "ride":
            begins = event.get("phone") is not None
        elif change == "control":
            begins = event.get("holder") is not None
        elif change == "duty":
            mode, begins = f"duty {event.get('person')}"[:80], event.get("act") == "on"
        elif change == "owner":
            mode, begins = f"owner {event.get('owner')}"[:120], event.get("off_duty_ms") is not None
        if begins:
            self._modes[mode] = [event]
        else:
            self._modes.pop(mode, None)

    def note_all(self, events: Iterable[Event]) -> None:
        for event in events:
            self.note(event)

    def as_metadata(self) -> dict[str, str]:
        modes = [event for events in self._modes.values() for event in events]
        signature = {name: self._departure.get(name) for name in _SIGNED} if self._departure is not None else None
        return {
            STANDING: orjson.dumps([*self._newest.values(), *modes]).decode(),
            DEPARTURE: "" if signature is None else orjson.dumps(signature).decode(),
        }


def read_standing(metadata: Mapping[str, str]) -> list[dict[str, Any]]:
    """Read it from a file's metadata; empty if it is missing or invalid."""
    try:
        found = orjson.loads(metadata.get(STANDING) or "[]")
    except orjson.JSONDecodeError:
        return []
    return [event for event in found if isinstance(event, dict)] if isinstance(found, list) else []


class EarlyEntries:
    """Entries of our own channels that came while no part was open, and the alarms that stand when the next begins.

    An entry that is written, or is too old to be, counts for the alarms that stand.
    """

    def __init__(self) -> None:
        self._entries: list[tuple[float, Own, Mapping[str, Any]]] = []
        self._stood = Stood()

    def hold(self, at_s: float, channel: Own, fields: Mapping[str, Any]) -> None:
        """Keeps an entry for the next part."""
        self._entries.append((at_s, channel, fields))
        if channel == "alarms":
            self._stood.note_departure(fields)  # it counts at once: a part that begins now was checked
        for _, old_channel, old in self._entries[:-EARLY_AT_MOST]:
            self.note(old_channel, old)
        del self._entries[:-EARLY_AT_MOST]

    def take(self, since_s: float) -> list[tuple[Own, Mapping[str, Any]]]:
        """The entries for a part that begins, none older than `since_s`."""
        entries, self._entries = self._entries, []
        for at_s, channel, fields in entries:
            if at_s < since_s:
                self.note(channel, fields)
        return [(channel, fields) for at_s, channel, fields in entries if at_s >= since_s]

    def clear(self) -> None:
        self._entries.clear()

    def note(self, channel: Own, fields: Mapping[str, Any]) -> None:
        """An entry was written."""
        if channel == "alarms":
            self._stood.note(fields)

    def remember(self, stood: Iterable[Event]) -> None:
        """Events of alarms that stand since before the server was started."""
        self._stood.note_all(stood)

    def standing(self) -> dict[str, str]:
        """The alarms that stand now, for the metadata of a part."""
        return self._stood.as_metadata()

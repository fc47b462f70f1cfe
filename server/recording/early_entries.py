"""Entries of our own channels that came while no part was open, and the alarms that stand when the next one begins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from server.recording.own import Own
from server.recording.standing import Event, Stood

EARLY_AT_MOST = 200  # entries kept while no part is open: those of a gap stand at the beginning of the next part


class EarlyEntries:
    """An entry that is written, or is too old to be, counts for the alarms that stand."""

    def __init__(self) -> None:
        self._entries: list[tuple[float, Own, Mapping[str, Any]]] = []
        self._stood = Stood()

    def hold(self, at_s: float, channel: Own, said: Mapping[str, Any]) -> None:
        """Keeps an entry for the next part."""
        self._entries.append((at_s, channel, said))
        if channel == "alarms":
            self._stood.note_departure(said)  # it counts at once: a part that begins now was checked
        for _, old_channel, old in self._entries[:-EARLY_AT_MOST]:
            self.note(old_channel, old)
        del self._entries[:-EARLY_AT_MOST]

    def take(self, since_s: float) -> list[tuple[Own, Mapping[str, Any]]]:
        """The entries for a part that begins, none older than `since_s`."""
        entries, self._entries = self._entries, []
        for at_s, channel, said in entries:
            if at_s < since_s:
                self.note(channel, said)
        return [(channel, said) for at_s, channel, said in entries if at_s >= since_s]

    def clear(self) -> None:
        self._entries.clear()

    def note(self, channel: Own, said: Mapping[str, Any]) -> None:
        """An entry was written."""
        if channel == "alarms":
            self._stood.note(said)

    def remember(self, stood: Iterable[Event]) -> None:
        """Events of alarms that stand since before the server was started."""
        self._stood.note_all(stood)

    def standing(self) -> dict[str, str]:
        """The alarms that stand now, for the metadata of a part."""
        return self._stood.as_metadata()

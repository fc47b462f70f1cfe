"""Which alarms stand when a part of a drive begins: told in its metadata, for no message in it raised them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import orjson

STANDING = "standing"  # in the metadata: the newest event of each alarm that stood, as a JSON array
_STATES = ("UNACKED", "ACKED", "RTN_UNACKED", "SHELVED")

Event = Mapping[str, Any]


class Stood:
    """The newest event of each alarm that is not at rest."""

    def __init__(self) -> None:
        self._newest: dict[str, Event] = {}

    def note(self, event: Event) -> None:
        """One event of the log, in their order; what is no event of an alarm changes nothing."""
        alarm, state = event.get("alarm"), event.get("state")
        if not isinstance(alarm, str):
            return
        if state in _STATES or (state is None and event.get("change") in ("raised", "recaused")):
            self._newest[alarm] = event
        elif state is not None or event.get("change") == "cleared":
            self._newest.pop(alarm, None)

    def note_all(self, events: Iterable[Event]) -> None:
        for event in events:
            self.note(event)

    def as_metadata(self) -> dict[str, str]:
        return {STANDING: orjson.dumps([*self._newest.values()]).decode()}


def read_standing(metadata: Mapping[str, str]) -> list[dict[str, Any]]:
    """What a file says of it; nothing where it says nothing, or nothing that makes sense."""
    try:
        found = orjson.loads(metadata.get(STANDING) or "[]")
    except orjson.JSONDecodeError:
        return []
    return [event for event in found if isinstance(event, dict)] if isinstance(found, list) else []

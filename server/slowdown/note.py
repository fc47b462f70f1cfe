"""How what happens to a slow-down is told to the log."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Protocol

log = logging.getLogger("catgraph.slowing")


class Note(Protocol):
    """Writes an event of no alarm into the log."""

    def __call__(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None: ...


def never_raising(note: Note) -> Note:
    """The same; where the log fails, the slow-down goes on."""

    def note_safely(change: str, text: str, *, by: str | None = None, **more: Any) -> None:
        try:
            note(change, text, by=by, **more)
        except Exception:
            log.exception("not in the event log: %s", text)

    return note_safely


def recording_safely(record: Callable[[Any], None]) -> Callable[[Any], None]:
    """The same; where the recording fails, the slow-down goes on. A failure is logged once until one succeeds."""
    failed = False

    def record_safely(message: Any) -> None:
        nonlocal failed
        try:
            record(message)
            failed = False
        except Exception:
            if not failed:
                failed = True
                log.exception("commands to the car are not recorded")

    return record_safely

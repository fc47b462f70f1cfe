"""Logging of slow-down events."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from typing_extensions import Unpack

from server.protocol.alarm_state import EventDetails, Note

log = logging.getLogger("catgraph.slowing")


def never_raising(note: Note) -> Note:
    """Log without raising: the slow-down continues if the log fails."""

    def note_safely(change: str, text: str, *, by: str | None = None, **more: Unpack[EventDetails]) -> None:
        try:
            note(change, text, by=by, **more)
        except Exception:
            log.exception("event not logged: %s", text)

    return note_safely


def recording_safely(record: Callable[[Any], None]) -> Callable[[Any], None]:
    """Record without raising: the slow-down continues if recording fails. Failures are logged once until a success."""
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

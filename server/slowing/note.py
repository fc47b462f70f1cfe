"""How what happens to a slow-down is told to the log."""

from __future__ import annotations

from typing import Any, Protocol


class Note(Protocol):
    """Writes an event of no alarm into the log."""

    def __call__(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None: ...

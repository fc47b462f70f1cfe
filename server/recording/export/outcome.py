"""What an export came to, and how it fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

Progress = Callable[[float], None]  # called now and then, with 0 to 1


class ExportRefused(RuntimeError):
    """There is nothing to export in this form, or it cannot be written. The text is one sentence for a person."""


class NothingRecorded(ExportRefused):
    """The recording has nothing of the time that is asked for."""


@dataclass(slots=True)
class Outcome:
    """A file was written."""

    entries: int = 0  # messages, rows, points: whatever the format counts
    notes: list[str] = field(
        default_factory=list
    )  # what is not in it, and why, in sentences for a person; empty: whole
    notices: list[str] = field(default_factory=list)  # what else is to be known of it; nothing is missing for it


def nothing(part: float) -> None:
    """Ignore the progress."""

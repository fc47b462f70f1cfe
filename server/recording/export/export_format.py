"""What an export format declares of itself, for the command line, the routes and the page; what an export came to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

Progress = Callable[[float], None]  # called now and then, with 0 to 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportFormat:
    """One format, declared in a file of the package `formats`."""

    name: str
    label: str  # on the page's key
    use: str  # a short text, below the label
    extension: str  # of the file's name, without the first dot
    media_type: str
    writer: str  # "module:function", loaded when it is needed; see docs/extending.md
    options: tuple[str, ...] = ()  # which of `compression`, `with_own` and `name` the writer takes
    of_drive: bool = False  # made of all parts of the drive of which a recording is one
    ros_version: int | None = None  # only recordings of this ROS can be exported; None: all of them
    order: int = 100  # on the page


class ExportRefused(RuntimeError):
    """There is nothing to export in this form, or it cannot be written. The text is one sentence for a person."""


class NothingRecorded(ExportRefused):
    """The recording has nothing of the requested time."""


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

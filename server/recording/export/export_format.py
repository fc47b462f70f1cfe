"""What an export format declares of itself: for the command line, the routes and the page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportFormat:
    """One format, declared as `FORMAT` in a file of the package `formats`."""

    name: str
    label: str  # on the page's key
    use: str  # in few words, below the label
    extension: str  # of the file's name, without the first dot
    media_type: str
    writer: str  # "module:function", loaded when it is needed; see docs/extending.md
    options: tuple[str, ...] = ()  # which of `compression`, `with_own` and `name` the writer takes
    of_drive: bool = False  # made of all parts of the drive of which a recording is one
    ros_version: int | None = None  # only recordings of this ROS can be exported; None: all of them
    order: int = 100  # on the page

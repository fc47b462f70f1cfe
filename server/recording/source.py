"""What every kind of recording file offers its reader."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from server.source import RosVersion

DefinitionFormat = Literal["none", "msg", "idl"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """Messages of one topic and type in one file."""

    number: int  # unique in its file
    topic: str
    type: str  # as rosbags spells it, "pkg/msg/Type" in both versions
    definition: str
    format: DefinitionFormat
    encoding: Literal["ros1", "cdr", "json"]
    count: int
    is_latched: bool


class FileSource(Protocol):
    """One open recording: a file, or a directory that is one ROS 2 bag."""

    path: Path
    ros_version: RosVersion
    distro: str | None
    channels: Sequence[Channel]
    start_ns: int  # since 1970; of no meaning where there are no messages
    end_ns: int

    def messages(self, numbers: set[int], start_ns: int) -> Iterator[tuple[int, int, bytes]]:
        """(time in ns, number of the channel, raw message) in time order, from `start_ns` on."""
        ...

    def close(self) -> None: ...

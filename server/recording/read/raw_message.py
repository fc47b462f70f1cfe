"""A recorded message as its bytes, which are decoded only when somebody reads its fields."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from server.judge.message import Json, RosVersion
from server.recording.read.errors import Undecodable


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """How the bytes of one channel's messages are to be read.

    `definitions` are those of its type and of all it contains, as rosbags has them.
    """

    ros_version: RosVersion
    definitions: dict[str, Any]


class RawMessage(Mapping[str, Any]):
    """The serialized message in the encoding of its ROS version. Reading fields raises Undecodable."""

    __slots__ = ("_decode", "_fields", "_unreadable", "layout", "raw")

    def __init__(self, raw: bytes, decode: Callable[[bytes], Json], layout: Layout) -> None:
        self.raw = raw
        self.layout = layout
        self._decode = decode
        self._fields: Json | None = None
        self._unreadable: str | None = None  # the reason; decoding is tried once

    @property
    def fields(self) -> Json:
        """The decoded message. Raises Undecodable."""
        if self._unreadable is not None:
            raise Undecodable(self._unreadable)
        if self._fields is None:
            try:
                self._fields = self._decode(self.raw)
            except Undecodable as error:
                self._unreadable = str(error)
                raise
        return self._fields

    def __getitem__(self, name: str) -> Any:
        return self.fields[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.fields)

    def __len__(self) -> int:
        return len(self.fields)


def fields_of(message: Json) -> Json:
    """The message as a dict, whichever kind it is. Raises Undecodable."""
    return message.fields if isinstance(message, RawMessage) else message

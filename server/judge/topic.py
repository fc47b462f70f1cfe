"""What a signal declares of the topics that carry it: their names, their types, and how each type is decoded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

# Takes one ROS message, as rosbridge spells it, and returns one value of `monitor.values`. Raises Rejected with the
# reason, short. Numbers that rosbridge had to flatten to null are NaN here; a value whose headline number is
# unknown is rejected, because a signal without a value must become stale.
Decode = Callable[[Any], Any]

FLOATS = ("std_msgs/Float32", "std_msgs/Float64")


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """A row of the table: how ROS carries one signal."""

    signal: str
    names: tuple[str, ...]  # tried in this order, whatever the case of their letters
    types: Mapping[str, Decode]  # ROS 1 spelling; the first is the expected one
    by_type: tuple[
        str, ...
    ] = ()  # types that only this signal has: taken under any name when none of the names is there
    # Messages the bridge keeps for us in a burst: what comes in some 0.15 s or more, for what waits there grows old
    # unseen, and what does not fit is lost; 1 for what is large.
    queue_length: int = 5
    compression: str = "none"

    @property
    def expected_type(self) -> str:
        return next(iter(self.types))


def floats(decode: Decode) -> dict[str, Decode]:
    """The types that are a single number, decoded alike."""
    return dict.fromkeys(FLOATS, decode)

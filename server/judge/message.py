"""A message as every source yields it: a recording, a simulated car or a bridge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Json = Mapping[str, Any]
RosVersion = Literal[1, 2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One ROS message.

    `message` has the field names of ROS as rosbridge spells them. Numbers may be NaN or infinite and arrays may be
    numpy
    arrays; a JSON writer must convert those to null and lists. Stamps are `secs`/`nsecs` in ROS 1, `sec`/`nanosec`
    in ROS 2.
    """

    at_s: float  # seconds since 1970 on the source's own clock
    topic: str
    type: str  # "geometry_msgs/Twist" in ROS 1, "geometry_msgs/msg/Twist" in ROS 2
    message: Json

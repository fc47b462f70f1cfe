"""Single values of a ROS message, as Python holds them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from server.judge.message import RosVersion
from server.rosbridge_server.shape import Field, Lost, zero


def primitive(field: Field, value: Any) -> Any:
    """The value as it comes out of a ROS message: zero where it is missing, a float32 with its own precision."""
    if value is None:
        return zero(field.type)
    if isinstance(value, np.generic):
        value = value.item()
    if field.type == "float32":
        with np.errstate(over="ignore"):
            return float(np.float32(value))
    if field.type == "float64":
        return float(value)
    if field.type == "bool":
        return bool(value)
    return value if field.type in ("string", "wstring") else int(value)


def items(field: Field, value: Any) -> list[Any]:
    """The elements of an array as primitives of Python; messages as they are."""
    if value is None:
        count = field.length if field.array == "fixed" else 0
        return [None if field.is_message else zero(field.type)] * count
    if isinstance(value, np.ndarray):
        value = value.tolist()
    found: Iterable[Any] = value
    return list(found) if field.is_message else [primitive(field, item) for item in found]


def bytes_of(field: Field, value: Any) -> bytes:
    if isinstance(value, bytes | bytearray | memoryview):
        return bytes(value)
    return bytes(items(field, value))


def stamp(at_s: float, version: RosVersion) -> dict[str, int]:
    """A time as messages carry it: secs/nsecs in ROS 1, sec/nanosec in ROS 2."""
    whole = math.floor(at_s)
    carry, rest = divmod(round((at_s - whole) * 1e9), 1_000_000_000)  # at_s * 1e9 would not be exact
    return time_of({"secs": whole + carry, "nsecs": rest}, version)


def time_of(value: Any, version: RosVersion) -> dict[str, int]:
    """Seconds and nanoseconds, in either spelling, as this version spells them."""
    given = _object(value)
    seconds = int(given.get("secs", given.get("sec", 0)))
    rest = int(given.get("nsecs", given.get("nanosec", 0)))
    return {"secs": seconds, "nsecs": rest} if version == 1 else {"sec": seconds, "nanosec": rest}


def _object(value: Any) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise Lost(f"{type(value).__name__} is no message")
    return value

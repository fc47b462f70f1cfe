"""Reads the fields of a ROS message as rosbridge spells it: numbers, texts, lists, stamps.

Numbers that rosbridge had to flatten to null are NaN here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeGuard

import numpy as np
import numpy.typing as npt

from server.system.clean_text import clean

_REAL = (int, float, np.integer, np.floating)


class Rejected(ValueError):
    """Not a proper message; `str()` is the reason, short, the same for the same kind of fault."""


class NotMeasured(Rejected):
    """A proper message that declares, as its definition has it, that the value is not measured."""


def number(message: Any, *path: str) -> float:
    """The number at a path of fields; NaN for null, and for infinity, which is null in JSON too, so that a recording
    and its replay agree. Raises Rejected if it is missing or not a number."""
    value = message
    try:
        for name in path:
            value = value[name]
    except (KeyError, TypeError, IndexError):  # no such field, or this is nothing that has fields
        raise Rejected(f"{'.'.join(path)} is missing") from None
    if type(value) is float:  # nearly always
        return value if math.isfinite(value) else math.nan
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, _REAL):
        raise Rejected(f"{'.'.join(path)} is not a number")
    try:
        whole = float(value)
    except OverflowError:
        raise Rejected(f"{'.'.join(path)} is too large") from None
    return whole if math.isfinite(whole) else math.nan


def finite(message: Any, *path: str) -> float:
    """As `number`, and known: null, NaN and infinities are rejected."""
    try:  # the usual case, which most messages are, without a second call
        found = message
        for name in path:
            found = found[name]
        if type(found) is float and math.isfinite(found):
            return found  # nearly always
    except (KeyError, TypeError, IndexError):
        pass  # `number` raises with the reason
    value = number(message, *path)
    if not math.isfinite(value):
        raise Rejected(f"{'.'.join(path)} is not a number")
    return value


def known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def text(message: Any, *path: str, default: str = "") -> str:
    value = message
    for name in path:
        value = value.get(name) if has_fields(value) else None
    return clean(value[:200]) if isinstance(value, str) else default


def has_fields(value: Any) -> TypeGuard[Mapping[str, Any]]:
    """Whether this is a message, and no number, text or list."""
    return type(value) is dict or isinstance(value, Mapping)  # an abstract class takes its time


def stamp_s(message: Any) -> float | None:
    """The header's stamp in seconds, ROS 1 or ROS 2; None where there is none or it is zero or absurd."""
    if type(message) is dict and "header" not in message:
        return None
    header = message.get("header") if has_fields(message) else None
    stamp = header.get("stamp") if has_fields(header) else None
    if not has_fields(stamp):
        return None
    seconds = stamp.get("secs", stamp.get("sec"))
    nanoseconds = stamp.get("nsecs", stamp.get("nanosec"))
    if type(seconds) is not int or type(nanoseconds) is not int or not 0 <= seconds < 1e11:
        return None
    if not 0 <= nanoseconds < 10**9:
        return None
    return seconds + nanoseconds * 1e-9 or None


def numbers(message: Any, name: str) -> npt.NDArray[np.float32]:
    """A list of numbers and nulls as float32, nulls as NaN."""
    values = message.get(name) if isinstance(message, Mapping) else None
    if isinstance(values, np.ndarray) and values.ndim == 1 and values.dtype.kind in "fiu":
        with np.errstate(over="ignore"):
            return values.astype(np.float32)
    if not isinstance(values, (list, tuple)):
        raise Rejected(f"{name} is missing" if values is None else f"{name} is not a list")
    if not {type(value) for value in values} <= {float, int, type(None)}:
        raise Rejected(f"{name} holds something that is not a number")
    try:
        with np.errstate(over="ignore"):  # 1e39 is infinitely far
            return np.array(values, dtype=np.float32)
    except (OverflowError, ValueError, TypeError):
        raise Rejected(f"{name} holds something that is not a number") from None


def inner(message: Any, name: str) -> Any:
    value = message.get(name) if isinstance(message, Mapping) else None
    if not isinstance(value, Mapping):
        raise Rejected(f"{name} is missing")
    return value


def yaw(pose: Any) -> float | None:
    """Yaw in rad, counter-clockwise from the frame's x axis (REP-103), from the pose's quaternion; None where it
    is none."""
    x, y, z, w = (number(pose, "orientation", axis) for axis in "xyzw")
    norm = x * x + y * y + z * z + w * w
    if not 0.5 < norm < 1.5:  # NaN and the all-zero quaternion of drivers without a compass both fall out here
        return None
    return math.atan2(2 * (w * z + x * y), norm - 2 * (y * y + z * z))

"""Shifts the stamps of messages, so that the clock of a repeated recording advances."""

from __future__ import annotations

from typing import Any

from server.judge.message import Json

_NS = 10**9
_TIMES = (("secs", "nsecs"), ("sec", "nanosec"))  # of ROS 1, of ROS 2
_MOST = {"secs": 2**32 - 1, "sec": 2**31 - 1}  # seconds: beyond, there is no such stamp
DEEPEST = 8  # levels; stamps of the standard messages are at most 3 deep


def moved(message: Json, by_s: float) -> Json:
    """The message with each field `stamp` later by so much; a copy where there is any. A stamp of zero is none."""
    if not by_s:
        return message
    found = _moved(message, round(by_s * _NS), DEEPEST)
    return found if isinstance(found, dict) else message


def _moved(value: Any, by_ns: int, deep: int) -> Any:
    """A changed copy, or the very same where there is no stamp in it."""
    if deep == 0:
        return value
    if isinstance(value, dict):
        changed: dict[str, Any] = {}
        for name, one in value.items():
            if not isinstance(one, dict | list):
                continue
            other = _later(one, by_ns) if name == "stamp" else _moved(one, by_ns, deep - 1)
            if other is not one:
                changed[name] = other
        return {**value, **changed} if changed else value
    if isinstance(value, list) and value and isinstance(value[0], dict):
        others = [_moved(one, by_ns, deep - 1) for one in value]
        return others if any(other is not one for other, one in zip(others, value, strict=True)) else value
    return value


def _later(stamp: Any, by_ns: int) -> Any:
    for seconds, parts in _TIMES:
        if isinstance(stamp, dict) and stamp.keys() == {seconds, parts}:
            whole, part = stamp[seconds], stamp[parts]
            if not (isinstance(whole, int) and isinstance(part, int)) or not (whole or part):
                return stamp
            later, part = divmod(whole * _NS + part + by_ns, _NS)
            return {seconds: later, parts: part} if 0 <= later <= _MOST[seconds] else stamp
    return stamp

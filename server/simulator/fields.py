"""Reads and changes single fields of a message; the message itself is never written to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from server.judge.message import Message

# Where the types that a signal may have keep its number.
SPEED_PATHS = (("linear", "x"), ("twist", "linear", "x"), ("twist", "twist", "linear", "x"), ("data",))
EFFORT_PATHS = (("force", "x"), ("data",))


def with_fields(message: Message, fields: Mapping[str, Any]) -> Message:
    """The same message with other content."""
    return Message(at_s=message.at_s, topic=message.topic, type=message.type, message=fields)


def with_number(message: Message, paths: Sequence[tuple[str, ...]], value: float) -> Message:
    """The message with the number changed at the first of the paths that it has."""
    for path in paths:
        if _found(message.message, path) is not None:
            return with_fields(message, changed(message.message, path, value))
    return message


def number_at(message: Message, paths: Sequence[tuple[str, ...]]) -> float | None:
    """The finite number at the first of the paths that the message has; None where there is none."""
    for path in paths:
        value = _found(message.message, path)
        if isinstance(value, int | float | np.number) and not isinstance(value, bool):
            return float(value) if math.isfinite(value) else None
    return None


def _found(fields: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        if not isinstance(fields, Mapping) or name not in fields:
            return None
        fields = fields[name]
    return fields


def changed(fields: Mapping[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    """A copy with one inner value changed; everything else is shared with the original."""
    name, *rest = path
    return {**fields, name: changed(fields[name], tuple(rest), value) if rest else value}

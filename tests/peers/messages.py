"""The messages of a recording as rosbags reads them, in the form in which programs of others print theirs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

FIRST = 3
STAMP = {"secs": "sec", "nsecs": "nanosec", "nsec": "nanosec"}  # one name each, of ROS 1, of ROS 2 and of the readers


def recorded(path: Path) -> dict[str, dict[str, Any]]:
    """Of each topic, by its name: type, count, the first three messages and the last."""
    found: dict[str, dict[str, Any]] = {}
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            message = plain(reader.deserialize(data, connection.msgtype))
            row = found.setdefault(connection.topic, {"type": connection.msgtype, "count": 0, "first": []})
            row["count"] += 1
            row["last"] = message
            if len(row["first"]) < FIRST:
                row["first"].append(message)
    return found


def plain(value: Any) -> Any:
    """A message as JSON has it: no number where it is not finite."""
    if is_dataclass(value):
        names = [one.name for one in fields(value) if not (one.name.startswith("__") or one.name.isupper())]
        return {name: plain(getattr(value, name)) for name in names}  # without the type's name and constants
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(item) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def differences(name: str, one: Any, other: Any) -> Iterator[str]:
    """Where two messages differ: beyond the precision of a float32, or in a field."""
    if isinstance(one, dict) and isinstance(other, dict):
        one, other = ({STAMP.get(key, key): value for key, value in each.items()} for each in (one, other))
        for key in sorted(one.keys() | other.keys()):
            if key in one and key in other:
                yield from differences(f"{name}.{key}", one[key], other[key])
            elif key != "seq":  # of a ROS 1 header: not every reader has it
                yield f"{name}.{key} is only in one of both"
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for index, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(f"{name}[{index}]", *pair)
    elif isinstance(one, int | float) and isinstance(other, int | float):
        if not math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-12):
            yield f"{name}: {one} and {other}"
    elif one != other:
        yield f"{name}: {str(one)[:80]} and {str(other)[:80]}"


def compared(found: dict[str, dict[str, Any]], true: dict[str, dict[str, Any]]) -> Iterator[str]:
    """What a program found of each topic against what is recorded."""
    for topic, row in true.items():
        seen = found.get(topic)
        if seen is None:
            yield f"{topic} is missing"
            continue
        if seen["count"] != row["count"]:
            yield f"{topic}: {seen['count']} messages of {row['count']}"
        else:
            yield from differences(topic, [*seen["first"], seen["last"]], [*row["first"], row["last"]])

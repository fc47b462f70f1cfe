"""Describes message types as the message_details service of rosapi does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rosbags.interfaces import Nodetype

from server.bridge.completion import DEEPEST, PLACEHOLDER, TIMES, zero
from server.source import Json, RosVersion

_ROS2_NAMES = {"bool": "boolean", "float32": "float", "float64": "double", "byte": "octet"}  # as rosidl calls them
_NOT_AN_ARRAY, _ANY_LENGTH = -1, 0

Row = tuple[str, str, int, str]  # name, type, length of the array, example


def describe(type: str, definitions: dict[str, Any], version: RosVersion) -> list[Json]:
    """The type, then every type it contains, each once. `type` is spelled as rosbags does."""
    found: dict[str, Json] = {}
    _describe(type, definitions, version, found, 0)
    return list(found.values())


def _describe(type: str, definitions: dict[str, Any], version: RosVersion, found: dict[str, Json], depth: int) -> None:
    name = _shown(type, version)
    if name in found or depth > DEEPEST:
        return
    if name in TIMES.values():
        found[name] = _typedef(name, [("secs", "int32", -1, "0"), ("nsecs", "int32", -1, "0")], [])
        return
    if type not in definitions:
        return
    constants, fields = definitions[type]
    rows: list[Row] = []
    inner: list[str] = []
    for field_name, (kind, what) in fields:
        if field_name == PLACEHOLDER:
            continue
        is_array = kind in (Nodetype.ARRAY, Nodetype.SEQUENCE)
        (item_kind, item), length = what if is_array else ((kind, what), _NOT_AN_ARRAY)
        if item_kind == Nodetype.NAME:
            inner.append(item)
            shown, example = _shown(item, version), "{}"
        else:
            shown = item[0] if version == 1 else _ROS2_NAMES.get(item[0], item[0])
            example = str(zero(item[0]))
        rows.append(
            (field_name, shown, length if kind != Nodetype.SEQUENCE else _ANY_LENGTH, "[]" if is_array else example)
        )
    found[name] = _typedef(name, rows, [(constant, str(value)) for constant, _, value in constants])
    for item in inner:
        _describe(item, definitions, version, found, depth + 1)


def _shown(type: str, version: RosVersion) -> str:
    return TIMES[type] if version == 1 and type in TIMES else type.replace("/msg/", "/")


def _typedef(type: str, rows: Sequence[Row], constants: Sequence[tuple[str, str]]) -> Json:
    return {
        "type": type,
        "fieldnames": [row[0] for row in rows],
        "fieldtypes": [row[1] for row in rows],
        "fieldarraylen": [row[2] for row in rows],
        "examples": [row[3] for row in rows],
        "constnames": [name for name, _ in constants],
        "constvalues": [value for _, value in constants],
    }

"""Loads message types by name, with the errors of rosbridge's loader, and describes them as message_details does."""

from __future__ import annotations

import array
from typing import Any

import numpy as np

from server.judge.message import Json, RosVersion
from server.judge.ros_names import BadName, canonical_type
from server.rosbridge_server.interface import TypeSource
from server.rosbridge_server.shape import DEEPEST, DEFAULTS, FLOATS, INTEGERS, TIMES, Field, fields, shown, zero

TIME_TYPEDEF = {
    "fieldnames": ["secs", "nsecs"],
    "fieldtypes": ["int32", "int32"],
    "fieldarraylen": [-1, -1],
    "examples": ["0", "0"],
    "constnames": [],
    "constvalues": [],
}
_CODES = {
    "int8": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_FIRST_ADDRESS = 0x7F0000000000


class Malformed(Exception):
    """No name of a type."""


class Unknown(Exception):
    """A package or a type that is not installed."""


def load(bridge: TypeSource, name: str) -> str:
    """The type as the graph has it. Raises Malformed and Unknown, with the texts of rosbridge."""
    try:
        type = canonical_type(name, bridge.ros_version)
    except BadName:
        raise Malformed(f"{name} is not a valid type string") from None
    if bridge.types.definitions(type) is None and type not in bridge.advertised_types():
        package, kind = name.partition("/")[0], name.rpartition("/")[2]
        if not bridge.types.has_package(package):
            raise Unknown(f"Unable to load the manifest for package {package}. Caused by: {package}")
        raise Unknown(
            f"Unable to import msg class {kind} from package {package}. "
            f"Caused by module '{package}.msg' has no attribute '{kind}'"
        )
    return type


def describe(type: str, definitions: dict[str, Any], version: RosVersion) -> list[Json]:
    """The type, then every type it contains, each once. `type` is spelled as rosbags does."""
    found: dict[str, Json] = {}
    _Description(definitions, version).add(type, found, 0)
    return list(found.values())


class _Description:
    def __init__(self, definitions: dict[str, Any], version: RosVersion) -> None:
        self._definitions = definitions
        self._version = version
        self._address = _FIRST_ADDRESS

    def add(self, type: str, found: dict[str, Json], depth: int) -> None:
        name = shown(type, self._version)
        if name in found or depth > DEEPEST:
            return
        if self._version == 1 and type in TIMES:
            found[name] = {"type": name, **TIME_TYPEDEF}
            return
        if type not in self._definitions:
            return
        rows = fields(type, self._definitions)
        constants = {
            constant: str(bytes((value,))) if self._version == 2 and kind == "byte" else _constant(value)
            for constant, kind, value in self._definitions[type][0]
        }
        if self._version == 2:
            constants |= {"SLOT_TYPES": self._slots(rows)}
            constants |= {row.name: str(self._zero(type, row)) for row in rows}
            defaults = DEFAULTS[2]
            constants |= {
                f"{row.name.upper()}__DEFAULT": str(defaults[type, row.name])
                for row in rows
                if (type, row.name) in defaults
            }
        named = sorted(constants)
        found[name] = {
            "type": name,
            "fieldnames": [row.name if self._version == 1 else f"_{row.name}" for row in rows],
            "fieldtypes": [row.item().shown(self._version) for row in rows],
            "fieldarraylen": [_length(row) for row in rows],
            "examples": [self._example(type, row) for row in rows],
            "constnames": named,
            "constvalues": [constants[constant] for constant in named],
        }
        for row in rows:
            if row.is_message:
                self.add(row.type, found, depth + 1)

    def _example(self, type: str, row: Field) -> str:
        if row.array:
            return "[]"
        return "{}" if row.is_message else str(self._zero(type, row))

    def _slots(self, rows: tuple[Field, ...]) -> str:
        slots = [f"<rosidl_parser.definition.{_slot(row)} object at {self._next_address():#x}>" for row in rows]
        return f"({', '.join(slots)}{',' if len(slots) == 1 else ''})"

    def _next_address(self) -> int:
        self._address += 0x30
        return self._address

    def _zero(self, type: str, row: Field) -> Any:
        """What the field holds in a new message, as Python shows it in each version."""
        if not row.array:
            return self._item(type, row)
        if row.type in FLOATS or (row.type in INTEGERS and row.type != "byte"):
            if row.array == "fixed":
                return np.zeros(row.length, dtype=FLOATS.get(row.type) or INTEGERS[row.type])
            return array.array(_CODES[row.type])
        return [self._item(type, row.item()) for _ in range(row.length if row.array == "fixed" else 0)]

    def _item(self, type: str, row: Field) -> Any:
        if row.is_message:
            return _Shown(self._repr(row.type))
        if row.type == "byte" and self._version == 2:
            return b"\0"
        return DEFAULTS[self._version].get((type, row.name), zero(row.type))

    def _repr(self, type: str) -> str:
        rows = fields(type, self._definitions) if type in self._definitions else ()
        inner = ", ".join(f"{row.name}={_listed(self._zero(type, row))!r}" for row in rows)
        return f"{type.replace('/', '.')}({inner})"


class _Shown:
    """A message inside another, written as Python writes it."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


def _listed(value: Any) -> Any:
    return value.tolist() if isinstance(value, array.array) else value


def _constant(value: Any) -> str:
    text = str(value)
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def _length(row: Field) -> int:
    return -1 if not row.array else row.length if row.array == "fixed" else 0


def _slot(row: Field) -> str:
    if row.array:
        kind = "Array" if row.array == "fixed" else "BoundedSequence" if row.length else "UnboundedSequence"
    elif row.is_message:
        kind = "NamespacedType"
    elif row.type in ("string", "wstring"):
        kind = f"{'Bounded' if row.text_bound else 'Unbounded'}{row.type.capitalize().replace('Wstring', 'WString')}"
    else:
        kind = "BasicType"
    return kind

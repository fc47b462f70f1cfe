"""The fields of a message type, as rosbridge of each ROS version names them, and their values, as Python holds them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from rosbags.interfaces import Nodetype

from server.judge.message import RosVersion

HEADER = "std_msgs/msg/Header"
TIMES = {"builtin_interfaces/msg/Time": "time", "builtin_interfaces/msg/Duration": "duration"}  # primitives of ROS 1
PLACEHOLDER = "structure_needs_at_least_one_member"  # of ROS 2 messages without fields
DEEPEST = 32  # levels of messages in messages: a definition that contains itself never ends

Array = Literal["", "fixed", "sequence"]

FLOATS = {"float32": "f4", "float64": "f8"}
INTEGERS = {
    "byte": "i1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_ROS2_NAMES = {"bool": "boolean", "float32": "float", "float64": "double", "byte": "octet", "char": "uint8"}

# what a field holds in a new message where that is not zero
DEFAULTS: dict[int, dict[tuple[str, str], float]] = {
    1: {},
    2: {("geometry_msgs/msg/Quaternion", name): float(name == "w") for name in "xyzw"},
}


class Lost(Exception):
    """The message cannot be sent in an encoding; the text is the reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """One field of a message. `type` is a primitive's name in .msg text, or a message's as rosbags spells it."""

    name: str
    type: str
    is_message: bool
    array: Array = ""
    length: int = 0  # of a fixed array; the bound of a sequence, 0 for none
    text_bound: int = 0  # of string<=N

    @property
    def is_bytes(self) -> bool:
        return self.array != "" and self.type in ("uint8", "char")

    @property
    def is_float(self) -> bool:
        return self.type in FLOATS

    @property
    def is_number(self) -> bool:
        return self.type in FLOATS or self.type in INTEGERS

    def item(self) -> Field:
        """One element of the array, as a field of its own."""
        return Field(name=self.name, type=self.type, is_message=self.is_message, text_bound=self.text_bound)

    def shown(self, version: RosVersion) -> str:
        """The type of one element, as error texts and message_details write it."""
        if self.is_message:
            return shown(self.type, version)
        if version == 1:
            return self.type
        name = _ROS2_NAMES.get(self.type, self.type)
        return f"{name}<{self.text_bound}>" if self.text_bound else name


def shown(type: str, version: RosVersion) -> str:
    """A message's type in two parts, as rosbridge writes it; time and duration are primitives of ROS 1."""
    return TIMES[type] if version == 1 and type in TIMES else type.replace("/msg/", "/")


def fields(type: str, definitions: dict[str, Any]) -> tuple[Field, ...]:
    """The fields of a message whose type is spelled as rosbags does. Raises KeyError where it is not known."""
    return tuple(_field(name, kind, what) for name, (kind, what) in definitions[type][1] if name != PLACEHOLDER)


def _field(name: str, kind: Nodetype, what: Any) -> Field:
    if kind == Nodetype.NAME:
        return Field(name=name, type=what, is_message=True)
    if kind == Nodetype.BASE:
        return Field(name=name, type=what[0], is_message=False, text_bound=what[1] if what[0] == "string" else 0)
    (item_kind, item), length = what
    element = _field(name, item_kind, item)
    return Field(
        name=name,
        type=element.type,
        is_message=element.is_message,
        array="fixed" if kind == Nodetype.ARRAY else "sequence",
        length=length,
        text_bound=element.text_bound,
    )


def zero(primitive: str) -> Any:
    """The default value of a primitive type."""
    return {"bool": False, "string": "", "wstring": ""}.get(primitive, 0.0 if primitive in FLOATS else 0)


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

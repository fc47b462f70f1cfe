"""Checks what a client publishes against its type and fills in what was left out, as rosbridge does."""

from __future__ import annotations

import base64
import binascii
import math
from typing import Any, cast

import numpy as np
from rosbags.interfaces import Nodetype

from server.judge.message import Json, RosVersion

HEADER = "std_msgs/msg/Header"
TIMES = {"builtin_interfaces/msg/Time": "time", "builtin_interfaces/msg/Duration": "duration"}  # primitives of ROS 1
PLACEHOLDER = "structure_needs_at_least_one_member"  # of ROS 2 messages without fields
DEEPEST = 32  # levels of messages in messages: a definition that contains itself never ends

_FLOATS = {"float32": "f4", "float64": "f8"}
_INTEGERS = {  # lowest, highest, numpy
    "byte": (-128, 255, "i2"),  # signed in ROS 1, not in ROS 2
    "char": (0, 255, "u1"),
    "int8": (-(2**7), 2**7 - 1, "i1"),
    "int16": (-(2**15), 2**15 - 1, "i2"),
    "int32": (-(2**31), 2**31 - 1, "i4"),
    "int64": (-(2**63), 2**63 - 1, "i8"),
    "uint8": (0, 2**8 - 1, "u1"),
    "uint16": (0, 2**16 - 1, "u2"),
    "uint32": (0, 2**32 - 1, "u4"),
    "uint64": (0, 2**64 - 1, "u8"),
}


class TypeMismatch(ValueError):
    """A message that is not of its type. The text is one sentence for the client."""


def complete(
    type: str, definitions: dict[str, Any], version: RosVersion, message: Json, now_s: float, notes: list[str]
) -> Json:
    """The message with all fields of its type: zeros where nothing was given, header stamps `now_s`.

    Numeric arrays become numpy, byte arrays bytes. Times are read as rosbridge reads them: ROS 2 takes the names of
    ROS 1 too, ROS 1 leaves those of ROS 2 out, with a sentence in `notes`. Raises TypeMismatch.
    """
    return cast("Json", _Completion(definitions, version, type, now_s, notes).message(type, message, "", 0))


def zero(primitive: str) -> Any:
    """The default value of a primitive type."""
    return {"bool": False, "string": ""}.get(primitive, 0.0 if primitive in _FLOATS else 0)


class _Completion:
    def __init__(
        self, definitions: dict[str, Any], version: RosVersion, type: str, now_s: float, notes: list[str]
    ) -> None:
        self._definitions = definitions
        self._version = version
        self._type = type.replace("/msg/", "/")
        self._now_s = now_s
        self._notes = notes

    def message(self, type: str, given: Any, where: str, depth: int) -> Any:
        if type in TIMES:
            given = self._respelled(type, given, where)
            if self._version == 1:
                return self._time(given, where)
        if type not in self._definitions or depth > DEEPEST:
            return given
        if not isinstance(given, dict):
            raise self._misfit(where, "an object", given)
        fields = dict(self._definitions[type][1])
        for name in given:
            if name not in fields:
                raise TypeMismatch(f"{self._type} has no field {where}{name}"[:200])
        if type == HEADER:
            given = {"stamp": self._now(), **given}
            if self._is_left_out(given["stamp"]):
                self._note(f"{where}stamp", "the time of the bridge")
                given["stamp"] = self._now()
        return {
            name: self._value(field, given.get(name), f"{where}{name}", depth, is_given=name in given)
            for name, field in fields.items()
            if name != PLACEHOLDER
        }

    def _value(self, field: Any, given: Any, where: str, depth: int, *, is_given: bool) -> Any:
        kind, what = field
        if kind == Nodetype.NAME:
            return self.message(what, given if is_given else {}, f"{where}.", depth + 1)
        if kind == Nodetype.BASE:
            return self._primitive(what[0], given, where) if is_given else zero(what[0])
        item, length = what
        is_fixed = kind == Nodetype.ARRAY
        is_bytes = item[0] == Nodetype.BASE and item[1][0] in ("uint8", "char")
        if not is_given:
            count = length if is_fixed else 0
            values = [self._value(item, None, where, depth, is_given=False) for _ in range(count)]
        elif is_bytes and isinstance(given, str):
            values = self._base64(given, where)
        elif isinstance(given, list):
            values = [self._value(item, value, where, depth, is_given=True) for value in given]
        else:
            raise self._misfit(where, "a list", given)
        if length and (len(values) != length if is_fixed else len(values) > length):
            raise TypeMismatch(f"{self._type} takes {length} values for {where}, got {len(values)}")
        if is_bytes:
            return bytes(values)
        return _array(item[1][0], values) if item[0] == Nodetype.BASE else values

    def _primitive(self, name: str, given: Any, where: str) -> Any:
        if name == "bool":
            if isinstance(given, bool):
                return given
            raise self._misfit(where, "true or false", given)
        if name == "string":
            if isinstance(given, str):
                return given
            raise self._misfit(where, "text", given)
        if isinstance(given, bool) or not isinstance(given, int | float):
            raise self._misfit(where, "a number", given)
        if name not in _INTEGERS:
            try:
                return float(given)
            except OverflowError:
                raise self._misfit(where, "a smaller number", given) from None
        low, high, _ = _INTEGERS[name]
        if isinstance(given, float) or not low <= given <= high:
            raise self._misfit(where, f"a whole number between {low} and {high}", given)
        return given

    def _base64(self, given: str, where: str) -> list[int]:
        try:
            return list(base64.b64decode(given, validate=True))
        except (binascii.Error, ValueError):
            raise self._misfit(where, "base64 or a list of numbers", given) from None

    def _respelled(self, type: str, given: Any, where: str) -> Any:
        """A time with the names of this version."""
        if given == "now" and TIMES[type] == "time":
            return self._now()
        if self._is_left_out(given):
            self._note(where.rstrip("."), "zero")
        if self._version == 2 and isinstance(given, dict):
            names = {"secs": "sec", "nsecs": "nanosec"}
            return {names[name]: value for name, value in given.items() if name in names} | {
                name: value for name, value in given.items() if name not in names
            }
        return given

    def _is_left_out(self, given: Any) -> bool:
        return self._version == 1 and isinstance(given, dict) and bool(given) and not given.keys() & {"secs", "nsecs"}

    def _note(self, where: str, instead: str) -> None:
        self._notes.append(f"{where[:80]} has no secs and nsecs, as times of ROS 1 have: it is {instead}")

    def _time(self, given: Any, where: str) -> Json:
        if not isinstance(given, dict):
            raise self._misfit(where, "a time", given)
        return {name: self._primitive("int64", given.get(name, 0), f"{where}{name}") for name in ("secs", "nsecs")}

    def _now(self) -> Json:
        return stamp(self._now_s, self._version)

    def _misfit(self, where: str, expected: str, given: Any) -> TypeMismatch:
        shown = "a huge number" if isinstance(given, int) and abs(given) > 2**64 else repr(given)
        shown = shown if len(shown) <= 40 else f"{shown[:40]}…"
        return TypeMismatch(f"{self._type} takes {expected} for {where.rstrip('.')[:80] or 'the message'}, got {shown}")


def stamp(at_s: float, version: RosVersion) -> Json:
    """A time as messages carry it: secs/nsecs in ROS 1, sec/nanosec in ROS 2."""
    whole = math.floor(at_s)
    carry, rest = divmod(round((at_s - whole) * 1e9), 1_000_000_000)  # at_s * 1e9 would not be exact
    seconds = whole + carry
    return {"secs": seconds, "nsecs": rest} if version == 1 else {"sec": seconds, "nanosec": rest}


def _array(primitive: str, values: list[Any]) -> Any:
    """Numbers as a numpy array, so that CBOR carries them as a typed array; text and truth values stay a list."""
    if primitive in _INTEGERS:
        return np.array(values, dtype=_INTEGERS[primitive][2])
    with np.errstate(over="ignore"):  # 1e300 is infinite as a float32
        return np.array(values, dtype=_FLOATS[primitive]) if primitive in _FLOATS else values

"""Turns rosbridge-shaped messages back into the bytes of ROS, by a function compiled once for each type.

The counterpart of decode.py, from the same sources. What comes out is what rosbags' own serializer writes, from plain
dicts and at a tenth of the work; a message that is not of its type is refused, never bent.
"""

from __future__ import annotations

import base64
import binascii
import struct
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from server.judge.message import RosVersion
from server.recording.read.code_writer import PLACEHOLDER, PRIMITIVES, ROS1_TIMES, CodeWriter
from server.recording.read.definitions import demand_few_fields

Encode = Callable[[Any], bytes]

_NAN = float("nan")
_CDR_HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
_MISTAKES = (struct.error, ValueError, TypeError, KeyError, OverflowError, AttributeError)

_Kind = tuple[str, np.dtype[Any], str]  # typecode of array, dtype of numpy, name


class TypeMismatch(Exception):
    """A message that is not of its type: a field too many or too few, or a value of another kind."""


def compile_encoder(type: str, definitions: dict[str, Any], version: RosVersion) -> Encode:
    """The function that writes messages of a type ("geometry_msgs/msg/Twist" in both versions, as rosbags spells it).

    It takes the output of decode.py and of a bridge: null among floats is NaN (JSON has no other form),
    uint8[] may be base64, bytes or a list. Raises Undecodable here where the type is not known or not supported, and
    TypeMismatch from the function.
    """
    demand_few_fields(type, definitions)
    writer = _EncoderWriter(definitions, ros1=version == 1)
    writer.message(type, "m", 0)
    writer.flush()
    lines = ["def encode(m):", f" out = bytearray({b'' if version == 1 else _CDR_HEADER!r})", " try:", *writer.lines]
    lines += [" except mistakes as why:", "  raise TypeMismatch(str(why)) from None", " return bytes(out)"]
    names: dict[str, Any] = {"TypeMismatch": TypeMismatch, "mistakes": _MISTAKES} | _ROAD | writer.constants
    exec(compile("\n".join(lines), f"<encoder of {type}>", "exec"), names)
    encode: Encode = names["encode"]
    return encode


class _EncoderWriter(CodeWriter):
    """Writes the source of one encoder."""

    def __init__(self, definitions: dict[str, Any], *, ros1: bool) -> None:
        super().__init__(definitions, ros1=ros1)
        self._values: list[str] = []  # the expressions of the run's values

    def message(self, type: str, given: str, depth: int) -> None:
        """Writes the writing of the message that the expression `given` is."""
        if self._ros1 and type in ROS1_TIMES:
            self._check(f"len({given}) != 2")
            for name in ("secs", "nsecs"):
                self._primitive(ROS1_TIMES[type], f"{given}[{name!r}]")
            return
        fields = [(name, what) for name, what in self._fields_of(type, depth) if name != PLACEHOLDER]
        self._check(f"{given}.__class__ is not dict or len({given}) != {len(fields)}")
        if not fields and not self._ros1:
            self._primitive("uint8", "0")
        for name, (kind, what) in fields:
            value = self._new_name()
            self._write(f"{value} = {given}[{name!r}]")
            if kind == Nodetype.NAME:
                self.message(what, value, depth + 1)
            elif kind == Nodetype.BASE:
                self._base(what[0], value)
            else:
                self._many(what, kind == Nodetype.ARRAY, value, depth)

    def flush(self) -> None:
        """Writes out the pending run of primitives."""
        if self._run:
            pack = self._constant(struct.Struct("<" + "".join(self._run)).pack)
            self._write(f"out += {pack}({', '.join(self._values)})")
            self._run, self._values = [], []

    def _base(self, primitive: str, value: str) -> None:
        if primitive == "string":
            self._string(value)
        else:
            self._primitive(primitive, value)

    def _primitive(self, primitive: str, value: str) -> None:
        code, _, size = self._look_up(primitive)
        self._align(size)
        match primitive:
            case "float32" | "float64":
                self._write(f"if {value}.__class__ is not float: {value} = one_float({value})")
            case "bool":
                self._check(f"{value} not in (False, True)")
            case "byte":
                value = f"one_byte({value})"
            case _ if value.startswith("v") and not value.endswith("]"):
                self._check(f"{value}.__class__ is bool")
        self._run.append(code)
        self._values.append(value)
        self._offset += size

    def _string(self, value: str) -> None:
        raw = self._new_name()
        self._write(f"{raw} = {value}.encode()")
        if self._ros1:
            self._primitive("uint32", f"len({raw})")
            self.flush()
            self._write(f"out += {raw}")
        else:  # CDR counts the NUL that ends it
            self._primitive("uint32", f"len({raw}) + 1")
            self.flush()
            self._write(f"out += {raw}; out.append(0)")
        self._modulus, self._offset = 1, 0

    def _many(self, what: Any, is_fixed: bool, value: str, depth: int) -> None:
        item, length = what
        items = self._new_name()
        is_numbers = item[0] == Nodetype.BASE and item[1][0] != "string"
        if is_numbers:
            self._look_up(item[1][0])
            road = {"uint8": "octets", "char": "octets", "float32": "floats", "float64": "floats"}
            known = self._constant(_kind(item[1][0]))
            self._write(f"{items} = {road.get(item[1][0], 'numbers')}({value}, {known})")
            size = PRIMITIVES[item[1][0]][2]
            count = f"len({items})" if size == 1 else f"len({items}) // {size}"
        else:
            self._check(f"{value}.__class__ is not list")
            self._write(f"{items} = {value}")
            count = f"len({items})"
        if is_fixed:
            self._check(f"{count} != {length}")
        else:
            if length:
                self._check(f"{count} > {length}")
            self._primitive("uint32", count)
        self.flush()
        if is_numbers:
            self._numbers(item[1][0], items, is_fixed=is_fixed)
            return
        one = self._new_name()
        self._write(f"for {one} in {items}:")
        outer, self._indent = self._indent, self._indent + " "
        self._modulus, self._offset = 1, 0
        if item[0] == Nodetype.NAME:
            self.message(item[1], one, depth + 1)
        else:
            self._string(one)
        self.flush()
        self._write("pass")
        self._indent = outer
        self._modulus, self._offset = 1, 0

    def _numbers(self, primitive: str, items: str, *, is_fixed: bool) -> None:
        size = PRIMITIVES[primitive][2]
        self._align_items(size, items, is_fixed=is_fixed)
        self._write(f"out += {items}")
        self._modulus, self._offset = (size, 0) if is_fixed else (min(size, 4), 0)

    def _padding(self, size: int) -> str:
        return f"out += bytes((4 - len(out)) % {size})"  # counted from behind the header of 4 bytes

    def _check(self, condition: str) -> None:
        self._write(f"if {condition}: raise TypeMismatch('it does not fit its type')")


def _kind(primitive: str) -> _Kind:
    code, dtype, _ = PRIMITIVES[primitive]
    return code.replace("?", "b"), np.dtype(f"<{dtype}"), primitive


def _floats(given: Any, kind: _Kind) -> bytes:
    """The bytes of an array of floats; null is NaN."""
    code, dtype, _ = kind
    if given.__class__ is np.ndarray:
        if given.dtype == dtype and given.ndim == 1:
            return bytes(given.tobytes())
        given = given.tolist()
    elif given.__class__ is not list:
        raise TypeMismatch("not a list of numbers")
    try:
        return array(code, given).tobytes()
    except TypeError:
        return array(code, [_NAN if one is None else one for one in given]).tobytes()


def _one_float(given: Any) -> float:
    """JSON writes a whole float without a point, and NaN and the infinities as null."""
    if given is None:
        return _NAN
    if given.__class__ is not int:
        raise TypeMismatch("no number")
    return float(given)


def _numbers(given: Any, kind: _Kind) -> bytes:
    """The bytes of an array of whole numbers or of truth values."""
    code, dtype, primitive = kind
    if given.__class__ is np.ndarray:
        if given.dtype == dtype and given.ndim == 1:
            return bytes(given.tobytes())
        given = given.tolist()
    elif given.__class__ is bytes and dtype.itemsize == 1:
        return bytes(given)
    elif given.__class__ is not list:
        raise TypeMismatch("not a list of numbers")
    if primitive == "bool":
        if any(one not in (False, True) for one in given):
            raise TypeMismatch("not a list of booleans")
    elif any(one.__class__ is bool for one in given):
        raise TypeMismatch("a boolean among numbers")
    if primitive == "byte":
        given = [_one_byte(one) for one in given]
    return array(code, given).tobytes()


def _octets(given: Any, kind: _Kind) -> bytes:
    """The bytes of uint8[] or char[]: base64 in JSON, bytes in CBOR, a list from some bridges."""
    if given.__class__ is bytes:
        return bytes(given)
    if given.__class__ is str:
        return _base64(given)
    return _numbers(given, kind)


def _base64(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise TypeMismatch("no base64") from None


def _one_byte(given: Any) -> int:
    """A `byte`, signed as ROS 1 has it: a number of either sign, or as some bridges write it, base64 or one letter."""
    if given.__class__ is str:
        if len(given) == 1:
            given = int(given) if given.isdecimal() else ord(given)  # as decode.py of the server reads it
        else:
            given = _base64(given)
    if given.__class__ is bytes and len(given) == 1:
        given = given[0]
    if given.__class__ is not int or not -128 <= given <= 255:
        raise TypeMismatch("no byte")
    return int(given - 256 if given > 127 else given)


_ROAD = {"floats": _floats, "numbers": _numbers, "octets": _octets, "one_byte": _one_byte, "one_float": _one_float}

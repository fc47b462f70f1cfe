"""Turns the bytes of recorded ROS messages into rosbridge-shaped dicts, by a function compiled once for each type.

Sources of the formats: ROS 1 serialization (wiki.ros.org/ROS/Technical Overview: little-endian, packed, u32 lengths);
ROS 2: OMG CDR 1.0 (DDSI-RTPS 10: a 4-byte header, then each primitive aligned to its own size, strings end in a NUL).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from server.judge.message import RosVersion
from server.recording.read.definitions import demand_few_fields
from server.recording.read.errors import Undecodable

Decode = Callable[[bytes], dict[str, Any]]

# name → (code of struct, numpy dtype without byte order, bytes)
_PRIMITIVES = {
    "bool": ("?", "?", 1),
    "byte": ("b", "i1", 1),
    "char": ("B", "u1", 1),
    "int8": ("b", "i1", 1),
    "uint8": ("B", "u1", 1),
    "int16": ("h", "i2", 2),
    "uint16": ("H", "u2", 2),
    "int32": ("i", "i4", 4),
    "uint32": ("I", "u4", 4),
    "int64": ("q", "i8", 8),
    "uint64": ("Q", "u8", 8),
    "float32": ("f", "f4", 4),
    "float64": ("d", "f8", 8),
}
_ROS1_TIMES = {
    "builtin_interfaces/msg/Time": ("uint32", "secs", "nsecs"),
    "builtin_interfaces/msg/Duration": ("int32", "secs", "nsecs"),
}
_PLACEHOLDER = "structure_needs_at_least_one_member"  # how ROS 2 writes a message without fields; no field of anybody's
_MISTAKES = (struct.error, ValueError, OverflowError, MemoryError)
_DEEPEST = 32  # levels of messages in messages: a definition that contains itself never ends


def sifted(decode: Decode, topic: str, topics: Collection[str] | None) -> Decode:
    """Leaves out what is not wanted: decoding is most of the work of reading a recording.

    The decoder of a topic's messages where only `topics` are wanted (None: all); what is not is empty.

    With `topics` as a mapping, those are wanted whose bytes hold one of the patterns of their topic (None: all); the
    patterns may change while they are read.
    """
    if topics is None:
        return decode
    if topic not in topics:
        return _nothing
    patterns: Collection[bytes] | None = topics[topic] if isinstance(topics, Mapping) else None
    return decode if patterns is None else _sifting(decode, patterns)


def _sifting(decode: Decode, patterns: Collection[bytes]) -> Decode:
    def decode_some(raw: bytes) -> dict[str, Any]:
        for pattern in patterns:
            if pattern in raw:
                return decode(raw)
        return {}

    return decode_some


def _nothing(raw: bytes) -> dict[str, Any]:
    return {}


def compile_decoder(type: str, definitions: dict[str, Any], version: RosVersion) -> Decode:
    """The function that reads messages of a type ("geometry_msgs/msg/Twist" in both versions, as rosbags spells it).

    The dicts have rosbridge's shape: stamps are secs/nsecs in ROS 1 and sec/nanosec in ROS 2, numeric arrays stay
    numpy, uint8[] and char[] are bytes. Raises Undecodable here where the type is not known or not supported, and from
    the function where a message's bytes do not fit it.
    """
    demand_few_fields(type, definitions)
    if version == 1:
        return _compile(type, definitions, _Layout(ros1=True, order="<", start=0), None)
    big: list[Decode] = []  # compiled when first met: hardly any recording has them

    def read_other(raw: bytes) -> dict[str, Any]:
        if raw[:2] != b"\x00\x00":
            raise Undecodable(f"its encoding {raw[:2].hex() or 'nothing'} is not plain CDR")
        if not big:
            big.append(_compile(type, definitions, _Layout(ros1=False, order=">", start=4), None))
        return big[0](raw)

    return _compile(type, definitions, _Layout(ros1=False, order="<", start=4), read_other)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Layout:
    """The byte layout: packed in ROS 1, aligned in CDR."""

    ros1: bool
    order: str  # "<" or ">"
    start: int


def _compile(type: str, definitions: dict[str, Any], layout: _Layout, other: Decode | None) -> Decode:
    """`other` reads what is not little-endian CDR."""
    writer = _Writer(definitions, layout)
    result = writer.message(type, 0)
    writer.flush()
    lines = ["def decode(raw):"]
    if other is not None:
        lines += [r" if raw[:2] != b'\x00\x01': return other(raw)"]
    lines += [" size = len(raw)", f" pos = {layout.start}", " try:", *writer.lines, f"  return {result}"]
    lines += [" except mistakes:", "  raise Undecodable(f'its {size} bytes do not fit its type') from None"]
    names: dict[str, Any] = {
        "frombuffer": np.frombuffer,
        "Undecodable": Undecodable,
        "mistakes": _MISTAKES,
        "other": other,
    }
    names |= writer.constants
    exec(compile("\n".join(lines), f"<decoder of {type}>", "exec"), names)
    decode: Decode = names["decode"]
    return decode


class _Writer:
    """Writes the source of one decoder: runs of primitives become one struct each, nested messages are written in line.

    Names from definitions go into the source only as quoted strings, so no definition can smuggle in code.
    """

    def __init__(self, definitions: dict[str, Any], layout: _Layout) -> None:
        self.lines: list[str] = []
        self.constants: dict[str, Any] = {}
        self._definitions = definitions
        self._layout = layout
        self._indent = "  "
        self._names = 0
        self._run: list[str] = []  # struct codes not yet written out, and
        self._variables: list[str] = []  # the variables which take their values
        self._modulus, self._offset = 8, 0  # what is known of the place: place mod _modulus = _offset

    def message(self, type: str, depth: int) -> str:
        """Writes the reading of a message; answers the expression of its dict."""
        if depth > _DEEPEST:
            raise Undecodable("its definition contains itself")
        if self._layout.ros1 and type in _ROS1_TIMES:
            primitive, seconds, nanoseconds = _ROS1_TIMES[type]
            first, second = self._primitive(primitive), self._primitive("uint32" if primitive == "uint32" else "int32")
            return f"{{{seconds!r}: {first}, {nanoseconds!r}: {second}}}"
        if type not in self._definitions:
            raise Undecodable(f"the definition of {type} is missing")
        pairs = []
        for name, description in self._definitions[type][1]:
            if name == _PLACEHOLDER:
                if not self._layout.ros1:
                    self._primitive("uint8")
                continue
            pairs.append(f"{name!r}: {self._field(description, depth)}")
        return "{" + ", ".join(pairs) + "}"

    def flush(self) -> None:
        """Writes out the pending run of primitives."""
        if not self._run:
            return
        packed = struct.Struct(self._layout.order + "".join(self._run))
        name = self._constant(packed.unpack_from)
        if self._variables:
            self._write(f"{', '.join(self._variables)}, = {name}(raw, pos)")
        self._write(f"pos += {packed.size}")
        self._run, self._variables = [], []

    def _field(self, description: Any, depth: int) -> str:
        kind, what = description
        if kind == Nodetype.NAME:
            return self.message(what, depth + 1)
        if kind == Nodetype.BASE:
            return self._string() if what[0] == "string" else self._primitive(what[0])
        item, length = what
        count = str(length) if kind == Nodetype.ARRAY else self._primitive("uint32")
        self.flush()
        if item[0] == Nodetype.BASE and item[1][0] != "string":
            return self._primitives(item[1][0], count, is_fixed=kind == Nodetype.ARRAY)
        return self._list(item, count, depth)

    def _primitive(self, primitive: str) -> str:
        code, _, size = self._look_up(primitive)
        self._align(size)
        variable = self._new_name()
        self._run.append(code)
        self._variables.append(variable)
        self._offset += size
        return variable

    def _string(self) -> str:
        length = self._primitive("uint32")
        self.flush()
        variable, end = self._new_name(), self._new_name()
        self._write(f"{end} = pos + {length}")
        self._write(f"if {end} > size: raise ValueError")
        last = end if self._layout.ros1 else f"{end} - 1 if {length} else pos"  # CDR counts the NUL
        self._write(f"{variable} = str(raw[pos:{last}], 'utf-8', 'replace')")
        self._write(f"pos = {end}")
        self._modulus, self._offset = 1, 0
        return variable

    def _primitives(self, primitive: str, count: str, *, is_fixed: bool) -> str:
        _, dtype, size = self._look_up(primitive)
        if not self._layout.ros1 and size > self._modulus_now():
            condition = "" if is_fixed else f"if {count}: "  # CDR aligns for the items, and there may be none
            self._write(f"{condition}pos += ({4 % size} - pos) % {size}")
        variable = self._new_name()
        if primitive in ("uint8", "char"):
            self._write(f"if pos + {count} > size: raise ValueError")
            self._write(f"{variable} = bytes(raw[pos:pos + {count}])")
        else:
            name = self._constant(np.dtype(self._layout.order + dtype))
            native = ".astype(" + self._constant(np.dtype(dtype)) + ")"  # also a copy that keeps no raw bytes alive
            self._write(f"{variable} = frombuffer(raw, {name}, {count}, pos){native}")
        self._write(f"pos += {count} * {size}" if size > 1 else f"pos += {count}")
        self._modulus, self._offset = (size, 0) if is_fixed else (min(size, 4), 0)
        return variable

    def _list(self, item: Any, count: str, depth: int) -> str:
        items = self._new_name()
        self._write(f"if {count} > size: raise ValueError")  # a damaged length
        self._write(f"{items} = []")
        self._write(f"for _ in range({count}):")
        outer, self._indent = self._indent, self._indent + " "
        self._modulus, self._offset = 1, 0
        expression = self._field(item, depth)
        self.flush()
        self._write(f"{items}.append({expression})")
        self._indent = outer
        self._modulus, self._offset = 1, 0
        return items

    def _align(self, size: int) -> None:
        if self._layout.ros1 or size == 1:
            return
        if self._modulus >= size:
            padding = -self._offset % size
            if padding:
                self._run.append(f"{padding}x")
                self._offset += padding
        else:
            self.flush()
            self._write(f"pos += ({4 % size} - pos) % {size}")
            self._modulus, self._offset = size, 0

    def _modulus_now(self) -> int:
        """The largest size that this place is known to be aligned to."""
        size = self._modulus
        while self._offset % size:
            size //= 2
        return size

    def _look_up(self, primitive: str) -> tuple[str, str, int]:
        found = _PRIMITIVES.get(primitive)
        if found is None:
            raise Undecodable(f"fields of the kind {primitive} are not supported")
        return found

    def _constant(self, value: Any) -> str:
        name = f"c{len(self.constants)}"
        self.constants[name] = value
        return name

    def _new_name(self) -> str:
        self._names += 1
        return f"v{self._names}"

    def _write(self, line: str) -> None:
        self.lines.append(self._indent + line)

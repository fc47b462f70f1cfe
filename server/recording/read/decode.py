"""Turns the bytes of recorded ROS messages into rosbridge-shaped dicts, by a function compiled once for each type.

Sources of the formats: ROS 1 serialization (wiki.ros.org/ROS/Technical Overview: little-endian, packed, u32 lengths);
ROS 2: OMG CDR 1.0 (DDSI-RTPS 10: a 4-byte header, then each primitive aligned to its own size, strings end in a NUL).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from server.judge import shapes
from server.judge.message import Json, RosVersion
from server.recording.read.code_writer import PLACEHOLDER, ROS1_TIMES, CodeWriter
from server.recording.read.definitions import demand_few_fields
from server.recording.read.errors import Undecodable
from server.recording.read.source import Channel, Damage, FileSource

Decode = Callable[[bytes], dict[str, Any]]

_MISTAKES = (struct.error, ValueError, OverflowError, MemoryError)


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
        return _compile(type, definitions, _ByteLayout(ros1=True, order="<", start=0), None)
    big: list[Decode] = []  # compiled when first met: hardly any recording has them

    def read_other(raw: bytes) -> dict[str, Any]:
        if raw[:2] != b"\x00\x00":
            raise Undecodable(f"its encoding {raw[:2].hex() or 'nothing'} is not plain CDR")
        if not big:
            big.append(_compile(type, definitions, _ByteLayout(ros1=False, order=">", start=4), None))
        return big[0](raw)

    return _compile(type, definitions, _ByteLayout(ros1=False, order="<", start=4), read_other)


@dataclass(frozen=True, slots=True, kw_only=True)
class _ByteLayout:
    """The byte layout: packed in ROS 1, aligned in CDR."""

    ros1: bool
    order: str  # "<" or ">"
    start: int


def _compile(type: str, definitions: dict[str, Any], layout: _ByteLayout, other: Decode | None) -> Decode:
    """`other` reads what is not little-endian CDR."""
    writer = _DecoderWriter(definitions, layout)
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


class _DecoderWriter(CodeWriter):
    """Writes the source of one decoder."""

    def __init__(self, definitions: dict[str, Any], layout: _ByteLayout) -> None:
        super().__init__(definitions, ros1=layout.ros1)
        self._layout = layout
        self._variables: list[str] = []  # which take the values of the run

    def message(self, type: str, depth: int) -> str:
        """Writes the reading of a message; answers the expression of its dict."""
        if self._ros1 and type in ROS1_TIMES:
            first, second = self._primitive(ROS1_TIMES[type]), self._primitive(ROS1_TIMES[type])
            return f"{{'secs': {first}, 'nsecs': {second}}}"
        pairs = []
        for name, description in self._fields_of(type, depth):
            if name == PLACEHOLDER:
                if not self._ros1:
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
        last = end if self._ros1 else f"{end} - 1 if {length} else pos"  # CDR counts the NUL
        self._write(f"{variable} = str(raw[pos:{last}], 'utf-8', 'replace')")
        self._write(f"pos = {end}")
        self._modulus, self._offset = 1, 0
        return variable

    def _primitives(self, primitive: str, count: str, *, is_fixed: bool) -> str:
        _, dtype, size = self._look_up(primitive)
        self._align_items(size, count, is_fixed=is_fixed)
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

    def _padding(self, size: int) -> str:
        return f"pos += ({4 % size} - pos) % {size}"


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """How the bytes of one channel's messages are to be read.

    `definitions` are those of its type and of all it contains, as rosbags has them.
    """

    ros_version: RosVersion
    definitions: dict[str, Any]


class RawMessage(Mapping[str, Any]):
    """The serialized message in the encoding of its ROS version. Reading fields raises Undecodable."""

    __slots__ = ("_decode", "_fields", "_unreadable", "layout", "raw")

    def __init__(self, raw: bytes, decode: Callable[[bytes], Json], layout: Layout) -> None:
        self.raw = raw
        self.layout = layout
        self._decode = decode
        self._fields: Json | None = None
        self._unreadable: str | None = None  # the reason; decoding is tried once

    @property
    def fields(self) -> Json:
        """The decoded message. Raises Undecodable."""
        if self._unreadable is not None:
            raise Undecodable(self._unreadable)
        if self._fields is None:
            try:
                self._fields = self._decode(self.raw)
            except Undecodable as error:
                self._unreadable = str(error)
                raise
        return self._fields

    def __getitem__(self, name: str) -> Any:
        return self.fields[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.fields)

    def __len__(self) -> int:
        return len(self.fields)


def fields_of(message: Json) -> Json:
    """The message as a dict, whichever kind it is. Raises Undecodable."""
    return message.fields if isinstance(message, RawMessage) else message


def beforehand(
    source: FileSource, ways: Mapping[int, tuple[str, str, Decode]]
) -> Iterator[tuple[float, str, str, Json]]:
    """Time [s since 1970], topic, type and content of the messages of some channels, by number: topic, type, decoder.
    What cannot be read is left out; the reading itself names it."""
    try:
        for time_ns, number, raw in source.messages(set(ways), 0, Damage()):
            topic, type, decode = ways[number]
            with suppress(Undecodable):
                yield time_ns / 1e9, topic, type, decode(raw)
    except MemoryError:
        raise
    except Exception:  # a damaged file makes the readers fail in every way there is
        return


def type_of_first(source: FileSource, channel: Channel, decode: Decode) -> str:
    """The type of a channel by the fields of its first message, as live; "": none is known."""
    for _, topic, _, message in beforehand(source, {channel.number: (channel.topic, "", decode)}):
        found = shapes.type_of(message, topic) or shapes.type_by_fields(message)
        return found if source.ros_version == 1 else found.replace("/", "/msg/")
    return ""

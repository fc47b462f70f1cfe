"""What decoders and encoders of messages have in common: how primitives are packed, and the code for them."""

from __future__ import annotations

from typing import Any

from server.recording.read.errors import Undecodable

# name → (code of struct, numpy dtype without byte order, bytes)
PRIMITIVES = {
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
ROS1_TIMES = {"builtin_interfaces/msg/Time": "uint32", "builtin_interfaces/msg/Duration": "int32"}  # of both fields
PLACEHOLDER = "structure_needs_at_least_one_member"  # how ROS 2 writes a message without fields; no field of anybody's
_DEEPEST = 32  # levels of messages in messages: a definition that contains itself never ends


class CodeWriter:
    """Writes the source of one function: runs of primitives become one struct each, nested messages stand in line.

    Names from definitions go into the source only as quoted strings, so no definition can smuggle in code.
    """

    def __init__(self, definitions: dict[str, Any], *, ros1: bool) -> None:
        self.lines: list[str] = []
        self.constants: dict[str, Any] = {}
        self._definitions = definitions
        self._ros1 = ros1  # packed; else aligned, as CDR is
        self._indent = "  "
        self._names = 0
        self._run: list[str] = []  # struct codes not yet written out
        self._modulus, self._offset = 8, 0  # what is known of the place: place mod _modulus = _offset

    def flush(self) -> None:
        """Writes out the pending run of primitives."""
        raise NotImplementedError

    def _padding(self, size: int) -> str:
        """The statement that passes over what aligns the place to a size."""
        raise NotImplementedError

    def _fields_of(self, type: str, depth: int) -> list[tuple[str, Any]]:
        """Name and description of each field of a message. Raises Undecodable."""
        if depth > _DEEPEST:
            raise Undecodable("its definition contains itself")
        if type not in self._definitions:
            raise Undecodable(f"the definition of {type} is missing")
        fields: list[tuple[str, Any]] = self._definitions[type][1]
        return fields

    def _align(self, size: int) -> None:
        if self._ros1 or size == 1:
            return
        if self._modulus >= size:
            padding = -self._offset % size
            if padding:
                self._run.append(f"{padding}x")
                self._offset += padding
        else:
            self.flush()
            self._write(self._padding(size))
            self._modulus, self._offset = size, 0

    def _align_items(self, size: int, items: str, *, is_fixed: bool) -> None:
        """As `_align`, before the items of an array; the expression `items` is false where there are none."""
        if not self._ros1 and size > self._modulus_now():
            condition = "" if is_fixed else f"if {items}: "  # CDR aligns for the items, and there may be none
            self._write(f"{condition}{self._padding(size)}")

    def _modulus_now(self) -> int:
        """The largest size that this place is known to be aligned to."""
        size = self._modulus
        while self._offset % size:
            size //= 2
        return size

    def _look_up(self, primitive: str) -> tuple[str, str, int]:
        found = PRIMITIVES.get(primitive)
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

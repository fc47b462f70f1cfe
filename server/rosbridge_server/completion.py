"""Checks what a client sends against its type and fills in what was left out, as rosbridge does."""

from __future__ import annotations

import base64
import binascii
import math
from typing import Any

import numpy as np

from server.judge.message import RosVersion
from server.rosbridge_server.fields import Refused
from server.rosbridge_server.shape import (
    DEEPEST,
    DEFAULTS,
    FLOATS,
    HEADER,
    INTEGERS,
    TIMES,
    Field,
    fields,
    items,
    shown,
    stamp,
    time_of,
    zero,
)

_PYTHON = {"bool": ("bool",), "int": tuple(INTEGERS), "float": tuple(FLOATS), "str": ("string",)}


class Unfit(Refused):
    """The message is not of its type, or cannot be packed. The text is the one of rosbridge's log or answer."""


class Completion:
    """Makes messages of one type, whose name is spelled as rosbags does.

    Numeric arrays become numpy, so that CBOR carries them as typed arrays, byte arrays bytes. ROS 1 leaves out times
    with the names of ROS 2, with a sentence in `notes`; ROS 2 takes both spellings.
    """

    def __init__(
        self, type: str, definitions: dict[str, Any], version: RosVersion, now_s: float, *, root: str = ""
    ) -> None:
        self.notes: list[str] = []
        self._type = type
        self._definitions = definitions
        self._version = version
        self._now = stamp(now_s, version)
        self._root = root or shown(type, version)

    def message(self, given: Any) -> dict[str, Any]:
        """The whole message. Raises Unfit."""
        return self._object(self._type, given, ())

    def _object(self, type: str, given: Any, path: tuple[str, ...]) -> dict[str, Any]:
        if type not in self._definitions or len(path) > DEEPEST:
            return given if isinstance(given, dict) else {}
        if not isinstance(given, dict):
            raise self._mismatch(shown(type, self._version), path, given)
        known = {field.name: field for field in fields(type, self._definitions)}
        for name in given:
            if name not in known:
                raise Unfit(f"Message type {self._root} does not have a field {'.'.join((*path, name))}")
        before = self._now if type == HEADER else None
        return {
            name: self._field(field, given[name], (*path, name), before if name == "stamp" else None)
            if name in given
            else before
            if before is not None and name == "stamp"
            else DEFAULTS[self._version].get((type, name), self._zero(field))
            for name, field in known.items()
        }

    def _field(self, field: Field, given: Any, path: tuple[str, ...], before: dict[str, int] | None) -> Any:
        if field.is_bytes and (self._version == 1 or field.array == "fixed" or not field.length):
            return self._bytes(field, given)
        if not field.array:
            return self._item(field, given, path, before)
        if not isinstance(given, list):
            raise self._mismatch(field.shown(self._version) + "[]", path, given)
        if self._version == 2 and field.is_number and field.type != "byte":
            return _array(field, self._numbers(field, given))
        values = [self._item(field.item(), value, path, None) for value in given]
        if field.array == "fixed" and len(values) != field.length:
            raise Unfit(f"{field.length} values, not {len(values)}")
        return _array(field, values) if field.is_number and field.type != "byte" else values

    def _item(self, field: Field, given: Any, path: tuple[str, ...], before: dict[str, int] | None) -> Any:
        if field.type in TIMES:
            return self._time(field, given, path, before)
        if field.is_message:
            return self._object(field.type, given, path)
        expected = field.shown(self._version)
        if self._version == 2:
            if field.text_bound or field.type == "wstring":
                raise self._mismatch(expected, path, given)
            if isinstance(given, int) and field.is_float:
                given = _float(given)
            if field.type == "byte" and isinstance(given, int):
                if not 0 <= given <= 255:
                    raise Unfit("bytes must be in range(0, 256)")
                return given
        kinds = _PYTHON.get(type(given).__name__, ())
        if self._version == 1 and type(given) is int:
            kinds += tuple(FLOATS)
        if field.type not in kinds:
            raise self._mismatch(expected, path, given)
        return self._packed(field, given, is_alone=len(path) == 1)

    def _packed(self, field: Field, given: Any, *, is_alone: bool = False) -> Any:
        if field.type == "string":
            try:
                given.encode()
            except UnicodeEncodeError as error:
                raise Unfit(str(error)) from None
            return given
        if field.is_float:
            value = _float(given)
            if field.type == "float32":
                with np.errstate(over="ignore"):
                    short = float(np.float32(value))
                if self._version == 1 and math.isinf(short) and not math.isinf(value):
                    raise Unfit("float too large to pack with f format")
                return short
            return value
        return given if field.type == "bool" else self._integer(field, given, is_alone=is_alone)

    def _integer(self, field: Field, given: Any, *, is_alone: bool = False) -> int:
        code = np.dtype(INTEGERS[field.type])
        limits = np.iinfo(code)
        if isinstance(given, int) and int(limits.min) <= given <= int(limits.max):
            return int(given)
        if self._version == 1:
            raise Unfit(f"{field.name} does not fit into {field.type}")
        if not isinstance(given, int) or not -(2**63) <= given < (2**64 if code.kind == "u" else 2**63):
            raise Unfit(f"{field.name} does not fit into {field.type}")
        if code.kind == "u" and given < 0:
            if not is_alone:
                raise Unfit("returned a result with an exception set")
            return int(limits.max)
        wrapped = int(given) % (1 << 8 * code.itemsize)
        return wrapped if wrapped <= int(limits.max) else wrapped - (1 << 8 * code.itemsize)

    def _numbers(self, field: Field, given: list[Any]) -> list[Any]:
        """ROS 2 gives number arrays to array.array and numpy, which know no other check."""
        if field.array == "fixed" and len(given) != field.length:
            raise Unfit(f"could not broadcast {len(given)} values into {field.length}")
        if field.length and len(given) > field.length:
            raise Unfit(f"at most {field.length} values")
        if field.is_float:
            if field.array == "fixed":
                given = [math.nan if value is None else value for value in given]
            if not all(isinstance(value, int | float) for value in given):
                raise Unfit("must be real number")
            return [self._packed(field, _float(value)) for value in given]
        limits = np.iinfo(np.dtype(INTEGERS[field.type]))
        if not all(isinstance(value, int) and int(limits.min) <= value <= int(limits.max) for value in given):
            raise Unfit("value out of range")
        return [int(value) for value in given]

    def _bytes(self, field: Field, given: Any) -> bytes:
        if isinstance(given, str):
            try:
                data = base64.b64decode(given)
            except (binascii.Error, ValueError) as error:
                raise Unfit(str(error)) from None
        elif isinstance(given, list):
            if not all(isinstance(value, int) and 0 <= value <= 255 for value in given):
                raise Unfit("ubyte format requires 0 <= number <= 255")
            data = bytes(given)
        else:
            raise Unfit(f"{type(given).__name__} is no bytes")
        if field.array == "fixed" and len(data) != field.length:
            if self._version == 2:
                raise Unfit(f"{field.length} bytes, not {len(data)}")
            data = data.ljust(field.length, b"\0")[: field.length]
        return data

    def _time(self, field: Field, given: Any, path: tuple[str, ...], before: dict[str, int] | None) -> dict[str, int]:
        is_moment = TIMES[field.type] == "time"
        if is_moment and given == "now":
            return dict(self._now)
        names = ("secs", "nsecs") if self._version == 1 else ("sec", "nanosec")
        result: dict[str, Any] = dict(before or dict.fromkeys(names, 0))
        if self._version == 1 and not (isinstance(given, dict) and (not given or given.keys() & set(names))):
            instead = "the time of the bridge" if before else "zero"
            where = ".".join(path)[:80]
            self.notes.append(f"{where} has no secs and nsecs, as times of ROS 1 have: it is {instead}")
        if isinstance(given, dict):
            for name, others in zip(names, (("sec", "secs"), ("nanosec", "nsecs")), strict=True):
                for other in (name,) if self._version == 1 else others:
                    if other in given:
                        result[name] = given[other]
                        break
        elif self._version == 2 and not isinstance(given, list | str):
            raise Unfit(f"argument of type '{type(given).__name__}' is not iterable")
        low, high = (0, 2**32 - 1) if self._version == 1 and is_moment else (-(2**31), 2**31 - 1)
        rest_low, rest_high = (0, 2**32 - 1) if is_moment or self._version == 2 else (low, high)
        for name, lowest, highest in ((names[0], low, high), (names[1], rest_low, rest_high)):
            value = result[name]
            if isinstance(value, bool) or not isinstance(value, int) or not lowest <= value <= highest:
                raise Unfit("argument out of range")
        return result

    def _zero(self, field: Field, within: tuple[str, ...] = ()) -> Any:
        """`within`: the types that hold it; what holds itself is left empty."""
        if field.is_bytes:
            return bytes(field.length if field.array == "fixed" else 0)
        if field.array:
            values = items(field, None)
            if field.is_message:
                return [self._zero(field.item(), within) for _ in values]
            return _array(field, values) if field.is_number and field.type != "byte" else values
        if field.type in TIMES:
            return time_of(None, self._version)
        if field.is_message:
            if field.type not in self._definitions or field.type in within:
                return {}
            return {
                inner.name: DEFAULTS[self._version].get(
                    (field.type, inner.name), self._zero(inner, (*within, field.type))
                )
                for inner in fields(field.type, self._definitions)
            }
        return zero(field.type)

    def _mismatch(self, expected: str, path: tuple[str, ...], given: Any) -> Unfit:
        if expected == self._root:
            return Unfit(f"Expected a JSON object for type {self._root} but received a {type(given)}")
        where = ".".join(path)
        return Unfit(f"{self._root} message requires a {expected} for field {where}, but got a {type(given)}")


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        raise Unfit("int too large to convert to float") from None


def _array(field: Field, values: list[Any]) -> Any:
    with np.errstate(over="ignore"):  # 1e300 is infinite as a float32
        return np.array(values, dtype=FLOATS.get(field.type) or INTEGERS[field.type])

"""A message as the real bridge turns it into JSON and CBOR, field by field, losing what that bridge loses."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from server.judge.message import RosVersion
from server.rosbridge_server.completion import zero
from server.rosbridge_server.real.cbor import Tagged
from server.rosbridge_server.real.shape import FLOATS, INTEGERS, Field, Lost, fields

_TAGS = {
    "uint16": 69, "uint32": 70, "uint64": 71, "byte": 72, "int8": 72,
    "int16": 77, "int32": 78, "int64": 79, "float32": 85, "float64": 86,
}  # fmt: skip


class Values:
    """Writes messages of one version of ROS; `definitions` are those of the message's type."""

    def __init__(self, version: RosVersion, definitions: dict[str, Any]) -> None:
        self._version = version
        self._definitions = definitions

    def json(self, type: str, message: Any) -> dict[str, Any]:
        """The value of `msg`. Raises Lost."""
        given = _object(message)
        return {field.name: self._json_field(field, given.get(field.name)) for field in self._fields(type)}

    def cbor(self, type: str, message: Any) -> dict[str, Any]:
        """The value of `msg`, with Tagged arrays. Raises Lost."""
        given = _object(message)
        return {field.name: self._cbor_field(field, given.get(field.name)) for field in self._fields(type)}

    def _json_field(self, field: Field, value: Any) -> Any:
        if not field.array:
            return self._json_item(field, value)
        if field.is_bytes and (self._version == 1 or field.array == "fixed" or not field.length):
            return base64.b64encode(bytes_of(field, value)).decode("ascii")
        values = items(field, value)
        if self._version == 2 and field.array == "fixed" and field.is_float:
            return [primitive(field, item) for item in values]  # NaN and ±Inf stay, as bare words
        return [self._json_item(field.item(), item, is_item=True) for item in values]

    def _json_item(self, field: Field, value: Any, *, is_item: bool = False) -> Any:
        if field.is_time(self._version):
            return time_of(value, self._version)
        if field.is_message:
            return self.json(field.type, value)
        if self._version == 2 and ((is_item and field.type == "byte") or field.type == "wstring" or field.text_bound):
            raise Lost("'str' object has no attribute 'get_fields_and_field_types'")
        value = primitive(field, value)
        return None if isinstance(value, float) and not math.isfinite(value) else value

    def _cbor_field(self, field: Field, value: Any) -> Any:
        if not field.array:
            return self._cbor_item(field, value)
        unbounded = field.array == "sequence" and not field.length
        if unbounded and field.is_bytes:
            return bytes_of(field, value)
        values = items(field, value)
        if unbounded and field.type == "bool":
            return [bool(item) for item in values]
        if unbounded and field.type == "string" and not field.text_bound and self._version == 2:
            return list(values)
        if unbounded and field.type in _TAGS and not (field.type == "byte" and self._version == 2):
            code = "<" + (FLOATS.get(field.type) or INTEGERS[field.type])
            with np.errstate(over="ignore"):
                return Tagged(_TAGS[field.type], np.array(values, dtype=code).tobytes())
        if field.is_number and self._version == 2 and field.type != "byte":
            raise Lost("'numpy.ndarray' object has no attribute 'get_fields_and_field_types'")
        if field.is_bytes or (values and not field.is_message):
            raise Lost(f"'{_python_name(field)}' object has no attribute '__slots__'")
        return [self._cbor_item(field.item(), item) for item in values]

    def _cbor_item(self, field: Field, value: Any) -> Any:
        if field.is_time(self._version):
            return time_of(value, self._version)
        if field.is_message:
            return self.cbor(field.type, value)
        if self._version == 2 and (field.type in ("byte", "wstring") or field.text_bound):
            raise Lost("'bytes' object has no attribute 'get_fields_and_field_types'")
        return primitive(field, value)

    def _fields(self, type: str) -> tuple[Field, ...]:
        try:
            return fields(type, self._definitions)
        except KeyError:
            raise Lost(f"the type {type} is not known") from None


def primitive(field: Field, value: Any) -> Any:
    """The value as it comes out of a ROS message: zero where it is missing, a float32 with its own precision."""
    if value is None:
        return zero("string" if field.type == "wstring" else field.type)
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


def _python_name(field: Field) -> str:
    return {"string": "str", "bool": "bool"}.get(field.type, "float" if field.is_float else "int")

"""The bytes of a message as ROS sends them between nodes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from server.judge.message import RosVersion
from server.rosbridge_server.shape import FLOATS, INTEGERS, PLACEHOLDER, TIMES, Field, Lost, fields
from server.rosbridge_server.values import bytes_of, items, primitive, time_of


def raw_bytes(type: str, definitions: dict[str, Any], version: RosVersion, message: Any) -> bytes:
    """The message of a type that is spelled as rosbags does. Raises Lost."""
    store = _store(version, tuple(sorted(definitions)), type)
    missing = {name: definition for name, definition in definitions.items() if name not in store.fielddefs}
    try:
        if missing:
            store.register(missing)
        made = _instance(store, type, definitions, version, message)
        data = store.serialize_ros1(made, type) if version == 1 else store.serialize_cdr(made, type)
    except Exception as error:  # the typestore has many ways to refuse
        raise Lost(str(error)) from None
    return bytes(data) if version == 1 else bytes(data) + bytes(-len(data) % 4)  # as DDS sends it


@lru_cache(maxsize=32)
def _store(version: RosVersion, names: tuple[str, ...], type: str) -> Typestore:
    return get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)


def _instance(store: Typestore, type: str, definitions: dict[str, Any], version: RosVersion, message: Any) -> Any:
    given: Mapping[str, Any] = message if isinstance(message, Mapping) else {}
    made = {}
    for field in fields(type, definitions):
        made[field.name] = _value(store, field, definitions, version, given.get(field.name))
    if not made and any(name == PLACEHOLDER for name, _ in definitions[type][1]):
        made[PLACEHOLDER] = 0
    return store.types[type](**made)


def _value(store: Typestore, field: Field, definitions: dict[str, Any], version: RosVersion, value: Any) -> Any:
    if not field.array:
        return _item(store, field, definitions, version, value)
    if field.is_bytes:
        return np.frombuffer(bytes_of(field, value), dtype=np.uint8)
    code = FLOATS.get(field.type) or INTEGERS.get(field.type) or ("?" if field.type == "bool" else None)
    if code is not None and isinstance(value, np.ndarray):
        with np.errstate(over="ignore"):
            return np.asarray(value, dtype=code)
    values = items(field, value)
    if code is not None:
        return np.array(values, dtype=code)
    return [_item(store, field.item(), definitions, version, item) for item in values]


def _item(store: Typestore, field: Field, definitions: dict[str, Any], version: RosVersion, value: Any) -> Any:
    if field.type in TIMES:
        return store.types[field.type](**time_of(value, 2))
    if field.is_message:
        return _instance(store, field.type, definitions, version, value)
    return primitive(field, value)

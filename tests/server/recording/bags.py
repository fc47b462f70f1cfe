"""Makes small recordings of every kind with the writers of others."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.interfaces import (
    Nodetype,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

BEGIN_S = 1_700_000_000
Row = tuple[float, str, str, dict[str, Any]]  # seconds after BEGIN_S, topic, type as rosbags spells it, message


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """What a made recording holds."""

    messages: list[Row]
    definitions: dict[str, str] = field(default_factory=dict)  # types beyond the standard ones, as .msg text
    latched: set[str] = field(default_factory=set)
    compression: Literal["none", "bz2", "lz4", "zstd"] = "none"
    chunk_bytes: int = 1_000_000


def typestore(version: int, definitions: dict[str, str]) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    for type, text in definitions.items():
        store.register(get_types_from_msg(text, type))
    return store


def build(store: Any, type: str, given: dict[str, Any]) -> Any:
    """A message object for rosbags; what is not given is zero."""
    values = {}
    for name, description in store.fielddefs[type][1]:
        values[name] = _value(store, description, given.get(name))
    return store.types[type](**values)


def _value(store: Any, description: Any, given: Any) -> Any:
    kind, what = description
    if kind == Nodetype.NAME:
        return build(store, what, given or {})
    if kind == Nodetype.BASE:
        return given if given is not None else {"string": "", "bool": False}.get(what[0], 0)
    item, length = what
    if item[0] == Nodetype.NAME:
        return [build(store, item[1], one) for one in (given or [{}] * (length if kind == Nodetype.ARRAY else 0))]
    if item[1][0] == "string":
        return list(given or [""] * (length if kind == Nodetype.ARRAY else 0))
    dtype = {"bool": "?", "byte": "i1", "char": "u1"}.get(item[1][0], item[1][0])
    return np.array(given if given is not None else [0] * (length if kind == Nodetype.ARRAY else 0), dtype=dtype)


def write_ros1(path: Path, drive: Drive) -> Path:
    store = typestore(1, drive.definitions)
    writer = Writer1(path)
    if drive.compression != "none":
        writer.set_compression(getattr(Writer1.CompressionFormat, drive.compression.upper()))
    writer.chunk_threshold = drive.chunk_bytes
    with writer:
        connections: dict[str, Any] = {}
        for at_s, topic, type, message in drive.messages:
            if topic not in connections:
                latching = 1 if topic in drive.latched else None
                connections[topic] = writer.add_connection(topic, type, typestore=store, latching=latching)
            raw = store.serialize_ros1(build(store, type, message), type)
            writer.write(connections[topic], _nanoseconds(at_s), raw)
    return path


def write_ros2(path: Path, drive: Drive, *, storage: Literal["mcap", "sqlite3"] = "mcap") -> Path:
    store = typestore(2, drive.definitions)
    writer = Writer2(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if drive.compression != "none":
        mode = CompressionMode.STORAGE if storage == "mcap" else CompressionMode.MESSAGE
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for at_s, topic, type, message in drive.messages:
            if topic not in connections:
                profiles = [_LATCHED] if topic in drive.latched else []
                connections[topic] = writer.add_connection(topic, type, typestore=store, offered_qos_profiles=profiles)
            writer.write(connections[topic], _nanoseconds(at_s), store.serialize_cdr(build(store, type, message), type))
    return path


def _nanoseconds(at_s: float) -> int:
    return BEGIN_S * 10**9 + round(at_s * 1e9)


_FOREVER = QosTime(0, 0)
_LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _FOREVER,
    _FOREVER,
    QosLiveliness.AUTOMATIC,
    _FOREVER,
    False,
)

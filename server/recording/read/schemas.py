"""What a channel of a recording declares of its messages: their ROS definition in full, or that they are JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import orjson
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from server.judge.message import RosVersion
from server.recording.read.definitions import types_of_msg
from server.recording.read.encode import Encode, compile_encoder

MAX_DEFINITION = 256 * 1024  # letters; the longest of the standard ones has 7 000
_SEPARATOR = "=" * 80
_BASIC = {"boolean": "bool", "float": "float32", "double": "float64", "octet": "byte"}  # rosapi of ROS 2 → .msg
_STAMPS = {"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}
_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")  # of noetic, and not among rosbags' types of it
_LOOSE = orjson.dumps({"type": "object", "additionalProperties": True})


@dataclass(frozen=True, slots=True, kw_only=True)
class Schema:
    """One type as a file declares it."""

    name: str  # as the ROS version spells it; of a JSON channel too
    encoding: str  # ros1msg, ros2msg, jsonschema
    data: bytes
    message_encoding: str  # ros1, cdr, json
    encode: Encode | None  # None: JSON


@cache
def standard(version: RosVersion) -> Any:
    """The messages of the distribution; the first time a tenth of a second of work, and never changed afterwards."""
    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    for type in _TRANSFORMS:
        if version == 1 and type not in store.types:
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", type))
    return store


class TypeBook:
    """The types of one car: those of the distribution, and those that its bridge described."""

    def __init__(self, version: RosVersion) -> None:
        self.version: RosVersion = version
        self._store = standard(version)
        self._texts: dict[str, str] = {}  # by type as rosbags spells it
        self._known: dict[str, Schema | None] = {}

    def learn(self, definitions: Mapping[str, str]) -> None:
        """Takes definitions in .msg text, by type in either spelling; those of the bridge count before ours."""
        for type, text in definitions.items():
            if text and len(text) <= MAX_DEFINITION and self._texts.get(long_type(type)) != text:
                self._texts[long_type(type)] = text
                self._known.pop(long_type(type), None)

    def schema(self, type: str | None) -> Schema | None:
        """The schema for messages of a type in ROS encoding; None if its definition is unknown."""
        if not type:
            return None
        long = long_type(type)
        if long not in self._known:
            self._known[long] = self._find(long)
        return self._known[long]

    def loose(self, type: str | None) -> Schema:
        """The same as JSON: for unknown types, and for messages that do not match their type."""
        return Schema(
            name=self._spelled(long_type(type)) if type else "",
            encoding="jsonschema",
            data=_LOOSE,
            message_encoding="json",
            encode=None,
        )

    def _find(self, type: str) -> Schema | None:
        text = self._texts.get(type)
        if text is not None:
            try:
                return self._made(type, *self._completed(text, types_of_msg(text, type)))
            except Exception:  # the parser raises many exception types; the distribution may still know it
                pass
        try:
            text = str(self._store.generate_msgdef(type, ros_version=self.version)[0])
            return self._made(type, text, self._store.fielddefs)
        except Exception:  # as above
            return None

    def _completed(self, text: str, definitions: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        """A definition with those of the standard types that it names and does not bring."""
        stamps = _STAMPS if self.version == 1 else set()  # primitives there: "time stamp"
        while missing := sorted(_named(definitions) - set(definitions) - stamps):
            for type in missing:
                own = str(self._store.generate_msgdef(type, ros_version=self.version)[0]).partition(_SEPARATOR)[0]
                text = f"{text.rstrip()}\n{_SEPARATOR}\nMSG: {type.replace('/msg/', '/')}\n{own}"
                definitions[type] = self._store.fielddefs[type]
        return text, definitions

    def _made(self, type: str, text: str, definitions: dict[str, Any]) -> Schema:
        return Schema(
            name=self._spelled(type),
            encoding=f"ros{self.version}msg",
            data=text.encode(),
            message_encoding="ros1" if self.version == 1 else "cdr",
            encode=compile_encoder(type, definitions, self.version),
        )

    def _spelled(self, type: str) -> str:
        return type.replace("/msg/", "/") if self.version == 1 else type


def text_of_details(details: Any) -> str | None:
    """A definition in full from what rosapi's message_details answers; None where it does not make sense.

    It names the constants but not their types, so those are left out: the fields, and so the bytes, are the same.
    Raises nothing: the bridge may answer whatever it likes.
    """
    typedefs = details.get("typedefs") if isinstance(details, Mapping) else None
    if not isinstance(typedefs, Sequence) or isinstance(typedefs, str) or not typedefs:
        return None
    parts: list[str] = []
    for number, typedef in enumerate(typedefs):
        lines = _lines(typedef)
        if lines is None:
            return None
        if typedef["type"] in ("time", "duration"):  # primitives of ROS 1, which rosapi describes all the same
            continue
        head = [] if number == 0 else [_SEPARATOR, f"MSG: {typedef['type'].replace('/msg/', '/')}"]
        parts.append("\n".join([*head, *lines]))
    return "\n".join(parts) + "\n"


def _lines(typedef: Any) -> list[str] | None:
    if not isinstance(typedef, Mapping) or not isinstance(typedef.get("type"), str):
        return None
    names, types, lengths = typedef.get("fieldnames"), typedef.get("fieldtypes"), typedef.get("fieldarraylen")
    if not isinstance(names, list) or not isinstance(types, list) or not isinstance(lengths, list):
        return None
    if not len(names) == len(types) == len(lengths):
        return None
    if not all(isinstance(text, str) for text in (*names, *types)) or not all(type(n) is int for n in lengths):
        return None
    return [
        f"{_BASIC.get(kind, kind)}{'' if n < 0 else f'[{n or str()}]'} {name}"
        for name, kind, n in zip(names, types, lengths, strict=True)
    ]


def _named(definitions: Mapping[str, Any]) -> set[str]:
    """The types of the fields of some types."""
    found = set()
    for _, fields in definitions.values():
        for _, (kind, what) in fields:
            item = what[0] if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (kind, what)
            if item[0] == Nodetype.NAME:
                found.add(item[1])
    return found


def long_type(type: str) -> str:
    package, _, name = type.partition("/")
    return type if name.startswith("msg/") else f"{package}/msg/{name}"

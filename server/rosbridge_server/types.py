"""The message types of a bridge: the standard ones, and those whose definitions came with the topics."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Protocol

from rosbags.typesys import Stores, TypesysError, get_typestore

from server.judge.message import Json, RosVersion
from server.recording.read.decode import Layout
from server.recording.read.definitions import types_of_msg
from server.rosbridge_server.completion import Completion
from server.rosbridge_server.shape import TIMES, fields

Definitions = dict[str, Any]  # type as rosbags spells it → (constants, fields)


class MessageTypes:
    """Types of noetic or humble, and of the topics' own definitions, which come first."""

    def __init__(self, version: RosVersion) -> None:
        self._version: RosVersion = version
        self._texts: dict[str, str] = {}
        self._parsed: dict[str, Definitions] = {}
        self._described: dict[tuple[str, Layout], bool] = {}

    def load(self) -> None:
        """Gets the standard messages ready: a tenth of a second, the first time in a process."""
        _standard(self._version)

    def learn(self, type: str, definition: str) -> None:
        """Notes a definition in .msg text; it is parsed when it is needed."""
        if self._texts.get(type) != definition:
            self._texts[type] = definition
            self._parsed.pop(type, None)
            self._described.clear()

    def text(self, type: str) -> str:
        """The definition in full, as `gendeps --cat` writes it; empty where it is not known."""
        if type in self._texts:
            return self._texts[type]
        try:
            return str(_standard(self._version).generate_msgdef(_long(type), ros_version=self._version)[0])
        except (TypesysError, KeyError):
            return ""

    def complete(self, type: str, message: Json, now_s: float, notes: list[str] | None = None) -> Json:
        """The message with every field that was left out, header stamps being now. Unknown types pass as they are.

        `notes` receives a sentence for each part that is left out as rosbridge leaves it out. Raises Unfit where a
        field does not exist or has a value of the wrong kind.
        """
        definitions = self.definitions(type)
        if definitions is None:
            return message
        completion = Completion(_long(type), definitions, self._version, now_s)
        made = completion.message(message)
        if notes is not None:
            notes += completion.notes
        return made

    def has_package(self, package: str) -> bool:
        """Is any type of this package known?"""
        names = (*self._texts, *_standard(self._version).fielddefs)
        return any(name.startswith(f"{package}/") for name in names)

    def long_name(self, type: str) -> str:
        """The type as rosbags spells it, in both versions."""
        return _long(type)

    def definitions(self, type: str) -> Definitions | None:
        """The definitions of a type and of all it contains; None where it is not known."""
        long = _long(type)
        for definitions in (self._learnt(type), _standard(self._version).fielddefs):
            if long in definitions:
                return definitions
        return next((found for found in map(self._learnt, list(self._texts)) if long in found), None)

    def describes(self, type: str, layout: Layout) -> bool:
        """Whether recorded bytes of a layout are those of the definition that clients get of this type."""
        key = (type, layout)
        if key not in self._described:
            self._described[key] = layout.ros_version == self._version and _have_same_fields(
                _long(type), layout.definitions, self.definitions(type) or {}
            )
        return self._described[key]

    def _learnt(self, type: str) -> Definitions:
        if type not in self._texts:
            return {}
        if type not in self._parsed:
            try:
                self._parsed[type] = types_of_msg(self._texts[type], _long(type))
            except Exception:  # the parser raises many exception types; the standard messages may still know it
                self._parsed[type] = {}
        return self._parsed[type]


def _have_same_fields(type: str, one: Definitions, other: Definitions) -> bool:
    """Whether a type and all it contains have the same fields in both; constants are not in the bytes."""
    names, seen = [type], set(TIMES)
    while names:
        name = names.pop()
        if name in seen:
            continue
        seen.add(name)
        if name not in one or name not in other or one[name][1] != other[name][1]:
            return False
        names += [field.type for field in fields(name, one) if field.is_message]
    return True


class RosContext(Protocol):
    """The version of ROS, its time and its message types."""

    ros_version: RosVersion
    now: Callable[[], float]
    types: MessageTypes


@cache
def _standard(version: RosVersion) -> Any:
    return get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)


def _long(type: str) -> str:
    package, _, name = type.partition("/")
    return type if name.startswith("msg/") else f"{package}/msg/{name}"

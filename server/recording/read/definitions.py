"""Message definitions of a recording: its own where it has them, else those of its ROS distribution; within bounds.

How much a definition from outside holds is found out before it is parsed and before code is made of it: a short one
could take half a minute of a processor.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from server.judge.message import RosVersion
from server.recording.read.errors import Undecodable
from server.recording.read.source import Channel

MAX_LINES = 3000  # that are neither blank nor comments; the longest of real cars have some hundreds
MAX_LINE = 4096  # letters
MAX_FIELDS = 10_000  # with those of all messages in it, as often as they stand in it
MAX_LETTERS = 256 * 1024

_IDL_SEPARATOR = "=" * 80 + "\n"
_CONSTANT = re.compile(r"\s*\S+\s+\w+\s*=")  # begins the line of one
_PARSED_CONSTANT = re.compile(r"\s*\S+\s+[A-Z][A-Z0-9_]*\s*=\s*\S")  # … that the parser takes as one


def bounded(text: str) -> str:
    """The definition without blank lines and lines of comment. Raises Undecodable where it holds too much."""
    if len(text) > 4 * MAX_LETTERS:
        raise Undecodable("its definition is too long")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) > MAX_LINES or any(len(line) > MAX_LINE for line in lines) or sum(map(len, lines)) > MAX_LETTERS:
        raise Undecodable("its definition is too long")
    return "\n".join(lines) + "\n"


def types_of_msg(text: str, type: str) -> dict[str, Any]:
    """Definitions by type, as rosbags has them, of a text in .msg form. Raises Undecodable, and what its parser raises.

    Constants that ROS 1 allows are refused by the parser, such as `int8 kLeft=1` and `string NONE=`, or taken for a
    field, such as `int8 kLeft = 1`. None is in the bytes: those are left out, and all where it refuses one of the rest.
    """
    lines = [line for line in bounded(text).splitlines() if not _CONSTANT.match(line) or _PARSED_CONSTANT.match(line)]
    try:
        return dict(get_types_from_msg("\n".join(lines) + "\n", type))
    except Exception:  # the parser raises many exception types
        fields = [line for line in lines if not _CONSTANT.match(line)]
        return dict(get_types_from_msg("\n".join(fields) + "\n", type))


def demand_few_fields(type: str, definitions: Mapping[str, Any]) -> None:
    """Raises Undecodable for a type whose messages, written out, have too many fields."""
    known: dict[str, int] = {}

    def count(name: str, depth: int) -> int:
        if name not in known:
            known[name] = 1  # recursion is reported by the code generator
            fields = definitions[name][1] if name in definitions and depth < 100 else ()
            known[name] = 1 + sum(count(inner, depth + 1) if (inner := _inner(what)) else 1 for _, what in fields)
        return known[name]

    if count(type, 0) > MAX_FIELDS:
        raise Undecodable("its definition has too many fields")


def _inner(what: Any) -> str | None:
    """The type of a field's messages; None: it has none."""
    kind, value = what
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        kind, value = value[0]
    return str(value) if kind == Nodetype.NAME else None


def definition_of(channel: Channel) -> str | None:
    """In .msg or .idl text; a channel of JSON has none, even where a ROS type is named."""
    return channel.definition or None if channel.encoding != "json" else None


def definitions_of(channel: Channel, version: RosVersion, distro: str | None) -> dict[str, Any]:
    """Field definitions by type, as rosbags has them, of a channel's type and all it contains. Raises Undecodable."""
    if channel.format == "none":
        return distribution(version, distro)
    try:
        if channel.format == "msg":
            return types_of_msg(channel.definition, channel.type)
        found: dict[str, Any] = {}
        if len(channel.definition) > MAX_LETTERS:
            raise Undecodable("its definition is too long")
        for part in channel.definition.split(_IDL_SEPARATOR):
            text = part.split("\n", 1)[-1] if part.startswith("IDL: ") else part
            if text.strip():
                found.update(get_types_from_idl(text))
    except Undecodable:
        raise
    except Exception:  # the parsers raise many exception types
        raise Undecodable(f"the definition of {channel.type} cannot be understood") from None
    return found


def distribution(version: RosVersion, distro: str | None) -> dict[str, Any]:
    """The standard messages of a ROS distribution: noetic, or the ROS 2 one named, or humble."""
    names = (
        {"noetic": Stores.ROS1_NOETIC} if version == 1 else {s.name[5:].lower(): s for s in Stores if "ROS2" in s.name}
    )
    usual = "noetic" if version == 1 else "humble"
    store = names.get((distro or usual).lower(), names[usual])
    return dict(get_typestore(store).fielddefs)


def times() -> dict[str, Any]:
    """Definitions in ROS 2 may leave out what every recording contains."""
    every = distribution(2, None)
    return {name: every[name] for name in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")}

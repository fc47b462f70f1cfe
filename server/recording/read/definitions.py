"""Message definitions of a recording: its own where it has them, else those of its ROS distribution."""

from __future__ import annotations

from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from server.judge.message import RosVersion
from server.recording.read.definition_bounds import MAX_LETTERS, bounded
from server.recording.read.errors import Undecodable
from server.recording.read.source import Channel

_IDL_SEPARATOR = "=" * 80 + "\n"


def definition_of(channel: Channel) -> str | None:
    """In .msg or .idl text; a channel of JSON has none, even where a ROS type is named."""
    return channel.definition or None if channel.encoding != "json" else None


def definitions_of(channel: Channel, version: RosVersion, distro: str | None) -> dict[str, Any]:
    """Field definitions by type, as rosbags has them, of a channel's type and all it contains. Raises Undecodable."""
    if channel.format == "none":
        return distribution(version, distro)
    try:
        if channel.format == "msg":
            return dict(get_types_from_msg(bounded(channel.definition), channel.type))
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

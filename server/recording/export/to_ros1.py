"""How recorded messages of any encoding become those of a ROS 1 bag: as they are, or from ROS 2's CDR.

A type that ROS 1 has too takes ROS 1's definition, so that its md5sum is the one every ROS 1 node knows; any other
takes that of the recording, with the types in it as ROS 1 has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from rosbags.convert.converter import is_same_wireformat, migrate_bytes
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from server.recording.export.ros1_definition import md5sum
from server.recording.read.definition_bounds import bounded
from server.recording.read.definitions import definitions_of, times
from server.recording.read.errors import Undecodable
from server.recording.read.source import Channel, FileSource, why_not_decoded

_PLACEHOLDER = "structure_needs_at_least_one_member"  # how ROS 2 writes a message without fields
_WITHOUT_COUNTERPART = ("wstring", "float128")
_LITTLE = b"\x00\x01"


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros1Form:
    """What a channel is in a ROS 1 bag."""

    type: str  # "pkg/Type"
    definition: str  # whole, with what it contains
    md5sum: str
    convert: Callable[[bytes], bytes | memoryview]  # raises Undecodable
    lost: tuple[str, ...] = ()  # fields that ROS 1's type of that name does not have, as "pkg/Type.field"


def ros1_form(channel: Channel, source: FileSource) -> Ros1Form:
    """Raises Undecodable with the reason why there is none."""
    match channel.encoding:
        case "ros1":
            return _as_it_is(channel)
        case "cdr":
            return _from_cdr(channel, source)
        case "json":
            raise Undecodable(
                "it was recorded as JSON: its type's definition was unknown, or it did not match its type"
            )
        case other:
            raise Undecodable(why_not_decoded(other))


def _as_it_is(channel: Channel) -> Ros1Form:
    type, noetic = channel.type.replace("/msg/", "/", 1), _noetic()
    definition = channel.definition
    if channel.format != "msg" or not definition.strip():
        if channel.type not in noetic.fielddefs:
            raise Undecodable(f"the definition of {type} is missing")
        definition = str(noetic.generate_msgdef(channel.type)[0])
    elif _is_from_bridge(channel):
        definition = str(noetic.generate_msgdef(channel.type)[0])
    return Ros1Form(type=type, definition=definition, md5sum=md5sum(type, definition), convert=_same)


def _is_from_bridge(channel: Channel) -> bool:
    """Whether a standard type has no constants: a bridge does not send them, and the md5sum needs them."""
    if channel.type not in _noetic().fielddefs or "=" in channel.definition.replace("=" * 80, ""):
        return False
    try:
        types = _store(dict(get_types_from_msg(bounded(channel.definition), channel.type)))
        return bool(is_same_wireformat(types, _noetic(), channel.type, channel.type)) and _names(
            types, channel.type
        ) == (_names(_noetic(), channel.type))
    except Exception:  # the parser raises many exception types: then it stays as it is
        return False


def _names(store: Typestore, type: str) -> list[str]:
    return [name for name, _ in store.fielddefs[type][1]]


def _from_cdr(channel: Channel, source: FileSource) -> Ros1Form:
    type = channel.type
    here = _store({**times(), **definitions_of(channel, 2, source.distro)})
    if type not in here.fielddefs:
        raise Undecodable(f"the definition of {type} is missing")
    try:
        there = _ros1_store(type, here)
        definition, sum = there.generate_msgdef(type)
        is_same = is_same_wireformat(here, there, type, type)
        here.get_msgdef(type), there.get_msgdef(type)  # compiles what is needed, or raises
    except Undecodable:
        raise
    except Exception:  # the generators fail in every way there is on what they do not know
        raise Undecodable(f"{type} cannot be written as ROS 1 message") from None
    return Ros1Form(
        type=type.replace("/msg/", "/", 1),
        definition=definition,
        md5sum=sum,
        convert=_converter(type, here, there, is_same=is_same),
        lost=tuple(_lost(type, here, there)),
    )


def _converter(type: str, here: Typestore, there: Typestore, *, is_same: bool) -> Callable[[bytes], bytes | memoryview]:
    cache: dict[str, object] = {}

    def convert(raw: bytes) -> bytes | memoryview:
        try:
            if is_same and raw[:2] == _LITTLE:
                return here.cdr_to_ros1(raw, type)
            return migrate_bytes(here, there, type, type, cache, raw, src_is2=True, dst_is2=False)
        except (SerdeError, ValueError, IndexError, AssertionError, OverflowError, MemoryError):
            raise Undecodable(f"its {len(raw)} bytes do not fit its type") from None

    return convert


def _ros1_store(type: str, here: Typestore) -> Typestore:
    """The definitions of a type and all in it as ROS 1 has them; where ROS 1 has none, as they are here."""
    noetic = _noetic()
    found: dict[str, Any] = {}
    waiting = [type]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        definition = noetic.fielddefs.get(name) or here.fielddefs.get(name)
        if definition is None:
            raise Undecodable(f"the definition of {name} is missing")
        found[name] = definition
        for _, description in definition[1]:
            kind, what = _item(description)
            if kind == Nodetype.NAME:
                waiting.append(what)
            elif what[0] in _WITHOUT_COUNTERPART:
                raise Undecodable(f"{name} has a {what[0]}, which ROS 1 does not have")
    return _store(found)


def _lost(type: str, here: Typestore, there: Typestore) -> Iterator[str]:
    """Fields of the recording for which ROS 1's type has no place."""
    seen: set[str] = set()
    waiting = [type]
    while waiting:
        name = waiting.pop()
        if name in seen or name not in here.fielddefs or name not in there.fielddefs:
            continue
        seen.add(name)
        places = {field.lower() for field, _ in there.fielddefs[name][1]}
        for field, description in here.fielddefs[name][1]:
            if field.lower() not in places and field != _PLACEHOLDER:
                yield f"{name.replace('/msg/', '/')}.{field}"
            kind, what = _item(description)
            if kind == Nodetype.NAME:
                waiting.append(what)


def _item(description: Any) -> tuple[Any, Any]:
    """What a field is, or what is in its array."""
    kind, what = description
    found: tuple[Any, Any] = what[0] if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else description
    return found


def _store(definitions: dict[str, Any]) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    store.register(definitions)
    return store


@cache
def _noetic() -> Typestore:
    return get_typestore(Stores.ROS1_NOETIC)


def _same(raw: bytes) -> bytes:
    return raw

"""How recorded messages of any encoding become those of a ROS 1 bag: as they are, or from ROS 2's CDR.

A type that ROS 1 has too takes ROS 1's definition, so that its md5sum is the one that every ROS 1 node has; any other
takes that of the recording, with the types in it as ROS 1 has them.

The md5sum of a type is computed from its definition as genmsg does. Sources: genmsg's gentools (the text that is
hashed: constants first, as written; then fields, nested types by their own sum) and the form of full definitions,
"gendeps --cat" (each nested type behind a line of = and one of `MSG: pkg/Type`).
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from rosbags.convert.converter import is_same_wireformat, migrate_bytes
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from server.recording.read.code_writer import PRIMITIVES
from server.recording.read.definitions import MAX_FIELDS, definitions_of, times, types_of_msg
from server.recording.read.errors import Undecodable
from server.recording.read.source import Channel, FileSource, why_not_decoded

_BUILTIN = frozenset(
    "bool byte char float32 float64 string time duration int8 int16 int32 int64 uint8 uint16 uint32 uint64".split()
)
_HEADER = "std_msgs/Header"
_DEEPEST = 32

_PLACEHOLDER = "structure_needs_at_least_one_member"  # how ROS 2 writes a message without fields
_WITHOUT_COUNTERPART = ("wstring", "float128")
_LITTLE, _BIG = b"\x00\x01", b"\x00\x00"
_HEAD_BYTES = 4  # of CDR
_LENGTH_BYTES = 4  # of a string or a sequence; both may be empty


def md5sum(type: str, definition: str) -> str:
    """The md5sum of a ROS 1 message type, computed from its definition as genmsg does.

    Of "pkg/Type" with its full definition. Raises Undecodable where a nested type's definition is missing.
    """
    texts = _parts(type, definition)
    return _sum_of(type, texts, {}, 0)


def _parts(type: str, definition: str) -> dict[str, str]:
    """Type → its own text."""
    texts: dict[str, str] = {}
    name, lines = type, list[str]()
    for line in definition.splitlines():
        if line.startswith("=====") and not line.strip("= \t"):
            texts.setdefault(name, "\n".join(lines))
            name, lines = "", []
        elif not name and line.startswith("MSG:"):
            name = line[4:].strip()
        else:
            lines.append(line)
    texts.setdefault(name, "\n".join(lines))
    return texts


def _sum_of(type: str, texts: Mapping[str, str], known: dict[str, str], depth: int) -> str:
    found = known.get(type)
    if found is not None:
        return found
    if depth > _DEEPEST:
        raise Undecodable(f"the definition of {type} contains itself")
    if type not in texts:
        raise Undecodable(f"the definition of {type} is missing")
    constants: list[str] = []
    fields: list[str] = []
    for line in texts[type].splitlines():
        kind, _, rest = line.split("#", 1)[0].strip().partition(" ")
        rest = rest.strip()
        if not kind or not rest:
            continue
        if "=" in rest:
            constants.append(_constant(kind, line if kind == "string" else rest))
            continue
        base = kind.partition("[")[0]
        if base in _BUILTIN:
            fields.append(f"{kind} {rest}")
        else:
            fields.append(f"{_sum_of(_full(base, type, texts), texts, known, depth + 1)} {rest}")
    known[type] = hashlib.md5("\n".join((*constants, *fields)).strip().encode(), usedforsecurity=False).hexdigest()
    return known[type]


def _constant(kind: str, text: str) -> str:
    """A string constant is all that follows the sign, a # included."""
    name, _, value = text.partition("=")
    return f"{kind} {name.strip().removeprefix(f'{kind} ').strip()}={value.strip()}"


def _full(base: str, inside: str, texts: Mapping[str, str]) -> str:
    """The full name of a nested type in a field."""
    if "/" in base:
        return base
    if base == "Header":
        return _HEADER
    beside = f"{inside.partition('/')[0]}/{base}"
    if beside in texts:
        return beside
    return next((name for name in texts if name.endswith(f"/{base}")), beside)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros1Form:
    """What a channel is in a ROS 1 bag."""

    type: str  # "pkg/Type"
    definition: str  # whole, with what it contains
    md5sum: str
    convert: Callable[[bytes], bytes | memoryview]  # raises Undecodable
    body: Callable[[bytes], bytes]  # without the bytes behind the last field; raises Undecodable
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
    return Ros1Form(type=type, definition=definition, md5sum=md5sum(type, definition), convert=_same, body=_same)


def _is_from_bridge(channel: Channel) -> bool:
    """Whether a standard type has no constants: a bridge does not send them, and the md5sum needs them."""
    if channel.type not in _noetic().fielddefs or "=" in channel.definition.replace("=" * 80, ""):
        return False
    try:
        types = _store(types_of_msg(channel.definition, channel.type))
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
        least = _least_bytes(type, here, {}, 0)
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
        convert=_converter(type, here, there, is_same=is_same, least=least),
        body=_body_of(type, here, least),
        lost=tuple(_lost(type, here, there)),
    )


def _converter(
    type: str, here: Typestore, there: Typestore, *, is_same: bool, least: int
) -> Callable[[bytes], bytes | memoryview]:
    cache: dict[str, object] = {}

    def convert(raw: bytes) -> bytes | memoryview:
        try:
            if len(raw) < least:  # rosbags would count through a fixed array of any length
                raise ValueError
            if is_same and raw[:2] == _LITTLE:
                return here.cdr_to_ros1(raw, type)
            return migrate_bytes(here, there, type, type, cache, raw, src_is2=True, dst_is2=False)
        except (SerdeError, ValueError, IndexError, AssertionError, OverflowError, MemoryError):
            raise Undecodable(f"its {len(raw)} bytes do not fit its type") from None

    return convert


def _body_of(type: str, here: Typestore, least: int) -> Callable[[bytes], bytes]:
    definition = here.get_msgdef(type)

    def body(raw: bytes) -> bytes:
        try:
            if len(raw) < least or raw[:2] not in (_LITTLE, _BIG):
                raise ValueError
            read = definition.deserialize_cdr_le if raw[:2] == _LITTLE else definition.deserialize_cdr_be
            _, end = read(memoryview(raw)[_HEAD_BYTES:], 0, definition.cls, here)
        except (struct.error, ValueError, IndexError, AssertionError, OverflowError, MemoryError):
            raise Undecodable(f"its {len(raw)} bytes do not fit its type") from None
        return raw[: _HEAD_BYTES + end]

    return body


def _least_bytes(type: str, store: Typestore, known: dict[str, int], depth: int) -> int:
    """What a message of a type takes at least, without padding. Raises Undecodable for one that contains itself."""
    if depth > _DEEPEST:
        raise Undecodable(f"the definition of {type} contains itself")

    def of(description: Any) -> int:
        kind, what = description
        if kind == Nodetype.NAME:
            return _least_bytes(what, store, known, depth + 1)
        if kind == Nodetype.ARRAY:
            if what[1] > MAX_FIELDS and not (what[0][0] == Nodetype.BASE and what[0][1][0] in PRIMITIVES):
                raise Undecodable("its definition has too many fields")  # rosbags compiles code for each of them
            return int(what[1]) * of(what[0])
        return PRIMITIVES[what[0]][2] if kind == Nodetype.BASE and what[0] in PRIMITIVES else _LENGTH_BYTES

    if type not in known:
        known[type] = sum(of(description) for _, description in store.fielddefs[type][1])
    return known[type]


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

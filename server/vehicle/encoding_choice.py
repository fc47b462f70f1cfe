"""Which message types a real bridge can send as CBOR: the others would be subscribed to and never arrive.

Read in rosbridge_suite and tried on real servers. A bridge walks through the fields of a message; where it meets a
value it has no rule for, it logs an exception and sends nothing, for every message of that topic. ROS 1: arrays of
fixed length, of strings, and on older servers of bool. ROS 2: those, arrays with an upper bound, `byte`, `wstring` and
bounded strings. Fit are scalars, times, dynamic arrays of numbers, and messages of such fields, arrays of them too.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from server.judge.message import RosVersion
from server.recording.read.definition_bounds import bounded, demand_few_fields
from server.recording.read.schemas import long_type, standard

_DEEPEST = 32
_INTEGERS = frozenset(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_FLOATS = frozenset({"float32", "float64"})
_ITEMS: Mapping[RosVersion, frozenset[str]] = {
    1: _INTEGERS | _FLOATS | {"char", "byte"},
    2: _INTEGERS | _FLOATS | {"char"},
}
_SCALARS: Mapping[RosVersion, frozenset[str]] = {
    1: (_ITEMS[1] | {"bool", "string"}) - {"uint64"},  # from 2^63 on a number without an upper bound, by its own tag
    2: _ITEMS[2] | {"bool", "string"},
}
_TIMES = frozenset({"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})

Definitions = Mapping[str, Any]  # type as rosbags spells it → (constants, fields)


def fit_for_cbor(types: Collection[str], texts: Mapping[str, str], version: RosVersion | None) -> set[str]:
    """Of `types`, as the bridge spells them, those that arrive as CBOR. It parses texts: not for the event loop.

    `texts`: the bridge's definitions by type; where it has none, those of the distribution count. A type nobody knows
    is not fit; without a version it must fit both.
    """
    versions: tuple[RosVersion, ...] = (version,) if version is not None else (1, 2)
    return {type for type in types if all(_is_fit(type, texts.get(type), each) for each in versions)}


def _is_fit(type: str, text: str | None, version: RosVersion) -> bool:
    known: dict[str, Any] = dict(standard(version).fielddefs)
    if text is not None:
        try:
            known |= get_types_from_msg(bounded(text), long_type(type))
            demand_few_fields(long_type(type), known)
        except Exception:  # the parser raises many exception types
            return False
    return _is_message_fit(long_type(type), known, version, 0)


def _is_message_fit(type: str, known: Definitions, version: RosVersion, depth: int) -> bool:
    if type in _TIMES:
        return True
    if depth > _DEEPEST or type not in known:
        return False
    return all(_is_field_fit(kind, what, known, version, depth) for _, (kind, what) in known[type][1])


def _is_field_fit(kind: Any, what: Any, known: Definitions, version: RosVersion, depth: int) -> bool:
    if kind == Nodetype.NAME:
        return _is_message_fit(what, known, version, depth + 1)
    if kind == Nodetype.BASE:
        name, bound = what
        return bound == 0 and name in _SCALARS[version]
    item, bound = what
    if kind != Nodetype.SEQUENCE or bound:
        return False
    if item[0] == Nodetype.NAME:
        return _is_message_fit(item[1], known, version, depth + 1)
    return item[1][0] in _ITEMS[version]

"""Learns from rosapi how the types of a car are defined, for recordings, and which of them can be sent as CBOR.

A type that cannot would be subscribed to and never arrive. Read in rosbridge_suite and tried on real servers: a bridge
walks through the fields of a message. Where it meets a value it has no rule for, it logs an exception and sends
nothing, for every message of that topic. ROS 1: arrays of fixed length, of strings, and on older servers of bool.
ROS 2: those, arrays with an upper bound, `byte`, `wstring` and bounded strings. Fit are scalars, times, dynamic arrays
of numbers, and messages of such fields, arrays of them too.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection, Mapping
from typing import Any

from rosbags.interfaces import Nodetype

from server.judge.message import RosVersion
from server.recording.read.definitions import demand_few_fields, types_of_msg
from server.recording.read.schemas import long_type, standard
from server.rosbridge.live_source import CallFailed, LinkDown
from server.rosbridge.rosapi_client import ServiceCaller
from server.vehicle import discovery

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

log = logging.getLogger("catgraph.subscriptions")

LEARN_TRIES = 3  # of rosapi's call for all definitions, which may take it long


def fit_for_cbor(types: Collection[str], texts: Mapping[str, str], version: RosVersion | None) -> set[str]:
    """Of `types`, as the bridge spells them, those that arrive as CBOR. It parses texts: not for the event loop.

    `texts`: the bridge's definitions by type; where it has none, those of the distribution count. A type without
    a definition is not fit; without a version it must fit both.
    """
    versions: tuple[RosVersion, ...] = (version,) if version is not None else (1, 2)
    return {type for type in types if all(_is_fit(type, texts.get(type), each) for each in versions)}


def _is_fit(type: str, text: str | None, version: RosVersion) -> bool:
    known: dict[str, Any] = dict(standard(version).fielddefs)
    if text is not None:
        try:
            known |= types_of_msg(text, long_type(type))
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


class TypeDefinitions:
    """Of one car. Learning runs beside everything else: it may take long, and proves nothing.

    `learned(definitions)` is called with type → definition as they come, `changed()` after each answer.
    """

    def __init__(self, learned: Callable[[Mapping[str, str]], None], changed: Callable[[], None]) -> None:
        self._learned = learned
        self._changed = changed
        self._unanswered: set[str] = set()  # fetched without an answer of rosapi
        self._tries = 0
        self._task: asyncio.Task[None] | None = None
        self._ended = False
        self.requested: set[str] = set()  # types whose definitions were requested
        self.fit: set[str] = set()  # of those, the ones that arrive as CBOR
        self.may_be_large: set[str] = set()  # types that have arrays without a bound

    def learn(self, rosapi: ServiceCaller, topics: Mapping[str, str], ros_version: int | None) -> None:
        """Start to fetch unknown type definitions of these topics; does nothing while a fetch runs."""
        if self._task is None:
            self._task = asyncio.create_task(self._ask(rosapi, topics, ros_version), name="definitions")
            self._task.add_done_callback(self._done)

    def end(self) -> None:
        """What is still answered is of no interest any more."""
        self._ended = True
        if self._task is not None:
            self._task.cancel()

    async def _ask(self, rosapi: ServiceCaller, topics: Mapping[str, str], ros_version: int | None) -> None:
        """Definitions come first: what is recorded before they are known is JSON."""
        types = {kind for kind in topics.values() if kind} - self.requested
        if self._tries < LEARN_TRIES:
            types |= self._unanswered
        if not types:
            return
        ros: RosVersion | None = 1 if ros_version == 1 else 2 if ros_version == 2 else None
        found: dict[str, str] = {}
        try:
            found = await discovery.fetch_definitions(rosapi, types, ros)
        except LinkDown:
            return
        except CallFailed as why:
            self._tries += 1
            self._unanswered |= types  # recorded with what is known, and fetched again
            log.warning("type definitions missing: count=%d types=%s", len(types), why)
        else:
            self._tries = 0
            self._unanswered.clear()
        fit = await asyncio.to_thread(fit_for_cbor, types, found, ros)
        if not self._ended:
            self.requested |= types
            self.fit |= fit
            self.may_be_large |= {kind for kind in types if kind not in found or "[]" in found[kind]}
            if found:
                self._learned(found)
            self._changed()

    def _done(self, task: asyncio.Task[None]) -> None:
        self._task = None
        if not task.cancelled() and task.exception() is not None:
            log.error("type definitions not learned", exc_info=task.exception())

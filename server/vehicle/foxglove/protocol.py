"""Foxglove's WebSocket protocol, as far as it is used here: reads what a server sends, and writes what it is sent.

Source: docs/spec.md of foxglove/ws-protocol, and the servers of foxglove-sdk 0.30. Pure.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import orjson

from server.rosbridge.outgoing import MAX_NAME
from server.system.clean_text import short_text

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")  # both have the same frames, as far as they are used here
MAX_CHANNELS = 5000  # of one advertisement
MAX_SCHEMA = 1024 * 1024  # letters
MAX_NODES = 5000  # rows of a connection graph
STATUS_LEVELS = ("info", "warning", "error")

_MESSAGE, _TIME = 1, 2
_HEAD = struct.Struct("<BIQ")  # of a message: 1, id of the subscription, the server's time [ns]
_CLIENT_HEAD = struct.Struct("<BI")  # of a message to the server: 1, id of our channel
_UINT32 = 2**32


class BadFrame(ValueError):
    """A frame that is not of the protocol; `str()` has the reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """What a server offers under one number."""

    id: int
    topic: str
    encoding: str  # of its messages: cdr, ros1, json, …
    type: str  # its schema's name
    schema: str
    schema_encoding: str  # ros2msg, ros2idl, ros1msg, jsonschema, …; "" if not given


class ServerInfo(NamedTuple):
    name: str
    capabilities: frozenset[str]
    encodings: tuple[str, ...]  # in which the server takes messages
    session: str


class Status(NamedTuple):
    level: str
    text: str


class Advertise(NamedTuple):
    channels: tuple[Channel, ...]
    invalid: int  # rows that could not be read
    too_many: int  # rows beyond MAX_CHANNELS, which were not looked at


class Unadvertise(NamedTuple):
    ids: tuple[int, ...]


class GraphUpdate(NamedTuple):
    """Topic → nodes of what changed, and what is gone."""

    publishers: Mapping[str, tuple[str, ...]]
    subscribers: Mapping[str, tuple[str, ...]]
    removed: tuple[str, ...]


class MessageData(NamedTuple):
    subscription: int
    sent_ns: int  # when the server took it, on its own clock
    payload: bytes


class Other(NamedTuple):
    """An operation that needs nothing to be done."""

    name: str


Received = ServerInfo | Status | Advertise | Unadvertise | GraphUpdate | MessageData | Other


def read(payload: bytes, is_binary: bool) -> Received:
    """What a frame holds. Raises BadFrame."""
    return _read_binary(payload) if is_binary else _read_text(payload)


def subscription_of(head: bytes) -> int | None:
    """The subscription that a message belongs to, from the first bytes of its frame; None: it is none."""
    return _HEAD.unpack_from(head)[1] if len(head) >= _HEAD.size and head[0] == _MESSAGE else None


def _read_binary(payload: bytes) -> MessageData | Other:
    if not payload:
        raise BadFrame("an empty binary frame")
    if payload[0] != _MESSAGE:
        return Other(f"binary {payload[0]}")
    if len(payload) < _HEAD.size:
        raise BadFrame("a binary frame that is too short")
    _, subscription, sent_ns = _HEAD.unpack_from(payload)
    return MessageData(subscription, sent_ns, payload[_HEAD.size :])


def _read_text(payload: bytes) -> Received:
    try:
        operation = orjson.loads(payload)
    except orjson.JSONDecodeError:
        raise BadFrame("text that is not JSON") from None
    if not isinstance(operation, dict) or not isinstance(operation.get("op"), str):
        raise BadFrame("text that is not an operation")
    reader = _READERS.get(operation["op"])
    return Other(short_text(operation["op"], 40)) if reader is None else reader(operation)


def _server_info(operation: Mapping[str, Any]) -> ServerInfo:
    name = operation.get("name")
    return ServerInfo(
        name=short_text(name, 60) if isinstance(name, str) else "",
        capabilities=frozenset(_texts(operation.get("capabilities"))),
        encodings=_texts(operation.get("supportedEncodings")),
        session=str(operation.get("sessionId") or "")[:200],
    )


def _status(operation: Mapping[str, Any]) -> Status:
    level: Any = operation.get("level")
    is_known = type(level) is int and 0 <= level < len(STATUS_LEVELS)
    return Status(STATUS_LEVELS[level] if is_known else "info", short_text(operation.get("message"), 500))


def _advertise(operation: Mapping[str, Any]) -> Advertise:
    rows = operation.get("channels")
    if not isinstance(rows, list):
        raise BadFrame("an advertisement without channels")
    found = [_channel(row) for row in rows[:MAX_CHANNELS]]
    channels = tuple(one for one in found if one is not None)
    return Advertise(channels, len(found) - len(channels), len(rows) - len(found))


def _channel(row: Any) -> Channel | None:
    if not isinstance(row, dict) or not _is_id(row.get("id")):
        return None
    texts: list[Any] = [row.get(name) for name in ("topic", "encoding", "schemaName")]
    schema, schema_encoding = row.get("schema") or "", row.get("schemaEncoding") or ""
    if not all(isinstance(text, str) and len(text) <= MAX_NAME for text in (*texts, schema_encoding)):
        return None
    if not texts[0] or not isinstance(schema, str) or len(schema) > MAX_SCHEMA:
        return None
    return Channel(
        id=row["id"], topic=texts[0], encoding=texts[1], type=texts[2], schema=schema, schema_encoding=schema_encoding
    )


def _unadvertise(operation: Mapping[str, Any]) -> Unadvertise:
    ids = operation.get("channelIds")
    if not isinstance(ids, list):
        raise BadFrame("the end of an advertisement without channels")
    return Unadvertise(tuple(one for one in ids if _is_id(one)))


def _graph_update(operation: Mapping[str, Any]) -> GraphUpdate:
    return GraphUpdate(
        publishers=_nodes(operation.get("publishedTopics"), "publisherIds"),
        subscribers=_nodes(operation.get("subscribedTopics"), "subscriberIds"),
        removed=_texts(operation.get("removedTopics")),
    )


def _nodes(rows: Any, key: str) -> dict[str, tuple[str, ...]]:
    rows = rows[:MAX_NODES] if isinstance(rows, list) else []
    return {row["name"]: _texts(row.get(key)) for row in rows if isinstance(row, dict) and _is_text(row.get("name"))}


def _texts(given: Any) -> tuple[str, ...]:
    return tuple(one for one in given[:MAX_NODES] if _is_text(one)) if isinstance(given, list) else ()


def _is_text(given: Any) -> bool:
    return isinstance(given, str) and len(given) <= MAX_NAME


def _is_id(given: Any) -> bool:
    return type(given) is int and 0 <= given < _UINT32


_READERS: Mapping[str, Callable[[Mapping[str, Any]], Received]] = {
    "serverInfo": _server_info,
    "status": _status,
    "advertise": _advertise,
    "unadvertise": _unadvertise,
    "connectionGraphUpdate": _graph_update,
}


# -- to the server ---------------------------------------------------------------------------------------------------


def subscribe(rows: Iterable[tuple[int, int]]) -> bytes:
    """`rows`: number of the subscription, which is ours, and of the channel."""
    subscriptions = [{"id": number, "channelId": channel} for number, channel in rows]
    return orjson.dumps({"op": "subscribe", "subscriptions": subscriptions})


def unsubscribe(ids: Iterable[int]) -> bytes:
    return orjson.dumps({"op": "unsubscribe", "subscriptionIds": list(ids)})


def subscribe_graph() -> bytes:
    return orjson.dumps({"op": "subscribeConnectionGraph"})


def advertise(channel: Channel) -> bytes:
    """A channel of ours, on which messages follow."""
    row = {"id": channel.id, "topic": channel.topic, "encoding": channel.encoding, "schemaName": channel.type}
    if channel.schema:
        row |= {"schema": channel.schema, "schemaEncoding": channel.schema_encoding}
    return orjson.dumps({"op": "advertise", "channels": [row]})


def unadvertise(id: int) -> bytes:
    return orjson.dumps({"op": "unadvertise", "channelIds": [id]})


def message(id: int, payload: bytes) -> bytes:
    """The binary frame of a message on a channel of ours."""
    return _CLIENT_HEAD.pack(_MESSAGE, id) + payload

"""What the slow-down sends, as frames for a Foxglove server: rosbridge's operations, checked at the same gate."""

from __future__ import annotations

import itertools
from collections.abc import Collection
from typing import Any

from server.judge.message import RosVersion
from server.recording.read.encode import TypeMismatch
from server.recording.read.schemas import Schema, TypeBook
from server.rosbridge.codec import json_bytes
from server.rosbridge.live_source import LinkDown
from server.rosbridge.outgoing import NotAllowed, Outgoing
from server.vehicle.foxglove import protocol
from server.vehicle.foxglove.protocol import Channel, ServerInfo

CLIENT_PUBLISH = "clientPublish"
_BINARY: dict[str, RosVersion] = {"cdr": 2, "ros1": 1}


class Commands:
    """Of one connection."""

    def __init__(self, info: ServerInfo) -> None:
        self.info = info
        self._gate = Outgoing()
        self._ids = itertools.count(1)
        self._channels: dict[str, tuple[int, Schema | None]] = {}  # topic → our channel; None: JSON

    def problem(self, offered: Collection[str]) -> str | None:
        """Why no command can be sent; `offered`: encodings of the car's channels, empty while none is known. None: it
        can, or it is not known yet."""
        if CLIENT_PUBLISH not in self.info.capabilities:
            return "The Foxglove server takes no messages: start it with the capability clientPublish."
        if offered and self._encoding(offered) is None:
            named = ", ".join(self.info.encodings[:5]) or "none"
            return f"The Foxglove server takes no message that catgraph can write: its encodings are {named}."
        return None

    def frames(self, operation: dict[str, Any], offered: Collection[str]) -> tuple[bytes, bool]:
        """The frame of an operation, and whether it is binary. Raises NotAllowed, LinkDown."""
        self._gate.frame(operation)
        match operation["op"]:
            case "advertise":
                return self._advertise(operation["topic"], operation["type"], offered), False
            case "unadvertise":
                id, _ = self._channels.pop(operation["topic"], (0, None))
                return protocol.unadvertise(id), False
            case "publish":
                return self._message(operation["topic"], operation["msg"]), True
        raise NotAllowed(f"there is no {operation['op']} in Foxglove's protocol")

    def _encoding(self, offered: Collection[str]) -> str | None:
        """That of the car's own channels before JSON, which has to be read again there."""
        usable = [one for one in (*_BINARY, "json") if one in self.info.encodings]
        return next((one for one in usable if one in offered), "json" if "json" in usable else None)

    def _advertise(self, topic: str, type: str, offered: Collection[str]) -> bytes:
        if (problem := self.problem(offered)) is not None:
            raise NotAllowed(problem)
        encoding = self._encoding(offered)
        if encoding is None:
            raise LinkDown("not sent: the Foxglove server has not listed its channels yet")
        schema = TypeBook(_BINARY[encoding]).schema(type) if encoding in _BINARY else None
        if schema is None and encoding in _BINARY:
            raise NotAllowed(f"{type} cannot be written as {encoding}")
        id, _ = self._channels[topic] = next(self._ids), schema
        return protocol.advertise(
            Channel(
                id=id,
                topic=topic,
                encoding=encoding,
                type=type if schema is None else schema.name,
                schema="" if schema is None else schema.data.decode(),
                schema_encoding="" if schema is None else schema.encoding,
            )
        )

    def _message(self, topic: str, message: dict[str, Any]) -> bytes:
        if topic not in self._channels:
            raise NotAllowed(f"{topic} is not advertised on this connection")
        id, schema = self._channels[topic]
        if schema is None or schema.encode is None:
            return protocol.message(id, json_bytes(message))
        if schema.message_encoding == "ros1" and "header" in message:
            message = {**message, "header": {"seq": 0, **message["header"]}}  # a bridge counts them itself
        try:
            return protocol.message(id, schema.encode(message))
        except TypeMismatch as why:
            raise NotAllowed(f"it is not of its type: {why}") from None

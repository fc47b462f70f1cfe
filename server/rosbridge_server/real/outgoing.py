"""One message on its way to a real bridge's clients, turned into each form at most once."""

from __future__ import annotations

import json
import math
from typing import Any

from server.judge.message import Json
from server.rosbridge.message_bytes import json_bytes
from server.rosbridge_server.encoding import Outgoing
from server.rosbridge_server.real import cbor, text
from server.rosbridge_server.real.shape import Lost
from server.rosbridge_server.real.values import Values
from server.rosbridge_server.types import RosContext


class RealOutgoing(Outgoing):
    """A message of a type that is not known is written unchanged."""

    __slots__ = ("_forms",)

    def __init__(self, bridge: RosContext, type: str, message: Json) -> None:
        super().__init__(bridge, type, message)
        self._forms: dict[str, Any] = {}

    def json_values(self) -> Any:
        """The `msg` of a JSON frame. Raises Lost."""
        return self._form("json")

    def cbor_frame(self, topic: str) -> bytes:
        """A whole CBOR object. Raises Lost."""
        return cbor.dumps({"op": "publish", "topic": topic, "msg": self._form("cbor")}, self._bridge.ros_version)

    def raw_frame(self, topic: str) -> bytes:
        """A whole CBOR object with the bytes of the ROS message. Raises Lost."""
        now_s = self._bridge.now()
        message = {
            "secs": math.floor(now_s),
            "nsecs": min(999_999_999, round((now_s - math.floor(now_s)) * 1e9)),
            "bytes": self._form("raw"),
        }
        return cbor.dumps({"op": "publish", "topic": topic, "msg": message}, self._bridge.ros_version)

    def png_text(self, topic: str) -> str:
        """The picture of the JSON frame. Raises Lost."""
        version = self._bridge.ros_version
        frame = text.dumps({"op": "publish", "topic": topic, "msg": self.json_values()}, version)
        return text.png(frame.encode())

    def _form(self, name: str) -> Any:
        if name not in self._forms:
            try:
                self._forms[name] = self._written(name)
            except Lost as lost:
                self._forms[name] = lost
        found = self._forms[name]
        if isinstance(found, Lost):
            raise found
        return found

    def _written(self, name: str) -> Any:
        if name == "raw":
            return self.raw()
        definitions = self._bridge.types.definitions(self.type)
        if definitions is None and name == "json":
            return json.loads(json_bytes(self._message))
        if definitions is None:
            raise Lost(f"the type {self.type} is not known")
        long, version = self._bridge.types.long_name(self.type), self._bridge.ros_version
        values = Values(version, definitions)
        return values.json(long, self._message) if name == "json" else values.cbor(long, self._message)

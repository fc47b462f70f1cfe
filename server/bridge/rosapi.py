"""The rosapi services: what a client asks to learn which topics, types and nodes there are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from server.bridge.completion import stamp
from server.bridge.graph import SOURCE, Topic
from server.bridge.names import canonical_name
from server.source import Json

if TYPE_CHECKING:
    from server.bridge.server import RosBridge

BRIDGE_NODE = "/rosbridge_websocket"
ROSAPI_NODE = "/rosapi"


def add_rosapi(bridge: RosBridge) -> None:
    """Adds the services of rosapi to a bridge, with the names of their fields as rosapi has them."""
    api = _Rosapi(bridge)
    package = "rosapi" if bridge.ros_version == 1 else "rosapi_msgs"
    for name, type, handler, arguments in (
        ("topics", "Topics", api.topics, ()),
        ("topics_for_type", "TopicsForType", api.topics_for_type, ("type",)),
        ("topics_and_raw_types", "TopicsAndRawTypes", api.topics_and_raw_types, ()),
        ("topic_type", "TopicType", api.topic_type, ("topic",)),
        ("get_time", "GetTime", api.get_time, ()),
        ("message_details", "MessageDetails", api.message_details, ("type",)),
        ("publishers", "Publishers", api.publishers, ("topic",)),
        ("subscribers", "Subscribers", api.subscribers, ("topic",)),
        ("nodes", "Nodes", api.nodes, ()),
        ("node_details", "NodeDetails", api.node_details, ("node",)),
        ("services", "Services", api.services, ()),
        ("services_for_type", "ServicesForType", api.services_for_type, ("type",)),
        ("service_type", "ServiceType", api.service_type, ("service",)),
        ("service_node", "ServiceNode", api.service_node, ("service",)),
    ):
        bridge.add_service(f"/rosapi/{name}", f"{package}/{type}", handler, arguments)
    if bridge.ros_version == 2:
        bridge.add_service("/rosapi/get_ros_version", f"{package}/GetROSVersion", api.ros_version)


class _Rosapi:
    def __init__(self, bridge: RosBridge) -> None:
        self._bridge = bridge

    def topics(self, args: Json) -> Json:
        topics = self._bridge.graph.topics()
        return {"topics": [topic.name for topic in topics], "types": [topic.type or "" for topic in topics]}

    def topics_for_type(self, args: Json) -> Json:
        type = self._bridge.message_type(_text(args, "type"))
        return {"topics": [topic.name for topic in self._bridge.graph.topics() if topic.type == type]}

    def topics_and_raw_types(self, args: Json) -> Json:
        texts = [self._bridge.types.text(topic.type or "") for topic in self._bridge.graph.topics()]
        return {**self.topics(args), "typedefs_full_texts": texts}

    def topic_type(self, args: Json) -> Json:
        topic = self._topic(args)
        return {"type": (topic.type if topic else None) or ""}

    def get_time(self, args: Json) -> Json:
        return {"time": stamp(self._bridge.now(), self._bridge.ros_version)}

    def ros_version(self, args: Json) -> Json:
        return {"version": 2, "distro": "humble"}

    def message_details(self, args: Json) -> Json:
        return {"typedefs": self._bridge.types.describe(self._bridge.message_type(_text(args, "type")))}

    def publishers(self, args: Json) -> Json:
        topic = self._topic(args)
        return {"publishers": self._publisher_nodes(topic) if topic else []}

    def subscribers(self, args: Json) -> Json:
        topic = self._topic(args)
        return {"subscribers": [BRIDGE_NODE] if topic and topic.subscribers else []}

    def nodes(self, args: Json) -> Json:
        return {"nodes": [self._bridge.node, ROSAPI_NODE, BRIDGE_NODE]}

    def node_details(self, args: Json) -> Json:
        node = _text(args, "node")
        topics = self._bridge.graph.topics()
        return {
            "subscribing": [topic.name for topic in topics if topic.subscribers] if node == BRIDGE_NODE else [],
            "publishing": [topic.name for topic in topics if node in self._publisher_nodes(topic)],
            "services": [name for name in self._bridge.services.names() if self._node_of(name) == node],
        }

    def services(self, args: Json) -> Json:
        return {"services": self._bridge.services.names()}

    def services_for_type(self, args: Json) -> Json:
        wanted = _text(args, "type")
        return {"services": [name for name in self._bridge.services.names() if self._service_type(name) == wanted]}

    def service_type(self, args: Json) -> Json:
        return {"type": self._service_type(_text(args, "service"))}

    def service_node(self, args: Json) -> Json:
        name = _text(args, "service")
        return {"node": self._node_of(name) if self._bridge.services.find(name) else ""}

    def _topic(self, args: Json) -> Topic | None:
        return self._bridge.graph.find(_text(args, "topic"))

    def _publisher_nodes(self, topic: Topic) -> list[str]:
        ours = [self._bridge.node] if SOURCE in topic.publishers else []
        return ours + ([BRIDGE_NODE] if topic.publishers - {SOURCE} else [])

    def _service_type(self, name: str) -> str:
        service = self._bridge.services.find(name)
        return service.type if service else ""

    def _node_of(self, service: str) -> str:
        return ROSAPI_NODE if canonical_name(service).startswith("/rosapi/") else self._bridge.node


def _text(args: Json, name: str) -> str:
    value: Any = args.get(name, "")
    if not isinstance(value, str):
        raise TypeError(f"{name} must be text")
    return value

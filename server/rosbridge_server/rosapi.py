"""The rosapi services, which list topics, types and nodes."""

from __future__ import annotations

import json
from typing import Any

from server.judge.message import Json, RosVersion
from server.judge.ros_names import canonical_type
from server.recording.read.definitions import types_of_msg
from server.rosbridge_server.graph import SOURCE, Topic
from server.rosbridge_server.interface import RosapiHost
from server.rosbridge_server.shape import stamp
from server.rosbridge_server.typedefs import TIME_TYPEDEF, Malformed, Unknown, describe, load

_TYPEDEFS = f"""rosapi/TypeDef[] typedefs
{"=" * 80}
MSG: rosapi/TypeDef
string type
string[] fieldnames
string[] fieldtypes
int32[] fieldarraylen
string[] examples
string[] constnames
string[] constvalues
"""
_TEXTS = {
    "topics": "string[] topics\nstring[] types\n",
    "topics_for_type": "string[] topics\n",
    "topics_and_raw_types": "string[] topics\nstring[] types\nstring[] typedefs_full_text\n",
    "topic_type": "string type\n",
    "message_details": _TYPEDEFS,
    "publishers": "string[] publishers\n",
    "subscribers": "string[] subscribers\n",
    "nodes": "string[] nodes\n",
    "node_details": "string[] subscribing\nstring[] publishing\nstring[] services\n",
    "services": "string[] services\n",
    "services_for_type": "string[] services\n",
    "service_type": "string type\n",
    "service_node": "string node\n",
    "service_host": "string host\n",
    "service_providers": "string[] providers\n",
    "service_request_details": _TYPEDEFS,
    "service_response_details": _TYPEDEFS,
    "action_servers": "string[] action_servers\n",
    "get_param": "string value\n",
    "has_param": "bool exists\n",
    "get_param_names": "string[] names\n",
    "search_param": "string global_name\n",
    "get_ros_version": "uint8 version\nstring distro\n",
    "set_param": "",
    "delete_param": "",
}
_TIMES = {1: "time time\n", 2: "builtin_interfaces/Time time\n"}

BRIDGE_NODE = "/rosbridge_websocket"
ROSAPI_NODE = "/rosapi"


def answer_text(service: str, version: RosVersion) -> str:
    """Of one service, named without /rosapi/. The types of ROS 2 are in the package rosapi_msgs."""
    if service == "get_time":
        return _TIMES[version]
    text = _TEXTS[service]
    return text if version == 1 else text.replace("rosapi/", "rosapi_msgs/")


def add_rosapi(bridge: RosapiHost) -> None:
    """Adds the services of rosapi to a bridge, with the names of their fields as rosapi has them."""
    api = _Rosapi(bridge)
    package = "rosapi" if bridge.ros_version == 1 else "rosapi_msgs"
    default = "default" if bridge.ros_version == 1 else "default_value"
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
        ("service_providers", "ServiceProviders", api.service_providers, ("service",)),
        ("service_request_details", "ServiceRequestDetails", api.service_request_details, ("type",)),
        ("service_response_details", "ServiceResponseDetails", api.service_response_details, ("type",)),
        ("action_servers", "GetActionServers", api.action_servers, ()),
        ("get_param", "GetParam", api.get_param, ("name", default)),
        ("has_param", "HasParam", api.has_param, ("name",)),
        ("get_param_names", "GetParamNames", api.get_param_names, ()),
        ("set_param", "SetParam", api.set_param, ("name", "value")),
        ("delete_param", "DeleteParam", api.delete_param, ("name",)),
        *(
            (
                ("service_host", "ServiceHost", api.service_host, ("service",)),
                ("search_param", "SearchParam", api.search_param, ("name",)),
            )
            if bridge.ros_version == 1
            else (("get_ros_version", "GetROSVersion", api.ros_version, ()),)
        ),
    ):
        bridge.add_service(
            f"/rosapi/{name}",
            f"{package}/{type}",
            handler,
            arguments,
            request="".join(f"string {argument}\n" for argument in arguments),
            response=answer_text(name, bridge.ros_version),
            node=ROSAPI_NODE,
        )


class _Rosapi:
    def __init__(self, bridge: RosapiHost) -> None:
        self._bridge = bridge
        self._version = bridge.ros_version

    def topics(self, args: Json) -> Json:
        topics = self._bridge.graph.topics()
        return {"topics": [topic.name for topic in topics], "types": [topic.type or "" for topic in topics]}

    def topics_for_type(self, args: Json) -> Json:
        wanted = _text(args, "type")
        if self._version == 1:
            found = [name for name, type in self._bridge.types_seen().items() if type == wanted]
            return {"topics": sorted(found)}
        return {"topics": [topic.name for topic in self._bridge.graph.topics() if topic.type == wanted]}

    def topics_and_raw_types(self, args: Json) -> Json:
        texts = [self._bridge.types.text(topic.type or "") for topic in self._bridge.graph.topics()]
        return {**self.topics(args), "typedefs_full_text": texts}

    def topic_type(self, args: Json) -> Json:
        name = _text(args, "topic")
        if self._version == 1:
            return {"type": self._bridge.types_seen().get(name, "")}
        return {"type": next((topic.type or "" for topic in self._bridge.graph.topics() if topic.name == name), "")}

    def get_time(self, args: Json) -> Json:
        return {"time": stamp(self._bridge.now(), self._version)}

    def ros_version(self, args: Json) -> Json:
        return {"version": 2, "distro": "humble"}

    def message_details(self, args: Json) -> Json:
        type = _text(args, "type")
        if type in ("time", "duration"):
            return {"typedefs": [TIME_TYPEDEF | {"type": type}]}
        if type in _ATOMICS[self._version]:
            return {"typedefs": []}
        try:
            loaded = load(self._bridge, type)
        except (Malformed, Unknown) as why:
            if self._version == 2 and isinstance(why, Unknown):
                return {"typedefs": []}
            raise
        definitions = self._bridge.types.definitions(loaded)
        assert definitions is not None
        return {"typedefs": describe(self._bridge.types.long_name(loaded), definitions, self._version)}

    def publishers(self, args: Json) -> Json:
        topic = self._topic(args)
        return {"publishers": self._publisher_nodes(topic) if topic else []}

    def subscribers(self, args: Json) -> Json:
        topic = self._topic(args)
        return {"subscribers": [BRIDGE_NODE] if topic and topic.subscribers else []}

    def nodes(self, args: Json) -> Json:
        return {"nodes": self._nodes()}

    def node_details(self, args: Json) -> Json:
        node = _text(args, "node")
        topics = self._bridge.graph.topics()
        return {
            "subscribing": [topic.name for topic in topics if topic.subscribers] if node == BRIDGE_NODE else [],
            "publishing": [topic.name for topic in topics if node in self._publisher_nodes(topic)],
            "services": [service.name for service in self._bridge.services.all() if service.node == node],
        }

    def services(self, args: Json) -> Json:
        return {"services": self._bridge.services.names()}

    def services_for_type(self, args: Json) -> Json:
        wanted = _text(args, "type")
        return {"services": [one.name for one in self._bridge.services.all() if one.type == wanted]}

    def service_type(self, args: Json) -> Json:
        service = self._bridge.services.find_exactly(_text(args, "service"))
        return {"type": service.type if service else ""}

    def service_node(self, args: Json) -> Json:
        service = self._bridge.services.find(_text(args, "service"))
        return {"node": service.node if service else ""}

    def service_host(self, args: Json) -> Json:
        return {"host": "127.0.0.1" if self._bridge.services.find(_text(args, "service")) else ""}

    def service_providers(self, args: Json) -> Json:
        wanted = _text(args, "service")
        found = [one.node for one in self._bridge.services.all() if one.type == wanted]
        return {"providers": found if self._version == 1 else sorted(set(found))}

    def service_request_details(self, args: Json) -> Json:
        return self._service_details(_text(args, "type"), is_request=True)

    def service_response_details(self, args: Json) -> Json:
        return self._service_details(_text(args, "type"), is_request=False)

    def action_servers(self, args: Json) -> Json:
        return {"action_servers": []}

    def get_param(self, args: Json) -> Json:
        default = _text(args, "default" if self._version == 1 else "default_value")
        name = self._parameter(args)
        if name is None:
            return {"value": ""}
        if name in self._bridge.parameters:
            return {"value": json.dumps(self._bridge.parameters[name])}
        if self._version == 2:
            return {"value": default or '""'}
        return {"value": default or "null"}

    def has_param(self, args: Json) -> Json:
        return {"exists": self._parameter(args) in self._bridge.parameters}

    def get_param_names(self, args: Json) -> Json:
        return {"names": list(self._bridge.parameters)}

    def set_param(self, args: Json) -> Json:
        name = self._parameter(args)
        if name is not None:
            try:
                self._bridge.parameters[name] = json.loads(_text(args, "value"))
            except ValueError:
                self._bridge.parameters[name] = _text(args, "value")
        return {}

    def delete_param(self, args: Json) -> Json:
        self._bridge.parameters.pop(_text(args, "name"), None)
        return {}

    def search_param(self, args: Json) -> Json:
        name = _text(args, "name")
        return {"global_name": f"/{name.lstrip('/')}"}

    def _parameter(self, args: Json) -> str | None:
        """The name; in ROS 2 NODE:NAME, None where it is anything else."""
        name = _text(args, "name")
        return name if self._version == 1 or name.count(":") == 1 else None

    def _nodes(self) -> list[str]:
        return [self._bridge.node, ROSAPI_NODE, BRIDGE_NODE]

    def _topic(self, args: Json) -> Topic | None:
        name = _text(args, "topic")
        return next((topic for topic in self._bridge.graph.topics() if topic.name == name), None)

    def _publisher_nodes(self, topic: Topic) -> list[str]:
        ours = [self._bridge.node] if SOURCE in topic.publishers else []
        return ours + ([BRIDGE_NODE] if topic.publishers - {SOURCE} else [])

    def _service_details(self, type: str, *, is_request: bool) -> Json:
        parts = [part for part in type.split("/") if part]
        if len(parts) not in ((2,) if self._version == 1 else (2, 3)):
            raise Malformed(f"{type} is not a valid type string")
        package, kind = parts[0], parts[-1]
        side = "Request" if is_request else "Response"
        wanted = canonical_type(type, self._version, "srv")
        service = next((one for one in self._bridge.services.all() if one.type == wanted), None)
        text = (service.request if is_request else service.response) if service else None
        if text is None:
            raise Unknown(
                f"Unable to import srv class {kind} from package {package}. "
                f"Caused by module '{package}.srv' has no attribute '{kind}'"
            )
        long = f"{package}/msg/{kind}{side}"
        definitions = types_of_msg(text, long) if text else {long: ([], [])}
        shown = f"{package}/{kind}{side}" if self._version == 1 else f"{package}/{kind}_{side}"
        found = describe(long, definitions, self._version)
        return {"typedefs": [{**found[0], "type": shown}, *found[1:]]}


_ATOMICS = {
    1: {
        "bool", "byte", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
        "float32", "float64", "string",
    },
    2: {
        "bool", "boolean", "byte", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
        "float", "float32", "float64", "double", "string", "octet",
    },
}  # fmt: skip

__all__ = ["BRIDGE_NODE", "ROSAPI_NODE", "add_rosapi"]


def _text(args: Json, name: str) -> str:
    value: Any = args.get(name, "")
    if not isinstance(value, str):
        raise TypeError(f"{name} must be text")
    return value

"""Compares what our bridge sent with what the real one did. All that may differ is named here."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any

import cbor2
from rosbags.typesys import get_types_from_msg

from tests.world.played import picture_text
from tests.world.transcripts import Transcript

# of ROS itself or left there by the recorder, not of the car
ROS_TOPICS = {
    "/rosout",
    "/rosout_agg",
    "/client_count",
    "/connected_clients",
    "/parameter_events",
    "/p/f32",
    "/p/stamped",
}
ROS_NODES = {
    "/rosout",
    "/rosapi_params",
    "/listener",
    "/late_car",
    "/rosbridge_websocket9191",
    "/rosbridge_websocket9192",
}
NODE_SERVICES = re.compile(
    r"/(get_loggers|set_logger_level|describe_parameters|get_parameter_types|get_parameters|get_type_description"
    r"|list_parameters|set_parameters|set_parameters_atomically)$"
)
_ADDRESS = re.compile(r"0x[0-9a-f]+")
_PORT = re.compile(r"127\.0\.0\.1:\d+")
_ROS_PATH = re.compile(r"\\nROS path.*?(?=['\"]|$)", re.DOTALL)
_NOW_S = 1_790_000_000  # later stamps are the time of the call


def streams(frames: Iterable[str | bytes], transcript: Transcript) -> dict[str, list[Any]]:
    """The frames by what must keep its order: each topic in each encoding, and all answers."""
    found: dict[str, list[Any]] = {}
    parts: dict[str, str] = {}
    for frame in frames:
        key, content = _comparable(frame, parts, transcript)
        if key:
            found.setdefault(key, []).append(content)
    return found


def _comparable(frame: str | bytes, parts: dict[str, str], transcript: Transcript) -> tuple[str, Any]:
    if isinstance(frame, bytes):
        body = cbor2.loads(frame)
        if set(body["msg"]) == {"secs", "nsecs", "bytes"}:
            return f"cbor-raw {body['topic']}", body["msg"]["bytes"]
        return f"cbor {body['topic']}", repr(body["msg"])
    body = _loaded(frame)
    if body["op"] == "status":  # the real ones write it to their logs
        return "", None
    if body["op"] == "publish":
        return f"json {body['topic']}", body["msg"]
    if body["op"] == "png":
        hidden = _loaded(picture_text(body["data"]))
        return f"png {hidden['topic']}", hidden["msg"]
    if body["op"] == "fragment":
        return _fragment(frame, body, parts, transcript)
    return "answers", _answer(body, transcript)


def _fragment(frame: str, body: dict[str, Any], parts: dict[str, str], transcript: Transcript) -> tuple[str, Any]:
    """What the pieces make up, whose number may differ with the spaces between."""
    assert list(body) == ["op", "id", "data", "num", "total"]
    whole = body["data"] if body["num"] == 0 else parts[str(body["id"])] + body["data"]
    parts[str(body["id"])] = whole
    if body["num"] + 1 < int(body["total"]):
        return "", None
    key, content = _comparable(whole, {}, transcript)
    return (f"{key} in fragments" if key else ""), (body["id"], content)


def _loaded(text: str) -> Any:
    """JSON, with null for the constants of ROS 2 that JSON does not have."""
    return json.loads(text, parse_constant=lambda constant: None)


def _answer(body: dict[str, Any], transcript: Transcript) -> Any:
    values = body.get("values")
    if isinstance(values, str):
        values = _PORT.sub("127.0.0.1:PORT", _ADDRESS.sub("0x", _ROS_PATH.sub("", values)))
    elif isinstance(values, dict):
        values = {name: _value(name, value, values, transcript) for name, value in values.items()}
        values.pop("types", None)
        values.pop("typedefs_full_text", None)
    return {**body, "values": values} if "values" in body else body


def _value(name: str, value: Any, values: dict[str, Any], transcript: Transcript) -> Any:
    match name:
        case "time":
            return sorted(value)
        case "topics" if "types" in values:
            texts = values.get("typedefs_full_text", [None] * len(value))
            rows = zip(value, values["types"], texts, strict=True)
            return sorted([topic, type, _fields(type, text)] for topic, type, text in rows if topic not in ROS_TOPICS)
        case "topics" | "publishing" | "subscribing":
            return sorted(topic for topic in value if topic not in ROS_TOPICS)
        case "nodes" | "publishers" | "subscribers" | "providers":
            named = (
                "/rosapi"
                if node == "/rosapi_node"
                else "/car"
                if name == "publishers" and node == "/late_car"
                else node
                for node in value
            )
            return sorted(node for node in named if node not in ROS_NODES)
        case "services":
            return sorted(service for service in value if not NODE_SERVICES.search(service))
        case "typedefs":
            return [
                {
                    field: [_ADDRESS.sub("0x", item) for item in items] if field == "constvalues" else items
                    for field, items in typedef.items()
                }
                for typedef in value
            ]
        case _:
            return value


def _fields(type: str, text: str | None) -> Any:
    """The fields of a definition, without its comments; standard types are compared by message_details."""
    if not text or not type.startswith("car_msgs/"):
        return None if text is None else bool(text)
    package, _, kind = type.partition("/")
    found = get_types_from_msg(text, f"{package}/msg/{kind.removeprefix('msg/')}")
    return repr(sorted(found.items()))

"""Service calls at a real bridge: its error texts, and services that never answer."""

from __future__ import annotations

import asyncio
import inspect
import re
from typing import Any

from rosbags.typesys import get_types_from_msg

from server.judge.ros_names import BadName
from server.rosbridge_server.completion import zero
from server.rosbridge_server.interface import ServiceHost
from server.rosbridge_server.real.convert import Converter, Unfit
from server.rosbridge_server.real.shape import fields
from server.rosbridge_server.services import Service

_ROS2_NAME = re.compile(r"[A-Za-z0-9_~{}/]+", re.ASCII)
_RCL = "at /project/src/rcl/expand_topic_name.c:73"


class Failure(Exception):
    """The call fails; the text is sent to the caller."""


class NoAnswer(Exception):
    """The service's node was killed: the caller waits for ever."""


async def call(bridge: ServiceHost, name: str, args: Any) -> Any:
    """The answer's values. Raises Failure and NoAnswer."""
    if bridge.down is not None:
        raise Failure(bridge.down)
    full = _resolved(bridge, name)
    try:
        service = bridge.services.find(full)
    except BadName:
        service = None
    if service is None:
        raise Failure(f"Service {full} does not exist")
    if service.node in bridge.dead_nodes:
        if bridge.ros_version == 2:
            raise NoAnswer
        raise Failure(f"Unable to communicate with service [{full}], address [rosrpc://127.0.0.1:40583]")
    request = _request(bridge, service, args)
    try:
        values = service.handler(request)
        return await values if inspect.isawaitable(values) else values
    except asyncio.CancelledError:
        raise
    except Exception as error:  # whatever a node's handler raises
        text = f"error processing request: {error}".encode()
        raise Failure(f"service [{full}] responded with an error: {text!r}") from None


def _resolved(bridge: ServiceHost, name: str) -> str:
    full = name if name.startswith("/") else f"/{name}"
    if bridge.ros_version == 1:
        return full.rstrip("/") or "/"
    if not name:
        raise Failure(f"topic name '' is invalid: topic name must not be empty string, {_RCL}")
    if not _ROS2_NAME.fullmatch(name):
        raise Failure(
            f"topic name '{name}' is invalid: topic name must not contain characters other than alphanumerics, "
            f"'_', '~', '{{', or '}}', {_RCL}"
        )
    if name.endswith("/"):
        raise Failure(f"topic name '{name}' is invalid: topic name must not end with a forward slash, {_RCL}")
    return full


def _request(bridge: ServiceHost, service: Service, args: Any) -> dict[str, Any]:
    given = dict(zip(service.arguments, args, strict=False)) if isinstance(args, list) else args
    given = given if isinstance(given, dict) else {}
    if service.request is None:
        return given
    package, _, kind = service.type.partition("/")[0], "", service.type.rpartition("/")[2]
    suffix = "Request" if bridge.ros_version == 1 else "_Request"
    long = f"{package}/msg/{kind}{suffix.strip('_')}"
    definitions = dict(get_types_from_msg(service.request or "\n", long)) if service.request else {long: ([], [])}
    converter = Converter(long, definitions, bridge.ros_version, bridge.now, root=f"{package}/{kind}{suffix}")
    try:
        found = converter.message(given)
    except Unfit as error:
        raise Failure(str(error)) from None
    return {field.name: found.get(field.name, zero(field.type)) for field in fields(long, definitions)}

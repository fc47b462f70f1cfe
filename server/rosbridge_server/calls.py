"""The service calls of one client, answered now, later or with the reason why not, and the services that it offers."""

from __future__ import annotations

import asyncio
import inspect
import itertools
import re
from collections.abc import Callable, Collection
from typing import Any

from server.judge.message import Json
from server.judge.ros_names import BadName
from server.recording.read.definitions import types_of_msg
from server.rosbridge_server import fields
from server.rosbridge_server.completion import Completion
from server.rosbridge_server.fields import Refused
from server.rosbridge_server.graph import Service, ServiceFailed, Services
from server.rosbridge_server.interface import ServiceHost

MOST_CALLS = 100  # without an answer yet
_ROS2_NAME = re.compile(r"[A-Za-z0-9_~{}/]+", re.ASCII)
_RCL = "at /project/src/rcl/expand_topic_name.c:73"


class Providers:
    """The services of one client. `send` takes an object for that client."""

    def __init__(self, services: Services, send: Callable[[Any], None]) -> None:
        self._services = services
        self._send = send
        self.names: set[str] = set()  # the services that the client offers
        self._numbers = itertools.count(1)  # never again from 1: a late answer must not fit another call
        self._waiting: dict[str, tuple[str, asyncio.Future[Json]]] = {}  # service and answer, by the id of the request

    def advertise(self, operation: dict[str, Any], id: object) -> None:
        name, type = operation["service"], operation["type"]
        self.names.add(name)
        self._services.add(Service(name=name, type=type, handler=lambda args: self._ask(name, args)))

    def unadvertise(self, operation: dict[str, Any], id: object) -> None:
        name = operation["service"]
        if name in self.names:
            self._end([name], f"the service {name} was withdrawn")

    def respond(self, operation: dict[str, Any], id: object) -> bool:
        """Pass the client's answer on; False where no call waits for it."""
        _, future = self._waiting.pop(operation["id"], (None, None))
        if future is None or future.done():
            return False
        if operation.get("result") is False:
            future.set_exception(ServiceFailed(str(operation["values"])))
        else:
            future.set_result(operation["values"])
        return True

    def close(self) -> None:
        """End the services of a client that is gone; pending calls of them fail."""
        self._end(list(self.names), "the client that offers the service has gone")

    def _end(self, names: Collection[str], why: str) -> None:
        for name in names:
            self.names.discard(name)
            self._services.remove(name)
        for service, future in self._waiting.values():
            if service in names and not future.done():
                future.set_exception(ServiceFailed(why))

    async def _ask(self, name: str, args: Json) -> Json:
        request = f"service_request:{name}:{next(self._numbers)}"
        future: asyncio.Future[Json] = asyncio.get_running_loop().create_future()
        self._waiting[request] = (name, future)
        try:
            self._send({"op": "call_service", "id": request, "service": name, "args": args})
            return await future
        finally:  # the caller may have gone
            self._waiting.pop(request, None)


class Calls:
    """`reply` takes the answers."""

    def __init__(self, bridge: ServiceHost, reply: Callable[[Json], None]) -> None:
        self._bridge = bridge
        self._reply = reply
        self._waiting: set[asyncio.Task[None]] = set()

    def call(self, operation: dict[str, Any], id: object) -> None:
        """Does a call_service operation. Raises Refused where it is none."""
        spelling = fields.text(operation, "service")
        name, _, tail = spelling.partition("#")  # an old way to give the id
        if id is None and tail:
            id = tail[: fields.LONGEST_ID]
        try:
            if len(self._waiting) >= MOST_CALLS:
                raise Refused(f"{MOST_CALLS} service calls have no answer yet")
            service = self._find(name)
            request = self._request(service, operation.get("args"))
        except Refused as why:
            self._respond(spelling, id, str(why), result=False)
            return
        try:
            values: Any = service.handler(request)
        except Exception as error:  # a handler's mistake is the caller's answer, never the bridge's end
            self._respond(spelling, id, _failed(service, error), result=False)
            return
        if inspect.isawaitable(values):
            task = asyncio.ensure_future(self._answer_later(spelling, id, service, values))
            self._waiting.add(task)
            task.add_done_callback(self._waiting.discard)
        else:
            self._respond(spelling, id, values, result=True)

    def close(self) -> None:
        """The caller is gone: its open calls end."""
        for task in self._waiting:
            task.cancel()

    async def _answer_later(self, spelling: str, id: object, service: Service, values: Any) -> None:
        try:
            self._respond(spelling, id, await values, result=True)
        except Exception as error:  # as above
            self._respond(spelling, id, _failed(service, error), result=False)

    def _respond(self, service: str, id: object, values: Any, *, result: bool) -> None:
        response: dict[str, Any] = {"op": "service_response", "service": service, "values": values, "result": result}
        if id is not None:
            response["id"] = id
        self._reply(response)

    def _find(self, name: str) -> Service:
        full = self._resolved(name)
        try:
            service = self._bridge.services.find(full)
        except BadName:
            service = None
        if service is None:
            raise Refused(f"Service {full} does not exist")
        return service

    def _resolved(self, name: str) -> str:
        full = name if name.startswith("/") else f"/{name}"
        if self._bridge.ros_version == 1:
            return full.rstrip("/") or "/"
        if not name:
            raise Refused(f"topic name '' is invalid: topic name must not be empty string, {_RCL}")
        if not _ROS2_NAME.fullmatch(name):
            raise Refused(
                f"topic name '{name}' is invalid: topic name must not contain characters other than alphanumerics, "
                f"'_', '~', '{{', or '}}', {_RCL}"
            )
        if name.endswith("/"):
            raise Refused(f"topic name '{name}' is invalid: topic name must not end with a forward slash, {_RCL}")
        return full

    def _request(self, service: Service, args: Any) -> Json:
        """The arguments as the service's type has them. Raises Refused."""
        given = dict(zip(service.arguments, args, strict=False)) if isinstance(args, list) else args
        given = given if isinstance(given, dict) else {}
        if service.request is None:
            return given
        version = self._bridge.ros_version
        package, kind = service.type.partition("/")[0], service.type.rpartition("/")[2]
        long = f"{package}/msg/{kind}Request"
        root = f"{package}/{kind}Request" if version == 1 else f"{package}/{kind}_Request"
        definitions = types_of_msg(service.request, long) if service.request else {long: ([], [])}
        return Completion(long, definitions, version, self._bridge.now(), root=root).message(given)


def _failed(service: Service, error: Exception) -> str:
    text = f"error processing request: {str(error) or type(error).__name__}".encode("utf-8", "replace")
    return f"service [{service.name}] responded with an error: {text!r}"

"""One client's service calls: answered now, later or with the reason why not."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable
from typing import Any

from server.rosbridge_server import fields
from server.rosbridge_server.encoding import json_frame
from server.rosbridge_server.fields import Refused
from server.rosbridge_server.services import Services

MOST_CALLS = 100  # without an answer yet


class Calls:
    """`reply` takes the frames of the answers."""

    def __init__(self, services: Services, reply: Callable[[bytes], None]) -> None:
        self._services = services
        self._reply = reply
        self._waiting: set[asyncio.Task[None]] = set()

    def call(self, operation: dict[str, Any], id: object) -> None:
        """Does a call_service operation. Raises Refused where it is none."""
        args = operation.get("args", {})
        service, _, tail = fields.text(operation, "service").partition("#")  # an old way to give the id
        if id is None and tail:
            id = tail[: fields.LONGEST_ID]
        if len(self._waiting) >= MOST_CALLS:
            raise Refused(f"{MOST_CALLS} service calls have no answer yet")
        try:
            values: Any = self._services.call(service, args)
        except Exception as error:  # a handler's mistake is the caller's answer, never the bridge's end
            self._respond(service, id, _why(error), result=False)
            return
        if inspect.isawaitable(values):
            task = asyncio.ensure_future(self._answer_later(service, id, values))
            self._waiting.add(task)
            task.add_done_callback(self._waiting.discard)
        else:
            self._respond(service, id, values, result=True)

    def close(self) -> None:
        """The caller is gone: its open calls end."""
        for task in self._waiting:
            task.cancel()

    async def _answer_later(self, service: str, id: object, values: Any) -> None:
        try:
            self._respond(service, id, await values, result=True)
        except Exception as error:  # as above
            self._respond(service, id, _why(error), result=False)

    def _respond(self, service: str, id: object, values: Any, *, result: bool) -> None:
        response: dict[str, Any] = {"op": "service_response", "service": service, "values": values, "result": result}
        if id is not None:
            response["id"] = id
        self._reply(json_frame(response))


def _why(error: Exception) -> str:
    return str(error) or type(error).__name__

"""Calls of services whose answers come on the same connection."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable
from typing import Any

from server.rosbridge.live_source import CallFailed, LinkDown, Refusal
from server.rosbridge.outgoing import NotAllowed
from server.system.clean_text import short_text

MAX_PENDING_CALLS = 64


class ServiceCalls:
    """Of one link. `send` writes an operation at once; raises LinkDown, NotAllowed."""

    def __init__(self, send: Callable[[dict[str, Any]], None]) -> None:
        self._send = send
        self._pending: dict[str, asyncio.Future[Any]] = {}
        self._ids = itertools.count(1)

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """The values a service answers. Raises LinkDown, also where the link breaks before the answer, or CallFailed
        with the bridge's text."""
        if len(self._pending) >= MAX_PENDING_CALLS:
            raise CallFailed("too many calls are unanswered")
        identity = f"call:{service}:{next(self._ids)}"
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        try:
            self._send({"op": "call_service", "id": identity, "service": service, "args": arguments or {}})
        except NotAllowed as why:
            raise CallFailed(f"not sent: {why}") from None
        self._pending[identity] = answer
        try:
            async with asyncio.timeout(timeout_s):
                return await answer
        except TimeoutError:
            raise CallFailed(f"{service} did not answer within {timeout_s:g} s") from None
        finally:
            self._pending.pop(identity, None)

    def answered(self, operation: dict[str, Any]) -> None:
        identity = operation.get("id")
        answer = self._pending.get(identity) if isinstance(identity, str) else None
        if answer is None or answer.done():
            return  # late: the caller has given up
        if operation.get("result") is False:
            answer.set_exception(Refusal(short_text(operation.get("values"), 300)))
        else:
            answer.set_result(operation.get("values"))

    def fail_all(self, why: str) -> None:
        """No answer comes any more."""
        for answer in list(self._pending.values()):
            if not answer.done():
                answer.set_exception(LinkDown(why))

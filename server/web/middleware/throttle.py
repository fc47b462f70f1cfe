"""Turns away what is too much: requests a second of one device, bodies too long or too slow, nesting without end."""

from __future__ import annotations

import asyncio
import math
import re
from collections.abc import Callable

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.access.identity import LOCAL, SCOPE_KEY, Principal
from server.protocol.rate_limit import Allowance, Limits, Rate
from server.web.middleware.errors import problem, problem_of

SLOW_DOWN_PATH = "/api/slow-down/"
_UPLOAD = re.compile(r"(/agents/[^/]+)?/api/marks/[^/]+/(voice|photo)")
_KEPT = 2000  # devices whose rate is known; addresses of strangers among them
_LAST = {"Connection": "close"}  # what is still on its way is not read


class Throttle:
    """Rate limits, as pure ASGI inside the access guard: per device, or per peer address without one."""

    def __init__(self, app: ASGIApp, *, limits: Limits, now: Callable[[], float]) -> None:
        self._app = app
        self._limits = limits
        self._now = now
        self._known: dict[str, Allowance] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        allowance = self._allowance(scope)
        now_s = self._now()
        if not allowance.takes(now_s):
            wait_s = math.ceil(allowance.wait_s(now_s))
            answer = problem(429, f"Too many requests at once from this device: try again in {wait_s} s.")
            answer.headers["Retry-After"] = str(wait_s)
            await answer(scope, receive, send)  # a WebSocket is refused with the same text
            return
        if scope["type"] == "http":
            most, within_s = self._room(scope)
            length = _length(scope)
            if length is None or length > most:
                await _too_long(most)(scope, receive, send)
                return
            receive = self._bounded(receive, most, within_s)
            if _has_body(scope) and not _is_upload_request(scope):
                # A route without a body of its own would act before the rest of the request has come, or failed to.
                try:
                    whole = await _whole(receive)
                except HTTPException as why:
                    await problem_of(why)(scope, receive, send)
                    return
                if whole is None:
                    return
                receive = whole
        await self._app(scope, receive, send)

    def _room(self, scope: Scope) -> tuple[int, float]:
        """How long a body may be [B], and how long it may take [s]."""
        if _is_upload_request(scope):
            return self._limits.upload_bytes, self._limits.upload_s
        return self._limits.body_bytes, self._limits.body_s

    def _bounded(self, receive: Receive, most: int, within_s: float) -> Receive:
        """Ends a body that is longer or takes longer than it may."""
        loop = asyncio.get_running_loop()
        due_s = loop.time() + within_s
        got = 0
        is_whole = False

        async def receive_bounded() -> Message:
            nonlocal got, is_whole
            if is_whole:
                return await receive()  # that the client leaves may be waited for without end
            try:
                async with asyncio.timeout_at(due_s):
                    message = await receive()
            except TimeoutError:
                raise HTTPException(408, f"The request did not end within {within_s:g} s.", headers=_LAST) from None
            got += len(message.get("body", b""))
            if got > most:
                raise HTTPException(413, _longest(most))
            is_whole = message["type"] != "http.request" or not message.get("more_body", False)
            return message

        return receive_bounded

    def _allowance(self, scope: Scope) -> Allowance:
        who: Principal | None = scope.get(SCOPE_KEY)
        peer = scope.get("client")
        key = f"device {who.id}" if who is not None else f"address {peer[0] if peer else ''}"
        is_slow_down = scope["type"] == "http" and scope["path"].startswith(SLOW_DOWN_PATH)
        if is_slow_down:  # has its own limit, which other requests of the device do not use up
            key = f"slow-down of {key}"
        found = self._known.get(key)
        if found is None:
            if len(self._known) >= _KEPT:
                self._forget()
            found = self._known[key] = Allowance(
                self._limits.slow_down if is_slow_down else self._rate(who), self._now()
            )
        return found

    def _rate(self, who: Principal | None) -> Rate:
        return self._limits.local_requests if who is LOCAL else self._limits.requests

    def _forget(self) -> None:
        """Drop idle entries; if that is not enough, the older half."""
        now_s = self._now()
        kept = {key: one for key, one in self._known.items() if not one.is_whole(now_s)}
        self._known = dict(list(kept.items())[-_KEPT // 2 :])


def _length(scope: Scope) -> int | None:
    """The declared body length [B]; 0: none, None: not a number."""
    for name, value in scope["headers"]:
        if name == b"content-length":
            return int(value) if value.isdigit() and len(value) < 19 else None
    return 0


def _has_body(scope: Scope) -> bool:
    return any(
        name == b"transfer-encoding" or (name == b"content-length" and value != b"0")
        for name, value in scope["headers"]
    )


async def _whole(receive: Receive) -> Receive | None:
    """Return what hands out the body in one piece once it has come; None: the client left before."""
    body = bytearray()
    while True:
        message = await receive()
        if message["type"] != "http.request":
            return None
        body += message.get("body", b"")
        if not message.get("more_body", False):
            break
    kept: list[Message] = [{"type": "http.request", "body": bytes(body), "more_body": False}]

    async def receive_whole() -> Message:
        return kept.pop() if kept else await receive()

    return receive_whole


def _is_upload_request(scope: Scope) -> bool:
    return scope["method"] == "POST" and is_upload(scope["path"])


def is_upload(path: str) -> bool:
    """Whether a file is sent there: a voice note or a photo of a mark."""
    return _UPLOAD.fullmatch(path) is not None


def _too_long(most: int) -> ASGIApp:
    # The connection is not closed on what is still on its way, or the sender would never see why it was refused.
    return problem(413, _longest(most))


def _longest(most: int) -> str:
    return f"At most {most // 1024} kB are taken." if most < 1 << 20 else f"At most {most >> 20} MB are taken."

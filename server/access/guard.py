"""Lets a request in, or not: the outermost gate of the server."""

from __future__ import annotations

from starlette.types import ASGIApp, Receive, Scope, Send

from server.access.who import LOCAL, SCOPE_KEY


class Guard:
    """Pure ASGI, so that a WebSocket is looked at as a request is, and nothing is buffered."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket"):
            scope[SCOPE_KEY] = LOCAL
        await self._app(scope, receive, send)

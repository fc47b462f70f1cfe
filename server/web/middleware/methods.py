"""HEAD wherever GET is, and the methods of a path (RFC 9110, 9.3.2, 9.3.7 and 15.5.6)."""

from __future__ import annotations

from collections.abc import Iterable

from starlette.requests import Request
from starlette.routing import BaseRoute, Match, Mount
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_IS_HEAD = "catgraph.is_head"
_METHODS = ("GET", "POST", "PUT", "PATCH", "DELETE")


def is_head(request: Request) -> bool:
    """Whether the body of the answer will not be sent, so that it need not be made."""
    return request.method == "HEAD" or _IS_HEAD in request.scope


class HeadAsGet:
    """Answers HEAD as GET, with the same headers and without a body; around all routes."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return
        is_over = False

        async def send_head(message: Message) -> None:
            nonlocal is_over
            if message["type"] == "http.response.start":
                await send(message)
            elif message["type"] == "http.response.body" and not is_over:
                is_over = True
                await send({"type": "http.response.body", "body": b"", "more_body": False})

        await self._app({**scope, "method": "GET", _IS_HEAD: True}, receive, send_head)


def allowed(routes: Iterable[BaseRoute], scope: Scope) -> str:
    """The methods of the path of a request, as the header Allow lists them."""
    routes = list(routes)
    whole = {**scope, "root_path": scope.get("app_root_path", scope.get("root_path", ""))}  # not that of a mount
    found = [method for method in _METHODS if any(_takes(route, {**whole, "method": method}) for route in routes)]
    return ", ".join([*found, *(["HEAD"] if "GET" in found else []), "OPTIONS"])


def _takes(route: BaseRoute, scope: Scope) -> bool:
    if isinstance(route, Mount) and scope["method"] != "GET":
        return False  # static files
    return route.matches(scope)[0] is Match.FULL

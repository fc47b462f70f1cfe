"""Answers the instruction page that HTTPS works; outside the application, because it has no data of the car.

That page has another origin, which the server's routes refuse. A browser that does not trust the certificate gets no
answer.
"""

from __future__ import annotations

from starlette.types import ASGIApp, Receive, Scope, Send

PATH = "/trusted"
_HEADERS = [(b"cross-origin-resource-policy", b"cross-origin"), (b"cache-control", b"no-store")]


class Probe:
    """Around the whole application."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"] == PATH and scope["method"] in ("GET", "HEAD"):
            await send({"type": "http.response.start", "status": 204, "headers": _HEADERS})
            await send({"type": "http.response.body"})
            return
        await self._app(scope, receive, send)

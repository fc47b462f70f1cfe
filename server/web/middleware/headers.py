"""Security headers of every response, errors included.

Strict-Transport-Security is sent only with a given certificate (`--tls CERT KEY`): it binds a host name to HTTPS for a
year. With the server's own authority, a server that is reinstalled or started once with `--tls off` could no longer be
reached from any phone, and browsers offer no way around. See docs/security.md.
"""

from __future__ import annotations

import base64
import hashlib
import re

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "font-src 'self'",
        "media-src 'self' blob:",  # the voice of a mark: stored, or still in this page
        "connect-src 'self'",
        "manifest-src 'self'",
        "worker-src 'self'",
        "object-src 'none'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
        "trusted-types default",  # the one of static/js/boot/trusted-types.js
    )
)


def policy_of(script: str) -> str:
    """POLICY for a page that also holds the text `script` between its tags: that one, to the letter, and no other."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return POLICY.replace("script-src 'self'", f"script-src 'self' 'sha256-{digest}'")


POLICY_OF_DATA = "default-src 'none'; base-uri 'none'; object-src 'none'; frame-ancestors 'none'; sandbox"
# A report is a document of its own: it has its style and script in itself, and is kept apart from our pages as if it
# came from elsewhere, for at a web node it comes from an agent.
POLICY_OF_REPORT = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; font-src data:; img-src data:; "
    "media-src data:; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
    "sandbox allow-scripts allow-modals"
)
POLICY_OF_PARTS = "default-src 'none'; base-uri 'none'; object-src 'none'"  # a dozen come with a page: short
_DATA = (
    "/api/",
    "/agents/",
    "/map/",
    "/metrics",
    "/openapi.json",
)  # never documents of ours, and opened as one they can do nothing
_REPORT = re.compile(r"(/agents/[^/]{1,100})?/api/recordings/[^/]{1,100}/report")
# Decided by the path and not by the kind: a 304 has no kind, and replaces what is kept.
_PARTS = ("/static/", "/manifest.webmanifest")
# What a browser does not know it complains of in its console: sharing and Bluetooth, which Chromium has not everywhere.
_SELF = ("autoplay", "clipboard-write", "fullscreen", "geolocation", "microphone", "screen-wake-lock")
_NOBODY = (
    *("accelerometer", "camera", "display-capture", "gyroscope", "hid", "magnetometer"),
    *("midi", "payment", "serial", "usb", "xr-spatial-tracking"),
)
PERMISSIONS = ", ".join([*(f"{name}=(self)" for name in _SELF), *(f"{name}=()" for name in _NOBODY)])
FOR_ALL = {
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
FOR_DOCUMENTS = {
    "Content-Security-Policy": POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Origin-Agent-Cluster": "?1",
    "Permissions-Policy": PERMISSIONS,
}
STRICT = {"Strict-Transport-Security": "max-age=31536000"}  # a year; of this name alone, its siblings are not ours
_STARTS = ("http.response.start", "websocket.http.response.start")  # the second refuses a WebSocket


class SecurityHeaders:
    """Around all of the app, so that no answer leaves without; pure ASGI, so that nothing is buffered."""

    def __init__(self, app: ASGIApp, *, is_strict: bool = False) -> None:
        """`is_strict`: send Strict-Transport-Security for a year."""
        self._app = app
        self._is_strict = is_strict

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        added = FOR_ALL | _of(scope["path"])
        if self._is_strict and scope["scheme"] in ("https", "wss") and not _is_of_this_machine(scope):
            added = added | STRICT

        async def send_with_headers(message: Message) -> None:
            if message["type"] in _STARTS:
                headers = MutableHeaders(scope=message)
                for name, value in added.items():
                    headers.setdefault(name, value)
            await send(message)

        await self._app(scope, receive, send_with_headers)


def _is_of_this_machine(scope: Scope) -> bool:
    """Whether Host is localhost, a name that all servers of a machine share."""
    host = Headers(scope=scope).get("host", "")
    return host.rpartition(":")[0] == "localhost" or host == "localhost"


def _of(path: str) -> dict[str, str]:
    if path.startswith(_PARTS):
        return {"Content-Security-Policy": POLICY_OF_PARTS}
    if path.startswith(_DATA):
        return {"Content-Security-Policy": POLICY_OF_REPORT if _REPORT.fullmatch(path) else POLICY_OF_DATA}
    return FOR_DOCUMENTS

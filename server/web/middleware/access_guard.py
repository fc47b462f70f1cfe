"""Authenticates and authorizes every request and socket: the outermost middleware, and the only place for it.

The order of checks: Host, Origin, identity (key, cookie, and a ticket for a socket), role (server/access/identity.py).
The identity is stored in the ASGI scope.
"""

from __future__ import annotations

import asyncio
import contextlib
from urllib.parse import parse_qsl, quote

from starlette.datastructures import MutableHeaders
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.access.access import Access, Admitted
from server.access.active_connections import ActiveConnection
from server.access.identity import SCOPE_KEY, Needs, is_enough, needs_of
from server.web.middleware.errors import problem

ENDED = 4401  # the code with which a socket of a device is closed that may not go on as it was
_ALONE = ("host", "origin", "authorization")  # given twice, they are somebody's trick
_CHANGES_NOTHING = ("GET", "HEAD")


class _Refused(Exception):
    """Access denied; `answer` has the reason, also for a WebSocket."""

    def __init__(self, answer: Response) -> None:
        super().__init__()
        self.answer = answer


class Guard:
    """Pure ASGI, so that a WebSocket is looked at as a request is, and nothing is buffered."""

    def __init__(self, app: ASGIApp, *, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        match scope["type"]:
            case "http":
                await self._request(scope, receive, send)
            case "websocket":
                await self._socket(scope, receive, send)
            case "lifespan":
                await self._app(scope, receive, send)
            case other:
                raise RuntimeError(f"a {other} connection is not authorized by any rule")

    # -- requests ----------------------------------------------------------------------------------------------------

    async def _request(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            known = self._let_in(scope)
        except _Refused as refused:
            await refused.answer(scope, receive, send)
            return
        if known is None:
            await self._app(scope, receive, send)
            return
        scope[SCOPE_KEY] = known.who
        if known.by == "local":
            await self._app(scope, receive, send)
            return
        has_begun = False

        async def answer(message: Message) -> None:
            nonlocal has_begun
            if message["type"] == "http.response.start":
                has_begun = True
                if known.is_to_renew is not None:
                    MutableHeaders(scope=message).append("Set-Cookie", known.is_to_renew)
            await send(message)

        with self._access.visits.of(known.who.id, is_socket=False) as visit:
            try:
                await self._app(scope, receive, answer)
            except asyncio.CancelledError as cancelled:
                because = _ended(visit, cancelled)  # an answer half given breaks off, and the connection with it
                if not has_begun:
                    await problem(401, because, code="removed")(scope, receive, send)

    def _let_in(self, scope: Scope) -> Admitted | None:
        """The sender; None: unknown on a public route. Raises _Refused."""
        method, path = scope["method"], scope["path"]
        headers = self._headers(scope)
        self._check_names(headers, scope["scheme"])
        site, mode = headers.get("sec-fetch-site"), headers.get("sec-fetch-mode")
        if site in ("cross-site", "same-site") and mode != "navigate":  # an image or a script of another page
            raise _Refused(problem(403, "This request comes from another server's page.", code="origin"))
        needs = needs_of(method, path)
        known = self._access.known(headers, scheme=scope["scheme"])
        by_browser = known is None or known.by == "cookie"
        if by_browser and method not in _CHANGES_NOTHING and "origin" not in headers:
            if known is not None or needs is Needs.NOBODY:
                raise _Refused(problem(403, "The request has no Origin header.", code="origin"))
        if needs is Needs.NOBODY:
            return known
        if known is None:
            raise _Refused(self._unknown(scope, headers, mode))
        if not is_enough(known.who.role, needs):
            raise _Refused(problem(403, "A viewer cannot make changes; an operator can.", code="viewer"))
        return known

    def _unknown(self, scope: Scope, headers: dict[str, str], mode: str | None) -> Response:
        code, sentence = self._access.why_unknown(headers, scheme=scope["scheme"])
        if mode == "navigate" and scope["method"] == "GET" and code != "key":
            # A link in a mail, say: the page pairs this device and leads on. A cookie that is Strict does not come
            # along on the way from another site, so that a device which is paired passes here too.
            query = f"?{scope['query_string'].decode('latin-1')}" if scope["query_string"] else ""
            then = quote(f"{quote(scope['path'])}{query}", safe="")
            return RedirectResponse(f"/?then={then}", status_code=303)
        answer = problem(401, sentence, code=code)
        answer.headers["WWW-Authenticate"] = "Bearer"
        return answer

    # -- sockets -----------------------------------------------------------------------------------------------------

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            known = self._let_socket_in(scope)
        except _Refused as refused:
            await refused.answer(scope, receive, send)
            return
        scope[SCOPE_KEY] = known.who
        with self._access.visits.of(known.who.id, is_socket=True) as visit:
            try:
                await self._app(scope, receive, send)
            except asyncio.CancelledError as cancelled:
                reason = _ended(visit, cancelled).encode()[:120].decode(errors="ignore")
                with contextlib.suppress(RuntimeError, OSError):  # it may have been closing by itself
                    await send({"type": "websocket.close", "code": ENDED, "reason": reason})

    def _let_socket_in(self, scope: Scope) -> Admitted:
        """Who opens it. Raises _Refused."""
        scheme = "https" if scope["scheme"] == "wss" else "http"
        headers = self._headers(scope)
        self._check_names(headers, scheme)
        known = self._access.known(headers, scheme=scheme)
        if known is None:
            answer = problem(401, "This device is not paired with the server.")
            answer.headers["WWW-Authenticate"] = "Bearer"
            raise _Refused(answer)
        if known.by == "cookie":
            is_used = [self._access.use_ticket(ticket, known.who) for ticket in _tickets(scope)]
            if is_used != [True] or "origin" not in headers:
                raise _Refused(problem(403, "A socket needs a new ticket."))
        return known

    # -- both --------------------------------------------------------------------------------------------------------

    def _headers(self, scope: Scope) -> dict[str, str]:
        found: dict[str, str] = {}
        for raw_name, raw_value in scope["headers"]:
            name, value = raw_name.decode("latin-1").lower(), raw_value.decode("latin-1")
            if name in found and name in _ALONE:
                raise _Refused(problem(400, f"The header {name} is in this request more than once."))
            found[name] = f"{found[name]}; {value}" if name in found and name == "cookie" else value
        return found

    def _check_names(self, headers: dict[str, str], scheme: str) -> None:
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self._access.names.knows(host):
            shown = "".join(letter for letter in host if letter.isascii() and letter.isprintable())[:60]
            remedy = f"Start it with --name {shown.rpartition(':')[0] or shown} if it is to be." if shown else ""
            raise _Refused(problem(403, f"This server is not called “{shown}”. {remedy}".strip(), code="host"))
        if origin is not None and not self._access.names.may_ask(origin, scheme=scheme, host=host):
            raise _Refused(problem(403, "This request comes from another server's page.", code="origin"))


def _tickets(scope: Scope) -> list[str]:
    try:
        fields = parse_qsl(scope["query_string"].decode("latin-1"), max_num_fields=20)
    except ValueError:
        return []
    return [value for name, value in fields if name == "ticket"]


def _ended(visit: ActiveConnection, cancelled: asyncio.CancelledError) -> str:
    """Why the connection was ended by us; any other cancellation is propagated."""
    if visit.ended_because is None:
        raise cancelled
    visit.task.uncancel()
    return visit.ended_because

"""Every error as a problem document (RFC 9457), with one sentence for a person."""

from __future__ import annotations

import json
import logging
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send

from server.bus.bus import NotServed
from server.web.interface import PROBLEM_TYPE
from server.web.middleware.methods import allowed

log = logging.getLogger("catgraph.web")

# Of RFC 9110, where Python before 3.13 has those of older RFCs.
PHRASES = {413: "Content Too Large", 414: "URI Too Long", 416: "Range Not Satisfiable", 422: "Unprocessable Content"}


class _Document(JSONResponse):
    def render(self, content: Any) -> bytes:
        """Half characters, which a name in a request may hold, become question marks."""
        return json.dumps(content, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")


class Problem(HTTPException):
    """An error with further members of its problem document, `more`."""

    def __init__(self, status: int, detail: str, **more: Any) -> None:
        super().__init__(status, detail)
        self.more = more


def problem(status: int, detail: str, **more: Any) -> JSONResponse:
    """A problem document; `type` is about:blank, so `title` is the status as text."""
    title = PHRASES.get(status) or HTTPStatus(status).phrase
    body = {"type": "about:blank", "title": title, "status": status, "detail": detail, **more}
    return _Document(body, status_code=status, media_type=PROBLEM_TYPE)


def problem_of(error: HTTPException) -> JSONResponse:
    """The same of an error that was raised."""
    answer = problem(error.status_code, str(error.detail), **getattr(error, "more", {}))
    answer.headers.update(error.headers or {})
    return answer


def install(app: FastAPI) -> None:
    """Lets the app answer all its errors this way, also those of a WebSocket's handshake."""
    app.router.default = _not_found

    @app.exception_handler(HTTPException)
    async def of_http(request: Request, error: HTTPException) -> Response:
        if error.status_code == 405:
            return _of_method(request)
        return problem_of(error)

    @app.exception_handler(NotServed)
    async def of_agent(_: Request, error: NotServed) -> JSONResponse:
        return problem(503, f"{str(error)[:1].upper()}{str(error)[1:]}.")

    @app.exception_handler(RequestValidationError)
    async def of_validation(_: Request, error: RequestValidationError) -> JSONResponse:
        faults = [
            {"where": ".".join(str(part) for part in fault["loc"][1:]), "what": fault["msg"]}
            for fault in error.errors()
        ]
        first = faults[0] if faults else {"where": "", "what": "not understood"}
        return problem(422, f"{first['where'] or 'The request'}: {first['what']}.", errors=faults[:20])

    @app.exception_handler(Exception)
    async def of_bug(_: Request, error: Exception) -> JSONResponse:
        log.error("a request failed", exc_info=error)
        return problem(500, "Internal server error; the server's log has the details.")


async def _not_found(_scope: Scope, _receive: Receive, _send: Send) -> None:
    """Raise the error of an unknown address; the router's own closes a WebSocket without a reason."""
    raise HTTPException(404)


def _of_method(request: Request) -> Response:
    """No route of the path takes the method: which are taken, which is also the answer to OPTIONS."""
    methods = allowed(request.app.routes, request.scope)
    if request.method == "OPTIONS":
        return Response(status_code=204, headers={"Allow": methods})
    answer = problem(405, f"This address takes {methods}.")
    answer.headers["Allow"] = methods
    return answer

"""Responses in the description of the HTTP interface: media types, and problems by their status.

A route names what it gives beyond its model: `raises(404, 409)`, `files("text/csv")`. What the access guard, the
throttle and the validation give to any route is added here, once.
"""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import models_json_schema

from server.access.identity import Needs, needs_of

PROBLEM_TYPE = "application/problem+json"
_SCHEMAS = "#/components/schemas/"
PROBLEMS: dict[int, str] = {  # status → when a route answers with it
    400: "The request is malformed",
    401: "The server does not know this device or program",
    403: "It may not do this, or the request comes from another server's page",
    404: "There is no such thing on this server",
    408: "The body did not come to its end in time",
    409: "Refused in the present state; `detail` has the reason",
    413: "The body is too long",
    415: "The body is of a kind that is not taken",
    416: "The file has no such range",
    422: "A parameter or a field is wrong, as `errors` or `field` names it",
    429: "Too many requests: the header Retry-After has the seconds to wait",
    500: "An error of this server, which its log describes",
    502: "Another server failed: of mail, of the store, or the agent of a car",
    503: "The car, its agent or a disk does not answer",
    507: "There is no room on the disk",
}
_OF_ANY = (400, 401, 403, 429, 500)
_OF_BODIES = (408, 413)
OF_KEPT = (404, 422, 502, 503)  # of what an agent keeps: a web node passes the request on
Responses = dict[int | str, dict[str, Any]]


class WrongField(BaseModel):
    where: str = Field(description="The parameter or field, as `body.name`; empty: the request")
    what: str


class ProblemDocument(BaseModel):
    """An error (RFC 9457). Some have further members, as the state of an export that is not ready."""

    model_config = ConfigDict(extra="allow")
    type: str = Field("about:blank", description="Always about:blank: `title` is the status as text")
    title: str
    status: int
    detail: str = Field(description="One sentence for a person")
    errors: list[WrongField] = Field(default=[], description="Of a request that is not valid: at most 20")
    field: str | None = Field(None, description="The field that is wrong")
    code: str | None = Field(None, description="Of access: the reason, for programs")
    wait_s: float | None = Field(None, description="Try again after so long")


def raises(*statuses: int) -> Responses:
    """Problems for `responses` of a route or router."""
    content = {PROBLEM_TYPE: {"schema": {"$ref": f"{_SCHEMAS}ProblemDocument"}}}
    return {status: {"description": PROBLEMS[status], "content": content} for status in statuses}


def files(*media_types: str, in_parts: bool = False) -> Responses:
    """A file of one of these types as the answer, for `responses`; `in_parts`: with ranges, and 304."""
    content = {name: {"schema": _of_type(name)} for name in (one.partition(";")[0] for one in media_types)}
    whole: Responses = {200: {"content": content}}
    if not in_parts:
        return whole
    return whole | {206: {"description": "A range of it", "content": content}} | UNCHANGED | raises(416)


UNCHANGED: Responses = {304: {"description": "As it was: the same ETag"}}


def takes(*media_types: str) -> dict[str, Any]:
    """A body that is a file of one of these types, for `openapi_extra`."""
    content = {name: {"schema": _of_type(name)} for name in media_types}
    return {"requestBody": {"required": True, "content": content}}


def _of_type(media_type: str) -> dict[str, str]:
    if media_type.endswith("json"):
        return {"type": "object"}
    is_text = media_type.startswith("text/") or media_type.endswith(("xml", "toml"))
    return {"type": "string"} if is_text else {"type": "string", "format": "binary"}


def described(app: FastAPI) -> dict[str, Any]:
    """The description of the interface: FastAPI's own, with the problems that any route may give."""
    schema = FastAPI.openapi(app)
    schemas = schema["components"]["schemas"]
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    _, made = models_json_schema([(ProblemDocument, "serialization")], ref_template=f"{_SCHEMAS}{{model}}")
    schemas.update(made["$defs"])
    for name, model in schemas.items():
        model["title"] = name.rstrip(
            "_"
        )  # clients name classes after it; those of a generic model are else all the same
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            _add_problems(method.upper(), path, operation)
    return schema


def _add_problems(method: str, path: str, operation: dict[str, Any]) -> None:
    answers = operation["responses"]
    statuses = [*_OF_ANY]
    if "requestBody" in operation:
        statuses += _OF_BODIES
    if answers.get("422", {}).get("description") == "Validation Error":
        del answers["422"]
        statuses.append(422)
    if needs_of(method, path) is Needs.NOBODY:
        statuses.remove(401)
    for status, answer in raises(*statuses).items():
        answers.setdefault(str(status), answer)
    operation["responses"] = dict(sorted(answers.items()))

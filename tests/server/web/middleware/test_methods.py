"""HEAD wherever GET is, the methods of a path on 405 and OPTIONS, and every error as a problem document."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest_asyncio
from starlette.types import Message, Receive, Scope, Send

from server.app.app import create_app
from server.app.config import Config
from server.web.interface import PROBLEM_TYPE, ProblemDocument
from server.web.middleware.methods import HeadAsGet
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.recording.made import record

DRIVE = "car_20260921T141320Z"
PAGES = ("/", "/fleet", "/offline", "/worker.js", "/manifest.webmanifest", "/docs", "/openapi.json")
STATIC = ("/static/css/tokens.css", "/static/fonts/catgraph-numerals-500.woff2", "/static/js/missing.js")
VALUES = {"id": DRIVE, "check": "speed_limit", "format": "gpx", "mark": "a-mark", "job": "none", "n": "1", "z": "1"}


@pytest_asyncio.fixture
async def client(tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    record(tmp_path / "recordings" / "car" / f"{DRIVE}.mcap", seconds=2.0)
    async with serving(Config(data=tmp_path)) as base, http_client(base_url=base) as client:
        yield client


def filled(path: str) -> str:
    for name in ("vehicle", "intervention", "name", "x", "y", "folder"):
        path = path.replace(f"{{{name}}}", "1")
    for name, value in VALUES.items():
        path = path.replace(f"{{{name}}}", value)
    return path


def described() -> dict[str, dict[str, Any]]:
    paths: dict[str, dict[str, Any]] = create_app(Config()).openapi()["paths"]
    return {filled(path): methods for path, methods in paths.items()}


async def test_head_is_get_without_the_body(client: httpx.AsyncClient) -> None:
    made_first = (f"/api/recordings/{DRIVE}/export/gpx", f"/api/recordings/{DRIVE}/report")  # slow, and files as others
    reads = [path for path, methods in described().items() if "get" in methods and path not in made_first]
    assert len(reads) > 45
    found = set()
    for path in (*reads, *PAGES, *STATIC):
        whole, head = await client.get(path), await client.head(path)
        found.add(whole.status_code)
        assert (head.status_code, head.content) == (whole.status_code, b""), path
        assert head.headers.keys() == whole.headers.keys(), path
        changing = {"date"} if path in (*PAGES, *STATIC) else {"date", "content-length", "etag"}  # live data
        for name in head.headers.keys() - changing:
            assert head.headers[name] == whole.headers[name], (path, name)
    assert found >= {200, 404}


async def test_only_a_body_becomes_the_end_of_an_answer_to_head() -> None:
    """A test client is sent more than an answer, before it."""
    passed: list[Message] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.debug", "info": {}})
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"one", "more_body": True})
        await send({"type": "http.response.body", "body": b"two"})

    async def receive() -> Message:
        raise AssertionError

    async def send(message: Message) -> None:
        passed.append(message)

    await HeadAsGet(app)({"type": "http", "method": "HEAD"}, receive, send)
    assert [(one["type"], one.get("body")) for one in passed] == [
        ("http.response.start", None),
        ("http.response.body", b""),
    ]


async def test_head_of_a_file_has_its_whole_length_and_ignores_ranges(client: httpx.AsyncClient) -> None:
    path = f"/api/recordings/{DRIVE}/file.mcap"
    whole = await client.get(path)
    head = await client.head(path, headers={"Range": "bytes=0-9"})
    assert (head.status_code, head.headers["content-length"]) == (200, str(len(whole.content)))
    assert (await client.get(path, headers={"Range": "bytes=0-9"})).status_code == 206


async def test_allow_names_all_methods_of_a_path(client: httpx.AsyncClient) -> None:
    paths = create_app(Config()).openapi()["paths"].items()
    templates = [(re.compile(re.sub(r"{\w+}", "[^/]+", path)), methods) for path, methods in paths]
    for path in described():
        fit = [methods for template, methods in templates if template.fullmatch(path)]
        taken = {method.upper() for methods in fit for method in methods}
        taken |= {"OPTIONS"} | ({"HEAD"} if "GET" in taken else set())
        refused, options = await client.request("PROPFIND", path), await client.options(path)
        assert (refused.status_code, options.status_code, options.content) == (405, 204, b""), path
        for answer in (refused, options):
            assert set(answer.headers["allow"].split(", ")) == taken, path
        assert ProblemDocument.model_validate(refused.json()).status == 405
        assert refused.headers["content-type"] == PROBLEM_TYPE
    for path in (*PAGES, *STATIC[:1]):
        refused = await client.delete(path)
        assert (refused.status_code, refused.headers["allow"]) == (405, "GET, HEAD, OPTIONS"), path
        assert refused.headers["content-type"] == PROBLEM_TYPE


async def test_every_error_is_a_problem_document(client: httpx.AsyncClient) -> None:
    requests = {
        400: client.get("/api/me", headers=[("Authorization", "a"), ("Authorization", "b")]),
        403: client.get("/api/me", headers={"Host": "elsewhere.example"}),
        404: client.get("/api/nothing"),
        405: client.post("/static/css/tokens.css"),
        413: client.put("/api/settings.toml", content=b" " * 300_000),
        415: client.post("/api/marks/a-mark/voice", content=b"x", headers={"Content-Type": "text/plain"}),
        416: client.get(f"/api/recordings/{DRIVE}/file.mcap", headers={"Range": "bytes=99999999-"}),
        422: client.get("/api/events?limit=none"),
    }
    for status, asking in requests.items():
        answer = await asking
        if status == 415:
            assert answer.status_code in (409, 415), "there is no such mark"
        else:
            assert answer.status_code == status, answer.text
        assert answer.headers["content-type"] == PROBLEM_TYPE
        problem = ProblemDocument.model_validate(answer.json())
        assert (problem.status, problem.type) == (answer.status_code, "about:blank")
        assert problem.title
        assert problem.detail
        assert bool(problem.errors) is (status == 422)

"""The description of the HTTP interface is valid, and has the answers of every route."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest
from openapi_spec_validator import OpenAPIV31SpecValidator
from pydantic import TypeAdapter

from server.app.app import create_app
from server.app.config import Config
from server.protocol.http_answers import Health
from server.web.interface import PROBLEM_TYPE, PROBLEMS
from tests.http import http_client
from tests.server.conftest import serving

PROBLEM = {"$ref": "#/components/schemas/ProblemDocument"}


@cache
def description() -> dict[str, Any]:
    return create_app(Config()).openapi()


def operations() -> list[tuple[str, dict[str, Any]]]:
    paths = description()["paths"].items()
    return [(f"{method.upper()} {path}", one) for path, methods in paths for method, one in methods.items()]


def test_a_validator_of_openapi_finds_nothing() -> None:
    assert list(OpenAPIV31SpecValidator(description()).iter_errors()) == []


def test_every_answer_has_a_type() -> None:
    found = operations()
    assert len(found) > 90
    for name, operation in found:
        good = [answer for status, answer in operation["responses"].items() if status in ("200", "202")]
        assert len(good) == 1, name
        assert good[0]["content"], name
        for media_type, body in good[0]["content"].items():
            assert body["schema"], (name, media_type)
            if media_type == "application/json" and "format" not in name:
                assert {"$ref", "items"} & set(body["schema"]) or "file" in name, (name, body["schema"])


def test_every_error_is_described_as_a_problem_document() -> None:
    for name, operation in operations():
        for status, answer in operation["responses"].items():
            if int(status) < 400 or (name, status) == ("GET /api/health", "503"):
                continue
            assert answer["content"] == {PROBLEM_TYPE: {"schema": PROBLEM}}, (name, status)
            assert answer["description"] == PROBLEMS[int(status)]
        assert {"400", "403", "429", "500"} <= set(operation["responses"]), name
    assert "HTTPValidationError" not in description()["components"]["schemas"]


@pytest.mark.parametrize(
    ("name", "media_type"),
    [
        ("GET /api/settings.toml", "application/toml"),
        ("GET /api/departure.toml", "application/toml"),
        ("GET /api/log.csv", "text/csv"),
        ("GET /api/logbook.csv", "text/csv"),
        ("GET /api/recordings/{id}/file.mcap", "application/x-mcap"),
        ("GET /api/recordings/{id}/report", "text/html"),
        ("GET /api/recordings/{id}/track.svg", "image/svg+xml"),
        ("GET /api/recordings/{id}/export/{format}", "application/gpx+xml"),
        ("GET /metrics", "text/plain"),
    ],
)
def test_what_is_not_json_has_its_own_media_type(name: str, media_type: str) -> None:
    content = dict(operations())[name]["responses"]["200"]["content"]
    assert media_type in content
    assert "application/json" not in content or "{format}" in name


async def test_the_answer_about_the_servers_health_is_as_described(tmp_path: Path) -> None:
    async with serving(Config(data=tmp_path)) as base, http_client(base_url=base) as client:
        answer = await client.get("/api/health")
    TypeAdapter(Health).validate_json(answer.content, strict=True)
    assert "lost" in answer.json()

"""Every answer carries the headers, whatever it answers: pages, parts, data, nothing new, refusals, mistakes."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path

import httpx
import pytest
import websockets
from fastapi import Request

from server.app.app import create_app
from server.app.config import Config
from server.system.page_files import static_dir
from server.web.assets.bundle import find
from server.web.middleware.headers import (
    FOR_ALL,
    PERMISSIONS,
    POLICY,
    POLICY_OF_DATA,
    POLICY_OF_PARTS,
    POLICY_OF_REPORT,
    policy_of,
)
from server.web.routes.pages import early_of
from tests.http import http_client
from tests.server.conftest import serving, serving_app
from tests.server.recording.made import record

ID = "car_20160601T120000Z"
POLICY_RULES = dict(rule.strip().split(" ", 1) for rule in POLICY.split(";"))
POLICY_OF_PAGES = policy_of(early_of(find(static_dir()), static_dir()))
ANSWERS = {  # method, path, headers, status, its policy
    "the page": ("GET", "/", {}, 200, POLICY_OF_PAGES),
    "the page without a server": ("GET", "/offline", {}, 200, POLICY_OF_PAGES),
    "its description": ("GET", "/docs", {}, 200, POLICY),
    "its worker": ("GET", "/worker.js", {}, None, POLICY),
    "a part": ("GET", "/static/js/main.js", {}, 200, POLICY_OF_PARTS),
    "a picture": ("GET", "/static/icons/catgraph.svg", {}, 200, POLICY_OF_PARTS),
    "the manifest": ("GET", "/manifest.webmanifest", {}, 200, POLICY_OF_PARTS),
    "no part": ("GET", "/static/js/nothing.js", {}, 404, POLICY_OF_PARTS),
    "data": ("GET", "/api/state", {}, 200, POLICY_OF_DATA),
    "what is drawn": ("GET", f"/api/recordings/{ID}/track.svg", {}, None, POLICY_OF_DATA),
    "a report": ("GET", "/api/recordings/none/report", {}, 404, POLICY_OF_REPORT),
    "a file": ("GET", f"/api/recordings/{ID}/file.mcap", {}, 200, POLICY_OF_DATA),
    "a part of a file": ("GET", f"/api/recordings/{ID}/file.mcap", {"Range": "bytes=0-9"}, 206, POLICY_OF_DATA),
    "no part of a file": ("GET", f"/api/recordings/{ID}/file.mcap", {"Range": "bytes=99999999-"}, 416, POLICY_OF_DATA),
    "counters": ("GET", "/metrics", {}, 200, POLICY_OF_DATA),
    "no such thing": ("GET", "/nothing", {}, 404, POLICY),
    "not so": ("PUT", "/", {}, 405, POLICY),
    "not understood": ("POST", "/api/connect", {"Content-Type": "application/json"}, 422, POLICY_OF_DATA),
    "done": ("POST", "/api/disconnect", {}, 200, POLICY_OF_DATA),
    "too long": ("POST", "/api/connect", {"Content-Type": "text/plain"}, 413, POLICY_OF_DATA),
    "a stranger's page": ("POST", "/api/disconnect", {"Origin": "http://evil.example"}, 403, POLICY_OF_DATA),
    "another name": ("GET", "/", {"Host": "evil.example"}, None, POLICY),
}


@pytest.mark.parametrize(("method", "path", "sent", "status", "its_policy"), ANSWERS.values(), ids=ANSWERS)
async def test_every_answer_has_them(
    method: str, path: str, sent: dict[str, str], status: int | None, its_policy: str, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    record(data / "recordings" / "car" / f"{ID}.mcap", seconds=2.0)
    async with serving(Config(data=data)) as base, http_client(base_url=base) as client:
        answer = await client.request(method, path, headers=sent, content=b"x" * 300_000 if status == 413 else None)
        assert status in (answer.status_code, None), answer.text
        _has_all(answer.headers, its_policy)
        if answer.content:
            kind = answer.headers["content-type"]
            assert not kind.startswith("text/") or "charset=utf-8" in kind


async def test_what_is_kept_is_renewed_with_them() -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        for path, its_policy in (("/", POLICY_OF_PAGES), ("/static/js/main.js", POLICY_OF_PARTS)):
            first = await client.get(path)
            again = await client.get(path, headers={"If-None-Match": first.headers["etag"]})
            assert again.status_code == 304
            _has_all(again.headers, its_policy)


async def test_a_mistake_of_ours_is_answered_with_them() -> None:
    config = Config()
    app = create_app(config)

    @app.get("/api/mistake")
    async def mistake(request: Request) -> None:
        raise RuntimeError("secret words of a traceback")

    async with serving_app(app, config) as base, http_client(base_url=base) as client:
        answer = await client.get("/api/mistake")
        assert answer.status_code == 500
        assert answer.json()["detail"] == "Internal server error; the server's log has the details."
        assert "secret words" not in answer.text
        _has_all(answer.headers, POLICY_OF_DATA)


async def test_a_socket_that_is_refused_is_refused_with_them() -> None:
    async with serving(Config()) as base:
        with pytest.raises(websockets.InvalidStatus) as refused:
            await websockets.connect(f"{base.replace('http', 'ws')}/ws", origin="http://evil.example")  # type: ignore[arg-type]
        _has_all(httpx.Headers(list(refused.value.response.headers.raw_items())), POLICY)


@pytest.mark.parametrize(
    ("path", "origin", "status", "detail"),
    [
        ("/ws", "http://evil.example", 403, "This request comes from another server's page."),
        ("/wss", None, 404, "Not Found"),
        ("/api/health", None, 404, "Not Found"),
        ("/ws?vehicle=nobody", None, 404, "No vehicle is named nobody."),
    ],
)
async def test_a_refused_socket_gets_the_same_document_as_a_request(
    path: str, origin: str | None, status: int, detail: str, caplog: pytest.LogCaptureFixture
) -> None:
    async with serving(Config()) as base:
        with pytest.raises(websockets.InvalidStatus) as refused:
            await websockets.connect(f"{base.replace('http', 'ws')}{path}", origin=origin)  # type: ignore[arg-type]
        response = refused.value.response
        assert response.headers["content-type"] == "application/problem+json"
        document = json.loads(response.body)
        assert (response.status_code, document["status"], document["detail"]) == (status, status, detail)
    assert [record for record in caplog.records if record.levelname == "ERROR"] == []


def _has_all(headers: httpx.Headers, its_policy: str) -> None:
    for name in FOR_ALL:
        assert headers[name], name
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["content-security-policy"] == its_policy
    is_document = its_policy in (POLICY, POLICY_OF_PAGES)
    assert ("permissions-policy" in headers) == is_document
    assert ("cross-origin-opener-policy" in headers) == is_document
    assert "default-src 'none'" in its_policy
    assert "object-src 'none'" in its_policy
    assert "base-uri 'none'" in its_policy
    for name in ("strict-transport-security", "access-control-allow-origin", "server", "x-powered-by"):
        assert name not in headers


@pytest.mark.parametrize("path", ["/", "/offline"])
async def test_the_one_script_in_a_page_is_allowed_by_its_content_and_nothing_else_is(path: str) -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        answer = await client.get(path)
    (script,) = re.findall(r"<script>(.*?)</script>", answer.text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    rules = dict(rule.strip().split(" ", 1) for rule in answer.headers["content-security-policy"].split(";"))
    assert rules == POLICY_RULES | {"script-src": f"'self' 'sha256-{digest}'"}
    assert not re.search(r"<style|\son[a-z]+=", answer.text)


def test_the_page_may_run_only_its_own_scripts_and_use_only_what_it_needs() -> None:
    rules = POLICY_RULES
    assert rules["script-src"] == rules["connect-src"] == rules["style-src"] == "'self'"
    assert rules["require-trusted-types-for"] == "'script'"
    assert rules["trusted-types"] == "default"
    assert not [rule for rule in rules.values() if "unsafe" in rule or "*" in rule or "http" in rule]
    assert "geolocation=(self)" in PERMISSIONS
    assert "screen-wake-lock=(self)" in PERMISSIONS
    assert "camera=()" in PERMISSIONS
    assert "microphone=(self)" in PERMISSIONS  # the voice of a mark
    assert rules["media-src"] == "'self' blob:"

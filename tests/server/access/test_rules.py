"""A viewer can do nothing that an operator may, and who is not known nothing at all: of every route and every command
that there is, so that a new one cannot be forgotten."""

from __future__ import annotations

import asyncio
import json
import re
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.routing import BaseRoute, Mount, Route

from server.access.identity import Needs, Role, needs_of
from server.app.app import create_app
from server.protocol import commands
from tests.http import http_client
from tests.server.access.pairs import VIEWER_KEY, config, cookie_of, keyed, paired_server

# What anybody may ask for, and what a viewer may order. A line here is a decision, and needs a reason like a door does.
FOR_ANYBODY = {
    "GET /",
    "GET /api/health",
    "GET /apple-touch-icon.png",
    "GET /favicon.ico",
    "GET /fleet",
    "GET /manifest.webmanifest",
    "GET /offline",
    "GET /worker.js",
    "POST /api/pair",
}
VIEWERS_ORDERS = {"POST /api/ticket"}
NOT_FOR_VIEWERS_TO_READ = {f"GET /api/{name}" for name in ("devices", "people", "mail", "mail/settings", "mail/{n}")}


def walk(routes: list[BaseRoute]) -> Iterator[BaseRoute]:
    for route in routes:
        inner = getattr(route, "original_router", None)  # FastAPI keeps an included router as one
        if inner is not None:
            yield from walk(inner.routes)
        else:
            yield route


def all_routes() -> list[tuple[str, str]]:
    """Method and path of each; a path as it is requested, its parameters filled in."""
    found: list[tuple[str, str]] = []
    for route in walk(create_app(config()).routes):
        match route:
            case APIWebSocketRoute() | Mount():
                continue  # the one socket has its own tests; the one mount is the static files
            case APIRoute() | Route():
                found += [(method, route.path) for method in sorted(route.methods or {"*"})]
            case other:
                raise AssertionError(f"nobody judges a {type(other).__name__}")
    return found


ROUTES = all_routes()


def requested(path: str) -> str:
    return re.sub(r"\{[^}]+\}", "1", path)


def test_the_walk_finds_the_routes() -> None:
    assert {("POST", "/api/pause"), ("GET", "/metrics"), ("GET", "/"), ("GET", "/openapi.json")} <= set(ROUTES)
    assert len(ROUTES) > 55


def test_there_is_one_socket_and_one_mount() -> None:
    kinds = [(type(route), getattr(route, "path", None)) for route in walk(create_app(config()).routes)]
    assert [one for one in kinds if one[0] in (APIWebSocketRoute, Mount)] == [
        (APIWebSocketRoute, "/ws"),
        (Mount, "/static"),
    ]


@pytest.mark.parametrize(("method", "path"), ROUTES, ids=[f"{method} {path}" for method, path in ROUTES])
def test_each_route_needs_what_its_method_needs_or_is_named_here(method: str, path: str) -> None:
    name = f"{'GET' if method == 'HEAD' else method} {path}"
    if name in FOR_ANYBODY:
        expected = Needs.NOBODY
    elif name in VIEWERS_ORDERS:
        expected = Needs.VIEWER
    elif method in ("GET", "HEAD") and name not in NOT_FOR_VIEWERS_TO_READ:
        expected = Needs.VIEWER
    else:
        expected = Needs.OPERATOR
    assert needs_of(method, requested(path)) is expected


@pytest.mark.parametrize("path", ["/api/x", "/api/health/x", "/x", "/", "/static/x", "/api/pair/x"])
@pytest.mark.parametrize(
    "method", ["POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT", "PROPFIND", "get", ""]
)
def test_what_nobody_thought_of_needs_an_operator(method: str, path: str) -> None:
    assert needs_of(method, path) is Needs.OPERATOR


async def test_no_route_answers_who_is_not_known_and_none_obeys_a_viewer(tmp_path: Path) -> None:
    """The very routes of the app, over a real socket: by a stranger's browser, by a viewer's, by a viewer's key."""
    async with (
        paired_server(keyed(tmp_path)) as served,
        served.browser() as stranger,
        served.paired(Role.VIEWER) as viewer,
        http_client(base_url=served.base, headers={"Authorization": f"Bearer {VIEWER_KEY}"}) as program,
    ):
        for method, path in ROUTES:
            needs = needs_of(method, requested(path))
            if needs is Needs.NOBODY:
                continue
            answer = await stranger.request(method, requested(path), json={})
            assert answer.status_code == 401, (method, path)
            for client in (viewer, program):
                if needs is Needs.OPERATOR:
                    answer = await client.request(method, requested(path), json={})
                    assert (answer.status_code, answer.json()["code"]) == (403, "viewer"), (method, path)
                else:
                    assert (await client.request(method, requested(path))).status_code not in (401, 403), (method, path)


# -- commands ----------------------------------------------------------------------------------------------------------

COMMANDS = get_args(commands.Command)


def test_every_command_says_what_it_needs() -> None:
    assert isinstance(commands.Command, types.UnionType)
    assert {command.needs for command in COMMANDS} <= {"operator", "control"}


def kind_of(command: Any) -> str:
    return str(get_args(command.model_fields["kind"].annotation)[0])


async def test_a_viewers_socket_orders_nothing(tmp_path: Path) -> None:
    """Each command of the union, and what is no command; an operator's is refused for other reasons, or done."""
    async with paired_server(keyed(tmp_path)) as served:
        for role in (Role.VIEWER, Role.OPERATOR):
            async with served.paired(role, role.value) as browser:
                async with served.socket(await served.ticket(browser), cookie=cookie_of(browser)) as page:
                    readings = ["state", "settings", "signals", "nonsense"] if role is Role.VIEWER else []
                    kinds = [*map(kind_of, COMMANDS), *readings]
                    for kind in kinds:
                        await page.send(json.dumps({"kind": kind, "id": kind}))
                    wanted = set(kinds) - {"present"}  # nobody answers that one
                    replies: dict[str, dict[str, Any]] = {}
                    async with asyncio.timeout(10):
                        while wanted - set(replies):
                            got = await page.recv()
                            message = json.loads(got) if isinstance(got, str) else {}
                            if message.get("kind") == "reply":
                                replies[message["id"]] = message
                    refusals = [
                        one.get("reason", "").startswith("This device is paired as a viewer")
                        for one in replies.values()
                    ]
                    assert set(refusals) == {role is Role.VIEWER}
                    # To turn its own page to a recording changes nothing for anybody.
                    await page.send(json.dumps({"kind": "replay", "id": "r", "do": "leave"}))
                    async with asyncio.timeout(10):
                        while (message := json.loads(await page.recv())).get("id") != "r":
                            pass
                    assert message["ok"] is True

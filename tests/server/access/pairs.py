"""A server that pairs, and devices that come to it: what a browser sends, by hand."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import websockets

from server.access.access import Access
from server.access.credentials import keys_of
from server.access.identity import Role
from server.app.app import create_app
from server.app.config import Config, Tls
from server.storage.storage_thread import StorageThread
from tests.http import http_client
from tests.server.conftest import serving_app

OPERATOR_KEY = "operator-key-of-the-tests"
VIEWER_KEY = "viewer-key-of-the-tests-"


def config(data: Path | None = None, **more: Any) -> Config:
    """Of a server that listens everywhere, without TLS."""
    return Config(host="0.0.0.0", tls=Tls(mode="off"), data=data, **more)


def keyed(data: Path | None = None) -> Config:
    return config(data, keys=keys_of({Role.OPERATOR: OPERATOR_KEY, Role.VIEWER: VIEWER_KEY}))


class Served:
    """A server on a real socket, and its own end of access."""

    def __init__(self, base: str, access: Access) -> None:
        self.base = base
        self.access = access

    @property
    def host(self) -> str:
        return self.base.removeprefix("http://")

    def browser(self, **headers: str) -> httpx.AsyncClient:
        """One that is not paired: its Origin is that of the page."""
        return http_client(base_url=self.base, headers={"Origin": self.base} | headers)

    @contextlib.asynccontextmanager
    async def paired(self, role: Role, name: str = "Pixel 7") -> AsyncIterator[httpx.AsyncClient]:
        """A browser that was paired; its cookie is in it."""
        async with self.browser() as browser:
            answer = await browser.post("/api/pair", json={"token": self.access.invitation(role).token, "name": name})
            assert answer.status_code == 200, answer.text
            yield browser

    async def ticket(self, browser: httpx.AsyncClient) -> str:
        answer = await browser.post("/api/ticket")
        assert answer.status_code == 200, answer.text
        return str(answer.json()["ticket"])

    def socket(self, ticket: str | None = None, *, cookie: str | None = None, **headers: str) -> Any:
        """A socket as a page of this server opens it; a header given as "" is left out."""
        sent = {"Origin": self.base} | ({"Cookie": cookie} if cookie else {}) | headers
        query = f"?ticket={ticket}" if ticket is not None else ""
        shown = {name.replace("_", "-"): value for name, value in sent.items() if value}
        return websockets.connect(f"ws://{self.host}/ws{query}", additional_headers=shown)


def cookie_of(browser: httpx.AsyncClient) -> str:
    """The Cookie header that the browser sends."""
    return "; ".join(f"{one.name}={one.value}" for one in browser.cookies.jar)


@contextlib.asynccontextmanager
async def paired_server(of: Config) -> AsyncIterator[Served]:
    app = create_app(of)
    async with serving_app(app, of) as base:
        yield Served(base, app.state.services.access)


def access_of(
    config: Config, *, now: Callable[[], float], wall_ms: Callable[[], int], storage: StorageThread | None = None
) -> Access:
    """As the app makes it."""
    return Access(
        config.data,
        names=config.names,
        keys=config.keys,
        is_open=config.is_open,
        now=now,
        wall_ms=wall_ms,
        storage=storage,
    )

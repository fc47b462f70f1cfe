"""What a phone is sent to install the page and to keep its shell; and where the icons could not be drawn."""

from __future__ import annotations

import json
import logging
import re
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app.app import create_app
from server.app.config import Config
from server.system.page_files import static_dir
from server.web.assets import icons
from server.web.assets.bundle import Built, Entry
from server.web.assets.icons import manifest
from server.web.assets.service_worker import build_of, shell_of, withdrawn
from tests.http import http_client
from tests.tree import PROJECT

MODULES = PROJECT / "node_modules"


@asynccontextmanager
async def asking(**config: Any) -> AsyncIterator[httpx.AsyncClient]:
    app = create_app(Config(**config))
    async with http_client(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
        yield client
    app.state.services.ground.close()


@pytest.fixture
def static(tmp_path: Path) -> Path:
    """A copy of the page's files with a joined page in it."""
    folder = tmp_path / "static"
    shutil.copytree(static_dir(), folder, ignore=shutil.ignore_patterns("built", "drawn", "vendor"))
    (folder / "built").mkdir()
    for name in ("app-AAAAAAAA.js", "log-BBBBBBBB.js", "page-CCCCCCCC.css", "numerals-EEEEEEEE.woff2", "built.json"):
        (folder / "built" / name).write_text(name)
    return folder


ENTRY = Entry(script="built/app-AAAAAAAA.js", style="built/page-CCCCCCCC.css", needed=())
BUILT = Built(
    script=ENTRY.script, style=ENTRY.style, needed=ENTRY.needed, early="", fonts=(), name="0123456789ab", fleet=ENTRY
)


def asset(name: str) -> str:
    return f"/static/{name}?v=1"


# -- icons -------------------------------------------------------------------------------------------------------------


def test_icons_are_drawn_and_drawn_anew_when_the_drawing_changed(static: Path) -> None:
    assert not icons.are_drawn(static)
    assert icons.draw(MODULES, static) is None
    assert icons.are_drawn(static)
    for icon in icons.ICONS:
        head = (static / "drawn" / icon.name).read_bytes()[:24]
        assert head.startswith(b"\x89PNG")
        assert int.from_bytes(head[16:20], "big") == int.from_bytes(head[20:24], "big") == icon.side
    drawing = static / "icons" / "catgraph-maskable.svg"
    drawing.write_text(drawing.read_text().replace("#0a0c0d", "#000000"))
    assert not icons.are_drawn(static)


@pytest.mark.parametrize("lost", ["icon-192.png", "drawn.json"])
def test_icons_of_which_one_is_lost_are_none(static: Path, lost: str) -> None:
    icons.draw(MODULES, static)
    (static / "drawn" / lost).unlink()
    assert not icons.are_drawn(static)


def test_where_they_cannot_be_drawn_it_is_said_in_a_sentence(
    static: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    why = icons.draw(tmp_path, static)  # no converter there
    assert why is not None
    assert why.startswith("The icons could not be drawn: ")
    assert why.endswith(".")
    assert "\n" not in why
    (static / "icons" / "catgraph.svg").write_text("<svg")
    assert "could not be drawn" in str(icons.draw(MODULES, static))
    monkeypatch.setenv("PATH", str(tmp_path))
    assert icons.draw(MODULES, static) == "Node, which draws the icons, is not on the PATH."
    assert not icons.are_drawn(static)


async def test_without_drawn_icons_the_svg_is_served_alone(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("server.web.routes.pages.are_drawn", lambda static: False)
    async with asking() as client:
        found = (await client.get("/manifest.webmanifest")).json()
        assert {(one["type"], one["purpose"]) for one in found["icons"]} == {
            ("image/svg+xml", "any"), ("image/svg+xml", "maskable"), ("image/svg+xml", "monochrome"),
        }  # fmt: skip
        for one in found["icons"]:
            assert (await client.get(one["src"])).headers["content-type"] == "image/svg+xml"
        text = (await client.get("/")).text
        assert "apple-touch-icon" not in text
        assert '<link rel="manifest" href="/manifest.webmanifest">' in text
    warnings = [one for one in caplog.records if one.levelno == logging.WARNING]
    assert [one.getMessage() for one in warnings if one.name != "asyncio"] == [icons.WITHOUT]  # that is its debug mode


def test_the_manifest_names_what_a_phone_needs() -> None:
    found = manifest(asset, are_drawn=True)
    sizes = {(one["purpose"], one["sizes"]) for one in found["icons"]}
    assert sizes >= {("any", "192x192"), ("any", "512x512"), ("maskable", "512x512"), ("monochrome", "512x512")}
    assert all(one["purpose"] in ("any", "maskable", "monochrome") for one in found["icons"]), "one purpose each"
    assert found["display"] == "standalone"
    assert len(found["short_name"]) <= 12


# -- the shell ---------------------------------------------------------------------------------------------------------


def test_another_content_is_another_version_and_the_same_is_the_same(static: Path) -> None:
    def version(**changed: Any) -> str:
        built = changed.get("built", BUILT)
        return shell_of(static, built, changed.get("asset", asset), changed.get("offline", b"<html>")).version

    first = version()
    assert version() == first
    seen = {first, version(offline=b"<html>2"), version(asset=lambda name: f"/static/{name}?v=2")}
    other = Built(script="", style="", needed=(), early="", fonts=(), name="ba9876543210", fleet=ENTRY)
    seen.add(version(built=other))
    worker = static / "worker" / "worker.js"
    worker.write_text(worker.read_text() + "\n// 2\n")
    seen.add(version())
    (static / "built" / "more-DDDDDDDD.js").write_text("")
    seen.add(version())
    assert len(seen) == 6


def test_the_worker_has_every_joined_file_and_nothing_that_is_live(static: Path) -> None:
    script = shell_of(static, BUILT, asset, b"").worker(static)
    found = json.loads(script.partition("\n")[0].removeprefix("self.SHELL = ").removesuffix(";"))
    joined = ("app-AAAAAAAA.js", "log-BBBBBBBB.js", "page-CCCCCCCC.css", "numerals-EEEEEEEE.woff2")
    assert {f"/static/built/{name}" for name in joined} <= set(found["named"])
    addresses = [*found["named"], found["offline"]]
    assert all(address.startswith(("/static/", "/offline?v=")) for address in addresses)
    assert found["build"] == build_of(BUILT)
    assert build_of(None) == ""


@pytest.mark.parametrize(("built", "worker"), [(None, True), (BUILT, False)], ids=["single modules", "not wanted"])
async def test_where_there_shall_be_no_worker_its_address_takes_away_the_one_there_is(
    built: Built | None, worker: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.web.routes.pages.find", lambda static: built)
    async with asking(worker=worker) as client:
        answer = await client.get("/worker.js")
        assert answer.text == withdrawn(static_dir())
        assert answer.headers["service-worker-allowed"] == "/"
        assert answer.headers["cache-control"] == "no-cache"
        assert answer.headers["content-type"].startswith("text/javascript")
        assert "data-worker" not in (await client.get("/")).text


async def test_the_page_for_no_server_belongs_to_its_shell(static: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.web.routes.pages.static_dir", lambda: static)
    monkeypatch.setattr("server.web.routes.pages.check_vendor", lambda: None)
    monkeypatch.setattr("server.web.routes.pages.find", lambda static: BUILT)
    async with asking() as client:
        script = (await client.get("/worker.js")).text
        (kept,) = re.findall(r'"offline": "(/offline\?v=[0-9a-f]{12})"', script)
        answer = await client.get(kept)
        assert answer.status_code == 200
        assert "default-src 'none'" in answer.headers["content-security-policy"]
        assert "This device monitors nothing now." in answer.text
        named = re.findall(r'(?:src|href)="(/static/[^"]+)"', answer.text)
        assert [address for address in named if address not in script] == [], "all that it needs is kept with it"
        assert (await client.get("/offline?v=000000000000")).status_code == 404
        page = (await client.get("/")).text
        assert "data-worker" in page
        icons = set(re.findall(r'"(/static/icons/[^"]+)"', page))
        assert len(icons) == 5
        assert all(f'"{address}"' in script for address in icons)

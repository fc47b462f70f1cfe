"""Texts from outside (strings.json): paths that climb, addresses that must not be dialled, and texts that would add a
line. None passes. Spellings that are known to pass checks of other software are left out."""

from __future__ import annotations

import asyncio
import contextlib
import email
import json
import re
import socket
import threading
from collections.abc import AsyncIterator, Iterator
from email import policy
from email.message import Message
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from starlette.routing import Mount, Route

from server.app.app import create_app
from server.app.config import Config
from server.mail import address as mail_address
from server.mail import compose
from server.mail.compose import Attachment, Draft
from server.rosbridge.address import BadAddress, parse, refuse_forbidden
from server.vehicle.vehicle import Vehicle
from server.web.middleware.ranges import disposition, file_name
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.recording.made import record
from tests.server.viewer import viewer

STRINGS: dict[str, list[str]] = json.loads(Path(__file__).with_name("strings.json").read_text(encoding="utf-8"))
TRAVERSAL, DIAL, HEADER = STRINGS["traversal"], STRINGS["dial"], STRINGS["header"]
CANARY = "canary-5f1c"
TREASURES = (CANARY, "root:x:", "def create_app", "[build-system]", "{% include")
ID = "car_20160601T120000Z"


def test_there_are_many_each_once() -> None:
    assert sum(len(set(rows)) for rows in STRINGS.values()) >= 160


# -- paths ---


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with a recording, and files that nobody may get, in it and around it."""
    folder = tmp_path / "data"
    record(folder / "recordings" / "car" / f"{ID}.mcap", seconds=2.0)
    for place in (tmp_path, folder, folder / "recordings", folder / "recordings" / "car"):
        (place / "canary.txt").write_text(CANARY)
    return folder


def routes_with_names() -> list[tuple[str, str]]:
    """Method and path of every route that takes a name in its path."""
    found = []
    for route in _all(create_app(Config()).routes):
        if isinstance(route, Mount) and route.path == "/static":
            found.append(("GET", "/static/{path}"))
        elif isinstance(route, Route) and "{" in route.path:
            found += [(method, route.path) for method in sorted(route.methods or ())]
    assert len(found) > 20
    return found


def _all(routes: Any) -> Iterator[Any]:
    for route in routes:
        inner = getattr(route, "routes", None) or getattr(getattr(route, "original_router", None), "routes", None)
        if inner and not isinstance(route, Mount):
            yield from _all(inner)
        else:
            yield route


def _filled(path: str, text: str) -> str:
    return re.sub(r"\{[^}]*\}", lambda _: text, path)


async def _tried(base: str, requests: list[tuple[str, str]]) -> AsyncIterator[tuple[str, str, int, bytes, str]]:
    """Each path as it stands on the wire: nothing makes it plainer. Status, body and where the answer leads."""
    host, _, port = base.removeprefix("http://").partition(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    for method, path in requests:
        body = "{}" if method in ("POST", "PUT", "PATCH") else ""
        head = f"{method} {path} HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: application/json\r\n"
        writer.write(f"{head}Content-Length: {len(body)}\r\n\r\n{body}".encode())
        head_text = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        heads = email.message_from_string(head_text.partition("\r\n")[2])
        status, length = int(head_text.split(" ")[1]), int(heads["Content-Length"] or 0)
        has_body = method != "HEAD" and status not in (204, 304)
        yield method, path, status, await reader.readexactly(length) if has_body else b"", heads["Location"] or ""
    writer.close()


async def test_no_path_leads_out(data: Path) -> None:
    async with serving(Config(data=data)) as base:
        requests = []
        for method, path in routes_with_names():
            for text in TRAVERSAL:
                requests.append((method, _filled(path, quote(text, safe=""))))
                raw = _filled(path, text)
                if raw.isascii() and raw.isprintable() and not set(" ?#") & set(raw):
                    requests.append((method, raw))
        assert len(requests) > 2000
        async for method, path, status, body, place in _tried(base, requests):
            assert 300 <= status < 500, (method, path, status, body[:200])
            assert not any(treasure.encode() in body for treasure in TREASURES), (method, path)
            assert not place or place.startswith(f"{base}/"), (method, path, place)
    assert len(list(data.parent.rglob("canary.txt"))) == 4
    assert (data / "recordings" / "car" / f"{ID}.mcap").is_file(), "nothing was deleted either"


async def test_no_name_in_a_query_a_body_or_an_order_leads_out(data: Path) -> None:
    async with serving(Config(data=data)) as base, http_client(base_url=base) as client, viewer(base) as page:
        for text in TRAVERSAL:
            for path, name in (
                ("/", "vehicle"), ("/api/state", "vehicle"), ("/api/log.csv", "vehicle"), ("/api/trends", "replay"),
                ("/api/recordings", "cursor"), ("/api/recordings", "vehicle"), ("/api/recordings", "tag"),
            ):  # fmt: skip
                answer = await client.get(path, params={name: text})
                assert answer.status_code < 500, (path, name, text)
                assert not any(treasure in answer.text for treasure in TREASURES if path != "/"), (path, name, text)
            answer = await client.post(
                "/api/mail", json={"recordings": [text], "to": ["a@b.example"], "format": "mcap"}
            )
            assert answer.status_code in (404, 409, 422), (text, answer.text)
            if len(text) < 300 and TRAVERSAL.index(text) % 4 == 0:  # a page has so many orders a second
                reply = await page.ask(kind="replay", do="open", recording=text)
                assert reply["ok"] is False, text


# -- addresses ---


@pytest.mark.parametrize("typed", DIAL, ids=ascii)
def test_no_such_address_is_dialled(typed: str) -> None:
    """Refused as it is typed, or, where it is a number, when the number is looked at."""
    try:
        address = parse(typed)
    except BadAddress:
        return
    try:
        found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM, flags=socket.AI_NUMERICHOST)
    except socket.gaierror:
        pytest.fail(f"{address.host} would be looked up at a name server")
    for entry in found:
        with pytest.raises(BadAddress, match="never dialled"):
            refuse_forbidden(str(entry[4][0]))


async def test_a_name_that_changes_its_mind_is_looked_at_when_it_is_dialled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its address is proper when first looked up, forbidden later. What was checked is what is dialled, as a number."""
    loop = asyncio.get_running_loop()
    dialled: list[Any] = []
    turns = iter(["10.255.255.1"] + ["224.0.0.1"] * 1000)

    async def look_up(host: str, port: int, **_: Any) -> Any:
        if host != "changing.example":
            return await real_look_up(host, port, **_)
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (next(turns), port))]

    async def dial(factory: Any, host: Any = None, port: Any = None, **more: Any) -> Any:
        dialled.append(host)
        raise ConnectionRefusedError(111, "refused")

    real_look_up = loop.getaddrinfo
    async with serving(Config()) as base, viewer(base) as page:
        monkeypatch.setattr(loop, "getaddrinfo", look_up, raising=False)
        monkeypatch.setattr(loop, "create_connection", dial, raising=False)
        assert (await page.ask(kind="connect", address="ws://changing.example"))["ok"]
        state = await page.state(
            lambda s: "never dialled" in json.dumps(s["link"]) or "never dialled" in json.dumps(s), within_s=10
        )
        assert state
        monkeypatch.undo()
    assert dialled == ["10.255.255.1"]


async def test_a_redirect_is_not_followed() -> None:
    seen: list[str] = []

    async def elsewhere(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        seen.append("followed")
        writer.close()

    async def redirect(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(asyncio.IncompleteReadError):
            await reader.readuntil(b"\r\n\r\n")
        seen.append("requested")
        writer.write(f"HTTP/1.1 302 Found\r\nLocation: ws://127.0.0.1:{port}/\r\nContent-Length: 0\r\n\r\n".encode())
        await writer.drain()
        writer.close()

    async with _listening(elsewhere) as port, _listening(redirect) as first, serving(Config()) as base:
        async with viewer(base) as page:
            await page.ask(kind="connect", address=f"127.0.0.1:{first}")
            await page.state(
                lambda s: s["link"]["attempts"] >= 2 if "attempts" in s["link"] else seen.count("requested") >= 2
            )
    assert "followed" not in seen
    assert "requested" in seen


async def test_with_an_allow_list_nothing_else_is_dialled() -> None:
    async with serving(Config(allowed_hosts=("car.example",))) as base, http_client(base_url=base) as client:
        for typed in ("127.0.0.1", "car.example.evil.example", "evil.example", "xcar.example", "[::1]"):
            answer = await client.post("/api/connect", json={"address": typed})
            assert answer.status_code == 409, (typed, answer.text)
        assert (await client.get("/api/vehicles")).json()["vehicles"][0]["address"] is None


@contextlib.asynccontextmanager
async def _listening(handler: Any) -> AsyncIterator[int]:
    server = await asyncio.start_server(handler, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()


# -- lines ---


@pytest.mark.parametrize("text", HEADER + TRAVERSAL, ids=lambda text: ascii(text)[:40])
def test_no_name_of_a_file_adds_a_line_or_a_folder(text: str) -> None:
    header = disposition(f"{text}.mcap")
    assert header.isascii()
    assert header.isprintable()
    name = file_name(f"{text}.mcap")
    assert not set(name) & set('/\\:*?"<>|%')
    assert name.isprintable()
    assert name.endswith(".mcap")
    assert not name.startswith(".")
    assert len(name) <= 120
    line = Message()
    line["Content-Disposition"] = header
    parts = [name for name, _ in line.get_params(header="content-disposition") or []]
    assert parts[0] == "attachment"  # the library calls `filename*` by either name
    assert [part.rstrip("*") for part in parts[1:]] in (["filename"], ["filename", "filename"])


@pytest.mark.parametrize("text", HEADER, ids=lambda text: ascii(text)[:40])
def test_no_text_adds_a_line_to_the_head_of_a_mail(text: str, tmp_path: Path) -> None:
    """As a subject, a sender's name, a recipient and the name of what is attached: refused, or one line of text."""
    ann = mail_address.parse("ann@example.org")
    facts: dict[str, Any] = {"sender_name": "", "subject": "Drive", "to": [ann], "attachment": None}
    (tmp_path / "file").write_bytes(b"x")
    for n, more in enumerate(_with(text, tmp_path / "file")):
        draft = Draft(
            sender=ann, at_ms=0, message_id="<a@example.org>", text=text.replace("\0", ""), **{**facts, **more}
        )
        path = tmp_path / f"{n}.eml"
        try:
            compose.write(draft, path, threading.Event())
        except ValueError:
            continue
        mail = email.message_from_bytes(path.read_bytes(), policy=policy.default)
        heads = ["Date", "From", "MIME-Version", "Message-ID", "Subject", "To"]
        assert sorted(key for key in mail.keys() if not key.startswith("Content-")) == heads
        assert len(mail["To"].addresses) == 1
        assert [one.addr_spec for one in mail["From"].addresses] == ["ann@example.org"]


def _with(text: str, file: Path) -> Iterator[dict[str, Any]]:
    yield {"subject": text}
    yield {"sender_name": text}
    yield {"attachment": Attachment(path=file, start=0, length=1, name=text)}
    with contextlib.suppress(mail_address.BadAddress):
        yield {"to": [mail_address.parse(text)]}


async def test_no_header_and_no_title_adds_a_line_to_an_answer(data: Path) -> None:
    config = Config(data=data, vehicles=(Vehicle(name="car"),))
    async with serving(config) as base, http_client(base_url=base) as client:
        async with asyncio.timeout(20):
            while (await client.get(f"/api/recordings/{ID}")).json().get("state") == "waiting":
                await asyncio.sleep(0.05)
        expected = set((await client.get(f"/api/recordings/{ID}/file.mcap")).headers)
        for text in HEADER:
            changed = await client.patch(
                f"/api/recordings/{ID}", json={"title": text, "note": text, "tags": [text[:40]]}
            )
            assert changed.status_code in (200, 422), text
            fetched = await client.get(f"/api/recordings/{ID}/file.mcap", headers={"Accept-Encoding": "identity"})
            assert set(fetched.headers) == expected, text
            line = fetched.headers["content-disposition"]
            assert line.startswith("attachment; filename=")
            assert line.isprintable()
            if text.isprintable() or text[0] == "x":  # the others no client sends
                named = await client.post("/api/pause", headers={"X-Catgraph-Name": text.encode("utf-8")})
                assert named.status_code in (200, 409)
        events = (await client.get("/api/events")).json()["events"]
        assert all(str(event.get("by") or "").isprintable() for event in events)

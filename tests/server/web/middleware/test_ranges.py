"""A file over HTTP: whole, in parts, not again, gone on with; and under names of every kind."""

from __future__ import annotations

import os
import re
from collections.abc import AsyncIterator
from pathlib import Path
from urllib.parse import unquote

import httpx
import pytest
import pytest_asyncio
from fastapi import FastAPI, Request, Response
from hypothesis import given
from hypothesis import strategies as st

from server.web.middleware import errors
from server.web.middleware.ranges import MAX_NAME, disposition, file_answer, file_name
from tests.http import http_client

BYTES = bytes(range(256)) * 3000 + b"the end"  # more than two portions
SIZE = len(BYTES)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    path.write_bytes(BYTES)
    return path


@pytest_asyncio.fixture
async def client(path: Path) -> AsyncIterator[httpx.AsyncClient]:
    app = FastAPI()
    errors.install(app)

    @app.api_route("/file", methods=["GET", "HEAD"], response_class=Response)
    def answer(request: Request) -> Response:
        return file_answer(request, path, name="a drive.mcap", media_type="application/x-mcap")

    async with http_client(transport=httpx.ASGITransport(app), base_url="http://car") as client:
        yield client


async def test_the_whole_file(client: httpx.AsyncClient) -> None:
    answer = await client.get("/file")
    assert answer.status_code == 200
    assert answer.content == BYTES
    assert answer.headers["accept-ranges"] == "bytes"
    assert answer.headers["content-length"] == str(SIZE)
    assert answer.headers["content-type"] == "application/x-mcap"
    assert answer.headers["content-disposition"] == 'attachment; filename="a drive.mcap"'


async def test_head_tells_the_same_without_a_byte(client: httpx.AsyncClient) -> None:
    answer = await client.head("/file", headers={"range": "bytes=0-9"})
    assert (answer.status_code, answer.content) == (200, b"")
    assert answer.headers["content-length"] == str(SIZE)


@pytest.mark.parametrize(
    ("requested", "first", "last"),
    [
        ("bytes=0-0", 0, 0),
        ("bytes=10-19", 10, 19),
        ("bytes=262143-262144", 262143, 262144),  # across two portions
        (f"bytes={SIZE - 1}-", SIZE - 1, SIZE - 1),
        (f"bytes={SIZE - 5}-{SIZE + 900}", SIZE - 5, SIZE - 1),
        ("bytes=-7", SIZE - 7, SIZE - 1),
        (f"bytes=-{SIZE * 2}", 0, SIZE - 1),
        ("bytes=0-", 0, SIZE - 1),
        ("bytes = 3 - 4", 3, 4),
    ],
)
async def test_a_part(client: httpx.AsyncClient, requested: str, first: int, last: int) -> None:
    answer = await client.get("/file", headers={"range": requested})
    assert answer.status_code == 206
    assert answer.headers["content-range"] == f"bytes {first}-{last}/{SIZE}"
    assert answer.headers["content-length"] == str(last - first + 1)
    assert answer.content == BYTES[first : last + 1]


@pytest.mark.parametrize("requested", [f"bytes={SIZE}-", f"bytes={SIZE + 5}-{SIZE + 9}", "bytes=-0", "bytes=0-1,5-6"])
async def test_a_part_that_is_not_there_is_416_with_a_sentence(client: httpx.AsyncClient, requested: str) -> None:
    answer = await client.get("/file", headers={"range": requested})
    assert answer.status_code == 416
    assert answer.headers["content-range"] == f"bytes */{SIZE}"
    assert answer.headers["content-type"] == "application/problem+json"
    assert re.fullmatch(r"[A-Z].*\.", answer.json()["detail"])


@pytest.mark.parametrize(
    "requested", ["bytes=", "bytes=-", "bytes=9-3", "lines=0-3", "bytes=a-b", "bytes=" + "9" * 40 + "-"]
)
async def test_what_is_no_range_is_as_if_it_were_not_there(client: httpx.AsyncClient, requested: str) -> None:
    answer = await client.get("/file", headers={"range": requested})
    assert (answer.status_code, len(answer.content)) == (200, SIZE)


async def test_a_download_that_broke_goes_on_unless_the_file_is_another(client: httpx.AsyncClient, path: Path) -> None:
    whole = await client.get("/file")
    etag, changed = whole.headers["etag"], whole.headers["last-modified"]
    part = {"range": "bytes=100-"}
    for condition in (etag, changed):
        answer = await client.get("/file", headers=part | {"if-range": condition})
        assert (answer.status_code, answer.content) == (206, BYTES[100:])
    again = await client.get("/file", headers={"if-none-match": f'"x", W/{etag}'})
    assert (again.status_code, again.content) == (304, b"")
    path.write_bytes(b"other" + BYTES[5:])
    os.utime(path, ns=(1, 1))
    for condition in (etag, changed, 'W/"1-1"', "nonsense"):
        answer = await client.get("/file", headers=part | {"if-range": condition})
        assert (answer.status_code, answer.content[:5]) == (200, b"other")
    assert (await client.get("/file", headers={"if-none-match": etag})).status_code == 200


async def test_an_empty_file_and_one_that_is_gone(client: httpx.AsyncClient, path: Path) -> None:
    path.write_bytes(b"")
    assert (await client.get("/file")).content == b""
    assert (await client.get("/file", headers={"range": "bytes=0-"})).status_code == 416
    path.unlink()
    answer = await client.get("/file")
    assert (answer.status_code, answer.json()["detail"]) == (404, "The file no longer exists.")


@pytest.mark.parametrize(
    ("name", "saved"),
    [
        ("drive.mcap", "drive.mcap"),
        ("../../etc/passwd", "_.._etc_passwd"),
        ("..\\..\\boot.mcap", "_.._boot.mcap"),
        ("a\r\nSet-Cookie: x=1.mcap", "a Set-Cookie_ x=1.mcap"),
        ("\u202emcap.exe", "mcap.exe"),
        ("con.mcap", "_con.mcap"),
        ("  .mcap", "recording.mcap"),
        ("", "recording"),
        ("x" * 10_000 + ".mcap", "x" * 115 + ".mcap"),
        ("Fahrt über 50 %.mcap", "Fahrt über 50 _.mcap"),
        ("נסיעה.mcap", "נסיעה.mcap"),
    ],
)
def test_names_of_files(name: str, saved: str) -> None:
    assert file_name(name) == saved


@given(st.text())
def test_no_name_leaves_its_place(name: str) -> None:
    saved = file_name(name)
    assert 0 < len(saved) <= MAX_NAME + 1
    assert not set(saved) & set('/\\:*?"<>|%\r\n\x00')
    header = disposition(name)
    assert header.isascii()
    assert header.isprintable()
    assert header.count('"') == 2
    if "filename*=" in header:
        assert unquote(header.partition("UTF-8''")[2]) == saved

"""Requests that are no valid HTTP, to a real server, and those that two readers may understand differently."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from server.app.config import Config
from server.web.middleware.http_protocol import has_two_lengths
from tests.server.conftest import serving

ANSWERED_WITHIN_S = 30.0


@pytest_asyncio.fixture
async def host(tmp_path: Path) -> AsyncIterator[str]:
    async with serving(Config(data=tmp_path)) as base:
        yield base.removeprefix("http://")


async def answers(host: str, sent: str) -> list[str]:
    """The status lines of all answers until the server ends the connection."""
    name, _, port = host.partition(":")
    reader, writer = await asyncio.open_connection(name, int(port))
    writer.write(sent.encode())
    async with asyncio.timeout(ANSWERED_WITHIN_S):
        found = (await reader.read(-1)).decode()
    writer.close()
    return re.findall(r"HTTP/1\.1 [^\r]*", found)


@pytest.mark.parametrize("chunk", ["ZZ\r\n", "5\r\nabcdefgh\r\n"])
@pytest.mark.parametrize("path", ["/api/ticket", "/nothing"])
async def test_a_body_that_turns_out_invalid_has_one_answer_and_no_error_in_the_log(
    host: str, path: str, chunk: str, caplog: pytest.LogCaptureFixture
) -> None:
    head = f"POST {path} HTTP/1.1\r\nHost: {host}\r\nTransfer-Encoding: chunked\r\n\r\n"
    assert await answers(host, head + chunk) == ["HTTP/1.1 400 Bad Request"]
    await asyncio.sleep(0)  # its handler, which has nothing to answer any more
    assert [record for record in caplog.records if record.levelno >= logging.ERROR] == []


@pytest.mark.parametrize("names", [[], ["content-length"], ["transfer-encoding"], ["host", "content-length"]])
def test_a_request_with_one_length_keeps_its_connection(names: list[str]) -> None:
    assert not has_two_lengths((name.encode(), b"") for name in names)


def test_a_request_with_two_lengths_is_known() -> None:
    """What a proxy takes for its body would be the next request, so that its connection ends."""
    assert has_two_lengths((name, b"") for name in (b"host", b"transfer-encoding", b"content-length"))

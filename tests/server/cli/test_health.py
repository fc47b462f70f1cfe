"""`catgraph health` against servers with and without HTTPS."""

from __future__ import annotations

import asyncio
import datetime as dt
import ssl
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from server.app.config import Config
from server.cli import health
from server.cli.main import main
from server.tls.certificate_renewal import OwnCertificate
from server.tls.names import names_of
from tests.ports import free_port
from tests.server.conftest import serving

BODY = b'{"status":"ok","version":"9.9.9","vehicles":{"car":"idle"}}'


async def exit_code(*arguments: str) -> int:
    return await asyncio.to_thread(main, ["health", *arguments])


async def test_a_server_without_https(capsys: pytest.CaptureFixture[str]) -> None:
    async with serving(Config()) as base:
        assert await exit_code(base) == 0
    assert "ok" in capsys.readouterr().out


class Answering:
    """An HTTPS server that answers with one body, by a certificate of an authority of our own."""

    def __init__(self, folder: Path) -> None:
        now = dt.datetime.now(dt.UTC)
        self.certificate = OwnCertificate(folder / "tls", lambda: names_of([], "pit"), host="pit", now=now)
        self.ca = folder / "ca.crt"
        self.ca.write_bytes(self.certificate.authority.pem)
        self.body = BODY
        self.port = 0

    async def answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        head = f"HTTP/1.1 200 OK\r\nContent-Length: {len(self.body)}\r\nConnection: close\r\n\r\n"
        writer.write(head.encode() + self.body)
        await writer.drain()
        writer.close()


@pytest.fixture
async def answering(tmp_path: Path) -> AsyncIterator[Answering]:
    one = Answering(tmp_path)
    server = await asyncio.start_server(one.answer, "127.0.0.1", 0, ssl=one.certificate.context.ssl)
    one.port = server.sockets[0].getsockname()[1]
    yield one
    server.close()
    await server.wait_closed()


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
async def test_on_this_machine_no_authority_need_be_known(
    answering: Answering, host: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert await exit_code(f"https://{host}:{answering.port}/") == 0
    assert "catgraph 9.9.9: ok" in capsys.readouterr().out


async def test_who_names_an_authority_gets_it_looked_at(answering: Answering, tmp_path: Path) -> None:
    address = f"https://localhost:{answering.port}"
    assert await exit_code(address, "--ca", str(answering.ca)) == 0
    (tmp_path / "other").mkdir()
    assert await exit_code(address, "--ca", str(Answering(tmp_path / "other").ca)) == 1


def test_elsewhere_the_authority_must_be_known() -> None:
    context = health._context("https://192.168.4.1:8000", None)
    assert context is not None
    assert (context.verify_mode, context.check_hostname) == (ssl.CERT_REQUIRED, True)


@pytest.mark.parametrize("body", [b"", b"<html>", b"[1]", b'{"status":"starting"}'])
async def test_another_answer_is_not_well(answering: Answering, body: bytes) -> None:
    answering.body = body
    assert await exit_code(f"https://localhost:{answering.port}") == 1


async def test_an_authority_that_cannot_be_read_is_named(
    answering: Answering, capsys: pytest.CaptureFixture[str]
) -> None:
    assert await exit_code(f"https://localhost:{answering.port}", "--ca", "/nowhere/ca.crt") == 2
    assert "/nowhere/ca.crt cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize("scheme", ["https", "http"])
async def test_without_an_address_it_requests_this_machine_both_ways(
    answering: Answering, monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    async with serving(Config()) as base:
        port = {"https": answering.port, "http": int(base.rpartition(":")[2])}[scheme]
        monkeypatch.setattr(health, "_HERE", tuple(f"{one}://127.0.0.1:{port}" for one in ("https", "http")))
        assert await exit_code() == 0


async def test_no_answer_is_reported_for_both(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    port = free_port()
    monkeypatch.setattr(health, "_HERE", tuple(f"{one}://127.0.0.1:{port}" for one in ("https", "http")))
    assert await exit_code() == 1
    assert capsys.readouterr().err.count("does not answer") == 2

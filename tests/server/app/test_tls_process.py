"""A whole server over HTTPS: pages and sockets by TLS, the plain page on both ports, a certificate renewed beneath."""

from __future__ import annotations

import asyncio
import contextlib
import datetime as dt
import ipaddress
import json
import socket
import ssl
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
import uvicorn
import websockets

from server.app.app import create_app
from server.app.config import Config, Tls
from server.app.tls_process import Secured, Server, secure, serve_secured
from server.protocol.rate_limit import Limits
from server.system import loopback
from server.tls import tls_sniffer
from server.tls.authority import TlsRefused
from server.tls.certificate_renewal import OwnCertificate
from server.tls.names import Names, names_of
from server.tls.setup import Probe
from server.version import catgraph_version
from server.web.middleware import http_protocol
from tests.http import http_client
from tests.server.tls.certificates import pair


@dataclass(kw_only=True)
class Field:
    """One server in the field."""

    secured: Secured
    port: int
    setup_port: int

    @property
    def trusted(self) -> ssl.SSLContext:
        assert self.secured.authority is not None
        return ssl.create_default_context(cadata=self.secured.authority.pem.decode())

    def client(self) -> httpx.AsyncClient:
        return http_client(verify=self.trusted, base_url=f"https://127.0.0.1:{self.port}")


def listening() -> socket.socket:
    one = socket.socket()
    one.bind(("127.0.0.1", 0))
    one.listen(64)
    one.setblocking(False)
    return one


@contextlib.asynccontextmanager
async def field(secured: Secured, config: Config) -> AsyncIterator[Field]:
    page, explainer = listening(), listening()
    server = Server(
        uvicorn.Config(Probe(create_app(config)), **http_protocol.options(config.limits), timeout_graceful_shutdown=1)
    )
    task = asyncio.create_task(serve_secured(secured, server, config, page, explainer))
    await server.begun.wait()
    yield Field(secured=secured, port=page.getsockname()[1], setup_port=explainer.getsockname()[1])
    server.should_exit = True
    async with asyncio.timeout(10):
        await task
    assert page.fileno() == -1


@pytest.fixture
async def served(tmp_path: Path) -> AsyncIterator[Field]:
    config = Config(data=tmp_path, tls=Tls(mode="auto"))
    secured = secure(config)
    assert secured is not None
    async with field(secured, config) as one:
        yield one


async def test_a_device_that_trusts_the_authority_gets_the_page(served: Field) -> None:
    async with served.client() as client:
        assert (await client.get("/api/health")).json()["version"] == catgraph_version()
        assert "catgraph" in (await client.get("/")).text


async def test_a_device_that_does_not_is_turned_away(served: Field) -> None:
    async with http_client() as client:
        with pytest.raises(httpx.ConnectError, match="CERTIFICATE_VERIFY_FAILED"):
            await client.get(f"https://127.0.0.1:{served.port}/")


async def test_the_plain_page_may_try_whether_https_succeeds_and_learns_no_more(served: Field) -> None:
    headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}
    async with served.client() as client:
        answer = await client.get("/trusted", headers=headers)
        assert (answer.status_code, answer.content) == (204, b"")
        assert answer.headers["cross-origin-resource-policy"] == "cross-origin"
        assert (await client.get("/api/health", headers=headers)).status_code == 403
        assert (await client.post("/trusted")).status_code in (403, 404, 405)
        assert (await client.get("/trusted/x")).status_code == 404


async def test_the_socket_of_a_page_goes_over_tls_compressed(served: Field) -> None:
    origin = f"https://127.0.0.1:{served.port}"
    address = f"wss://127.0.0.1:{served.port}/ws"
    async with websockets.connect(address, ssl=served.trusted, origin=websockets.Origin(origin)) as socket_:
        assert json.loads(await socket_.recv())["kind"] == "hello"
        (deflate,) = socket_.protocol.extensions
        assert deflate.name == "permessage-deflate"


@pytest.mark.parametrize("port", ["port", "setup_port"])
@pytest.mark.parametrize(
    "path", ["/api/health", "/docs", "/ws", "/static/js/main.js", "/../authority.pem", "/tls/leaf.pem"]
)
async def test_without_tls_nothing_but_the_plain_page_is_served(served: Field, port: str, path: str) -> None:
    async with http_client(base_url=f"http://127.0.0.1:{getattr(served, port)}") as client:
        assert (await client.post(path)).headers["location"] == "/"  # the first on its connection
        answer = await client.get(path)
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        page = await client.get("/")
        assert "Let this device trust the server" in page.text
        assert f"https://127.0.0.1:{served.port}/" in page.text
        assert f"http://127.0.0.1:{served.setup_port}/" in page.text


async def test_a_socket_without_tls_is_refused(served: Field) -> None:
    with pytest.raises(websockets.InvalidStatus):
        async with websockets.connect(f"ws://127.0.0.1:{served.port}/ws"):
            pass


@pytest.mark.parametrize(
    "sent", [b"\x00", b"\x16", b"\x16\x03\x01\x00\x05hello", b"GET / HTTP/9.9\r\n\r\n", b"\xff" * 5000, b""]
)
async def test_what_is_neither_tls_nor_http_ends_and_hurts_nobody(served: Field, sent: bytes) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(sent)
    writer.write_eof()
    async with asyncio.timeout(5):
        with contextlib.suppress(ConnectionError):
            await reader.read()
    writer.close()
    async with served.client() as client:
        assert (await client.get("/api/health")).status_code == 200


async def test_who_connects_and_says_nothing_keeps_nobody_out(served: Field, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tls_sniffer, "UNDECIDED", 8)
    silent = [await asyncio.open_connection("127.0.0.1", served.port) for _ in range(20)]
    async with served.client() as client:
        assert (await client.get("/api/health")).status_code == 200
    ended = 0
    for reader, writer in silent[:11]:  # the eldest made room
        async with asyncio.timeout(5):
            with contextlib.suppress(ConnectionError):
                ended += await reader.read() == b""
        writer.close()
    for _, writer in silent[11:]:
        writer.close()
    assert ended >= 10


async def test_who_connects_and_says_nothing_is_let_go(served: Field, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tls_sniffer, "DECIDE_S", 0.1)
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    async with asyncio.timeout(5):
        assert await reader.read() == b""
    writer.close()


@pytest.mark.world(n=24)
@pytest.mark.parametrize("sent", [b"", b"\x16\x03\x01", b"GET / HT"])
async def test_one_address_gets_so_many_connections_handshakes_included(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sent: bytes
) -> None:
    """Those of this machine are not counted, and a test has no other: for it, this machine is another."""
    config = Config(data=tmp_path, tls=Tls(mode="auto"), limits=Limits(connections=5))
    secured = secure(config)
    assert secured is not None
    async with field(secured, config) as one:
        monkeypatch.setattr(loopback, "is_loopback", lambda _: False)
        held = []
        for _ in range(5):
            held.append(await asyncio.open_connection("127.0.0.1", one.port))
            held[-1][1].write(sent)
        await asyncio.sleep(0.1)
        for _ in range(3):
            reader, writer = await asyncio.open_connection("127.0.0.1", one.port)
            async with asyncio.timeout(3):
                with contextlib.suppress(ConnectionError):
                    assert await reader.read() == b"", "hung up on, before any handshake"
            writer.close()
        for _, writer in held:
            writer.close()
        async with asyncio.timeout(10), one.client() as client:
            while True:
                try:
                    assert (await client.get("/api/health")).status_code == 200
                    break
                except httpx.TransportError:
                    await asyncio.sleep(0.05)


class Roaming:
    """A laptop that is carried from one network to another."""

    def __init__(self) -> None:
        self.address = "192.168.4.1"

    def names(self) -> Names:
        return names_of([ipaddress.ip_address(self.address)], "pit")


async def test_a_page_goes_on_while_the_certificate_is_renewed_and_the_next_one_sees_the_new(tmp_path: Path) -> None:
    laptop = Roaming()
    now = dt.datetime.now(dt.UTC)
    certificate = OwnCertificate(tmp_path / "tls", laptop.names, host="pit", now=now)
    secured = Secured(certificate=certificate, tls=Tls(), host="0.0.0.0")
    config = Config(data=tmp_path, tls=Tls())
    async with field(secured, config) as one:
        assert secured.hosts()[:2] == ("192.168.4.1", "pit.local")
        address = f"wss://127.0.0.1:{one.port}/ws"
        async with websockets.connect(
            address, ssl=one.trusted, origin=websockets.Origin(f"https://127.0.0.1:{one.port}")
        ) as before:
            await before.recv()
            first = await shown(one)
            laptop.address = "10.20.0.7"
            assert certificate.refresh(now)
            assert secured.hosts()[0] == "10.20.0.7"
            second = await shown(one)
            assert first != second
            await (await before.ping())  # the old one lives
        async with http_client(base_url=f"http://127.0.0.1:{one.setup_port}") as client:
            page = await client.get("/", headers={"Host": f"10.20.0.7:{one.setup_port}"})
            assert f'href="https://10.20.0.7:{one.port}/"' in page.text


async def shown(one: Field) -> bytes:
    _, writer = await asyncio.open_connection("127.0.0.1", one.port, ssl=one.trusted, server_hostname="127.0.0.1")
    der: bytes = writer.get_extra_info("ssl_object").getpeercert(binary_form=True)
    writer.close()
    return der


async def test_a_given_certificate_is_served_and_plain_http_is_led_to_it(tmp_path: Path) -> None:
    files = pair(tmp_path, start=dt.datetime.now(dt.UTC) - dt.timedelta(days=1), names=("localhost", "*.example.org"))
    config = Config(tls=Tls(mode="files", cert=files.cert, key=files.key))
    secured = secure(config)
    assert secured is not None
    assert secured.authority is None
    async with field(secured, config) as one:
        context = ssl.create_default_context(cafile=files.cert)
        async with http_client(verify=context) as client:
            answer = await client.get(f"https://localhost:{one.port}/api/health")
            assert answer.json()["version"] == catgraph_version()
            assert "strict-transport-security" not in answer.headers  # localhost is a name of every server here
            named = await client.get(f"https://localhost:{one.port}/api/health", headers={"Host": "car.example.org"})
            assert named.headers["strict-transport-security"] == "max-age=31536000"
            led = await client.get(f"http://127.0.0.1:{one.port}/anything?x=1")
            assert (led.status_code, led.headers["location"]) == (303, f"https://localhost:{one.port}/")
            assert "strict-transport-security" not in led.headers


@pytest.mark.parametrize(
    ("config", "text"),
    [
        (Config(host="0.0.0.0"), "needs a data folder"),
        (Config(tls=Tls(mode="files", cert=Path("/nowhere/c.pem"), key=Path("/nowhere/k.pem"))), "cannot be read"),
        (Config(tls=Tls(mode="files", cert=Path("/nowhere/c.pem"))), "needs its key"),
    ],
)
def test_what_cannot_be_secured_is_reported(config: Config, text: str) -> None:
    with pytest.raises(TlsRefused, match=text):
        secure(config)


def test_plain_http_is_the_default_on_loopback_and_by_off_elsewhere(tmp_path: Path) -> None:
    assert secure(Config(data=tmp_path)) is None
    assert secure(Config(data=tmp_path, host="0.0.0.0", tls=Tls(mode="off"))) is None
    assert secure(Config(data=tmp_path, host="0.0.0.0", limits=Limits())) is not None

"""What may answer at an address instead of a rosbridge, and what the operator sees of it."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import ssl
import threading
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from server.rosbridge import dialer
from tests.server.link_listener import Handler, LinkListener, accept, answering, black_hole, bridging, linked, until

pytestmark = pytest.mark.virtual_time


def saying(answer: bytes, *, hang_up: bool = False, first: bool = False) -> Handler:
    """Answers the handshake, whatever it requests; or sends first."""

    async def handle(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not first:
            await reader.readuntil(b"\r\n\r\n")
        writer.write(answer)
        await writer.drain()
        if hang_up:
            writer.close()
        else:
            await asyncio.sleep(5)

    return handle


async def say_without_end(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while True:
        writer.write(b"frame of a camera " * 1000)
        await writer.drain()


async def hang_up(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    writer.close()


async def reset(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.readuntil(b"\r\n\r\n")
    writer.transport.abort()


OTHERS: dict[str, tuple[Handler, str, str]] = {
    "web server": (
        saying(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", hang_up=True),
        "not_rosbridge",
        "404",
    ),
    "web server that stays": (saying(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nOK"), "not_rosbridge", "HTTP 200"),
    "web server of old": (saying(b"HTTP/1.0 200 OK\r\n\r\n"), "not_rosbridge", "not as a WebSocket"),
    "one that sends elsewhere": (saying(b"HTTP/1.1 302 Found\r\nLocation: /\r\n\r\n"), "not_rosbridge", "HTTP 302"),
    "one that requires a login": (saying(b"HTTP/1.1 401 Unauthorized\r\n\r\n"), "not_rosbridge", "login"),
    "one that is full": (saying(b"HTTP/1.1 503 Service Unavailable\r\n\r\n"), "busy", "automatically"),
    "a wrong key": (
        saying(b"HTTP/1.1 101 X\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: x\r\n\r\n"),
        "not_rosbridge",
        "not as a WebSocket",
    ),
    "an upgrade to something else": (
        saying(b"HTTP/1.1 101 X\r\nUpgrade: h2c\r\nConnection: Upgrade\r\n\r\n"),
        "not_rosbridge",
        "not as a WebSocket",
    ),
    "headers that are no text": (saying(b"HTTP/1.1 200 \xff\xfe\r\n\xff: \xfe\r\n\r\n"), "not_rosbridge", "not as a"),
    "headers that are none": (saying(b"HTTP/1.1\r\nno colon\r\n\r\n"), "not_rosbridge", "not as a WebSocket"),
    "an empty line": (saying(b"\r\n\r\n"), "not_rosbridge", "not as a WebSocket"),
    "noise": (saying(bytes(range(256)) * 4), "not_rosbridge", "not as a WebSocket"),
    "ssh": (saying(b"SSH-2.0-OpenSSH_9.6\r\n", first=True), "not_rosbridge", "not as a WebSocket"),
    "one that talks without end": (say_without_end, "not_rosbridge", "not as a WebSocket"),
    "one that is silent": (saying(b""), "not_rosbridge", "sends nothing"),
    "one that hangs up at once": (hang_up, "not_rosbridge", "closes the connection"),
    "one that resets": (reset, "not_rosbridge", "closes the connection"),
    "TLS": (saying(b"\x15\x03\x01\x00\x02\x02\x46", hang_up=True), "wants_tls", "wss://127.0.0.1"),
}


@pytest.mark.parametrize(("handler", "code", "text"), OTHERS.values(), ids=OTHERS)
async def test_something_else_answers(handler: Handler, code: str, text: str) -> None:
    listener = LinkListener()
    async with answering(handler) as port, linked(f"127.0.0.1:{port}", listener) as link:
        problem = await listener.wait_for("failed")
        assert (problem.code, text in problem.hint) == (code, True), problem
        assert not link.is_open
        assert link.heard_s is None
        await listener.wait_for("failed", 2)  # and goes on trying
        assert link.attempts - len(listener.all("failed")) in (0, 1)  # one report for each try
        assert {name for name, _ in listener.received} == {"failed"}


async def test_one_that_talks_without_end_fills_no_memory() -> None:
    listener = LinkListener()
    before = psutil.Process().memory_info().rss
    async with answering(say_without_end) as port, linked(f"127.0.0.1:{port}", listener):
        await listener.wait_for("failed", 3)
    assert psutil.Process().memory_info().rss - before < 30e6


async def test_a_handshake_that_comes_letter_by_letter_is_one() -> None:
    listener = LinkListener()

    async def dribble(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        write, written = writer.write, bytearray()
        writer.write = written.extend  # type: ignore[method-assign, assignment]
        await accept(reader, writer)
        for letter in written + b'\x81\x0f{"op":"status"}':
            write(bytes([letter]))
            await asyncio.sleep(0)
        await asyncio.sleep(5)

    async with answering(dribble) as port, linked(f"127.0.0.1:{port}", listener):
        await listener.wait_for("status")
        assert [name for name, _ in listener.received] == ["opened", "status"]


async def test_what_comes_with_the_handshake_is_read_after_it() -> None:
    listener = LinkListener()

    async def hasten(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        write, written = writer.write, bytearray()
        writer.write = written.extend  # type: ignore[method-assign, assignment]
        await accept(reader, writer)
        write(bytes(written) + b'\x81\x0f{"op":"status"}\x88\x00')
        await asyncio.sleep(5)

    async with answering(hasten) as port, linked(f"127.0.0.1:{port}", listener):
        await listener.wait_for("closed")
        assert [name for name, _ in listener.received][:3] == ["opened", "status", "closed"]


# -- nothing answers ---------------------------------------------------------------------------------------------------


async def test_refused() -> None:
    listener = LinkListener()
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
        async with linked(f"127.0.0.1:{port}", listener):
            problem = await listener.wait_for("failed")
            assert problem.code == "refused"
            assert problem.title == f"127.0.0.1 is there, but nothing listens on port {port}."
            await listener.wait_for("failed", 3)


async def test_the_car_comes_up_later() -> None:
    listener = LinkListener()
    with socket.socket() as closed:
        closed.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
        async with linked(f"127.0.0.1:{port}", listener):
            await listener.wait_for("failed", 2)
            closed.close()
            async with bridging(port):
                await listener.wait_for("opened")


async def test_no_answer_at_all() -> None:
    listener = LinkListener()
    with black_hole() as port:
        async with linked(f"127.0.0.1:{port}", listener) as link:
            began_s = time.monotonic()
            for _ in range(10):
                link.retry_now()  # while dialling: no second dial
                await asyncio.sleep(0.01)
            assert (await listener.wait_for("failed")).code == "timeout"
            assert link.attempts == 1
            assert time.monotonic() - began_s == pytest.approx(dialer.DIAL_TIMEOUT_S, abs=0.01)


async def test_no_such_host() -> None:
    listener = LinkListener()
    async with linked("no-such-host.invalid", listener):
        assert (await listener.wait_for("failed")).code in ("no_such_host", "no_lookup")  # where no name server answers


@pytest.mark.parametrize("typed", ["169.254.169.254", "3758096385:80", "[::ffff:224.0.0.1]", "0.0.0.0", "[ff02::1]"])
async def test_what_is_never_dialled_is_not(typed: str) -> None:
    listener = LinkListener()
    async with linked(typed, listener):
        problem = await listener.wait_for("failed")
        assert problem.code == "forbidden"


# -- several addresses -------------------------------------------------------------------------------------------------


def found(*ips: str) -> list[Any]:
    kind = {4: socket.AF_INET, 6: socket.AF_INET6}
    return [(kind[ipaddress.ip_address(ip).version], socket.SOCK_STREAM, 6, "", (ip, 0)) for ip in ips]


ROADS = {
    "the first refuses": (("127.0.0.3", "127.0.0.1"), None),
    "the first is no rosbridge": (("127.0.0.2", "127.0.0.1"), None),
    "the first is forbidden": (("169.254.1.1", "127.0.0.1"), None),
    "the first is no network of ours": (("2001:db8::1", "127.0.0.1"), None),
    "the same one twice": (("127.0.0.3", "127.0.0.3", "127.0.0.3", "127.0.0.3", "127.0.0.1"), None),
    "all refuse": (("127.0.0.3", "127.0.0.4"), "refused"),
    "one refuses, one is no rosbridge": (("127.0.0.2", "127.0.0.3"), "not_rosbridge"),
    "one is forbidden, one refuses": (("169.254.1.1", "127.0.0.3"), "refused"),
    "all are forbidden": (("169.254.1.1", "fe80::1"), "forbidden"),
    "none": ((), "failed"),
}


@pytest.mark.parametrize(("ips", "code"), ROADS.values(), ids=ROADS)
async def test_every_address_of_a_host_is_tried_to_its_handshake(
    ips: tuple[str, ...], code: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On asyncio's loop, whose resolver can be exchanged; what is dialled after it is the same on both."""
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found(*ips))
    listener = LinkListener()
    async with bridging() as bridge:
        async with (
            answering(hang_up, host="127.0.0.2", port=bridge.port),
            linked(f"car:{bridge.port}", listener) as link,
        ):
            if code is None:
                await listener.wait_for("opened")
                assert listener.all("failed") == []
                assert link.attempts == 1
            else:
                assert (await listener.wait_for("failed")).code == code


async def test_a_name_server_that_hangs_is_queried_once_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    looked_up: list[str] = []
    answers = asyncio.Event()

    async def hang(host: str, *_: Any, **__: Any) -> list[Any]:
        looked_up.append(host)
        await answers.wait()
        return found("127.0.0.1")

    monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", hang)
    listener = LinkListener()
    async with bridging() as bridge, linked(f"car:{bridge.port}", listener):
        assert (await listener.wait_for("failed")).code == "no_lookup"
        await listener.wait_for("failed", 3)
        assert looked_up == ["car"]
        answers.set()
        await listener.wait_for("opened")
        assert looked_up == ["car"]


async def test_ended_while_a_name_is_looked_up(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: answers.wait(8) and found("127.0.0.1"))
    listener = LinkListener()
    before = asyncio.all_tasks()
    async with linked("car", listener):
        await asyncio.sleep(0.05)
    await until(lambda: asyncio.all_tasks() == before, within_s=0.3)
    answers.set()
    await asyncio.sleep(0.05)
    assert listener.received == []


# -- TLS ---------------------------------------------------------------------------------------------------------------


async def test_secure_but_not_trusted(secure: ssl.SSLContext) -> None:
    listener = LinkListener()
    async with bridging(ssl=secure) as bridge, linked(f"wss://127.0.0.1:{bridge.port}", listener):
        problem = await listener.wait_for("failed")
        assert problem.code == "tls_untrusted"
        assert "self" in problem.hint  # self-signed, in OpenSSL's text
        await listener.wait_for("failed", 2)


async def test_secure_for_another_host(
    certificate: Path, secure: ssl.SSLContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    listener = LinkListener()
    async with bridging(ssl=secure) as bridge, linked(f"wss://localhost:{bridge.port}", listener):
        assert (await listener.wait_for("failed")).code == "tls_untrusted"


async def test_a_bridge_without_tls_dialled_with_wss() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(f"wss://127.0.0.1:{bridge.port}", listener):
        problem = await listener.wait_for("failed")
        assert problem.code == "tls"
        assert f"ws://127.0.0.1:{bridge.port}" in problem.hint
        await listener.wait_for("failed", 2)


@pytest.mark.parametrize("handler", [hang_up, saying(b"", first=True)], ids=["hangs up", "silent"])
async def test_something_silent_dialled_with_wss(handler: Handler) -> None:
    listener = LinkListener()
    async with answering(handler) as port, linked(f"wss://127.0.0.1:{port}", listener):
        assert (await listener.wait_for("failed")).code in ("tls", "timeout")


async def test_a_bridge_with_tls_dialled_with_ws(secure: ssl.SSLContext) -> None:
    listener = LinkListener()
    async with bridging(ssl=secure) as bridge, linked(f"ws://127.0.0.1:{bridge.port}", listener):
        problem = await listener.wait_for("failed")
        assert "wss://" in problem.hint
        await listener.wait_for("failed", 2)

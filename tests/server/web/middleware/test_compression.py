"""What a page's socket sends is compressed with the messages before as dictionary, once for all pages."""

from __future__ import annotations

import gc
import json
import random
import zlib
from statistics import mean

import pytest
import websockets
from websockets.extensions.permessage_deflate import PerMessageDeflate
from websockets.frames import Frame, Opcode

from server.rosbridge_server.server import RosBridge
from server.web.middleware.http_protocol import SentMessages, SharedDeflate
from tests.server.cars import driving
from tests.server.viewer import viewer


class Line:
    """The server's side and a page's side of one connection."""

    def __init__(self, messages: SentMessages, *, bits: int = 15, is_forgetful: bool = False) -> None:
        agreed = PerMessageDeflate(False, is_forgetful, 12, bits)
        self.server = SharedDeflate(agreed, messages)
        self.page = PerMessageDeflate(is_forgetful, False, bits, 12)

    def send(self, data: bytes, opcode: Opcode = Opcode.TEXT) -> int:
        """How many bytes were sent. What the page reads is what was sent."""
        frame = self.server.encode(Frame(opcode, data))
        read = self.page.decode(Frame(frame.opcode, bytes(frame.data), frame.fin, frame.rsv1), max_size=2**24)
        assert (read.opcode, bytes(read.data)) == (opcode, data)
        return len(frame.data)


def states(count: int, *, length: int = 12_000) -> list[bytes]:
    """Each differs a little from the one before."""
    noise = random.Random(1)
    text = bytearray(json.dumps({"kind": "state", "of": [noise.random() for _ in range(length // 20)]}).encode())
    text[:14] = b'{"kind":"state'
    made = []
    for _ in range(count):
        for _ in range(5):
            text[noise.randrange(20, len(text))] = noise.randrange(48, 58)
        made.append(bytes(text))
    return made


def _send_to_all(lines: list[Line], data: bytes) -> None:
    for line in lines:
        line.send(data)


async def test_the_handshake_gives_the_whole_window(server: str) -> None:
    async with websockets.connect(server.replace("http", "ws") + "/ws") as socket:
        assert socket.response is not None
        assert "permessage-deflate" in socket.response.headers["Sec-WebSocket-Extensions"]
        assert "server_max_window_bits" not in socket.response.headers["Sec-WebSocket-Extensions"]
        (extension,) = socket.protocol.extensions
        assert isinstance(extension, PerMessageDeflate)
        assert not extension.remote_no_context_takeover
        assert extension.remote_max_window_bits == 15


async def test_a_page_that_cannot_decompress_is_served(server: str) -> None:
    async with websockets.connect(server.replace("http", "ws") + "/ws", compression=None, max_size=2**24) as socket:
        assert socket.protocol.extensions == []
        await socket.send(json.dumps({"kind": "hello", "have_event": None}))
        assert json.loads(await socket.recv())["kind"] == "hello"


async def test_a_state_shrinks_to_a_twentieth(bridge: RosBridge, server: str) -> None:
    async with driving(bridge, speed=lambda n: 4.2 + n / 100), viewer(server) as one:
        await one.until(lambda: len(one.states) >= 12)
    texts = [json.dumps(state, separators=(",", ":")).encode() for state in one.states]
    line = Line(SentMessages())
    sent = [line.send(text) for text in texts]
    assert mean(map(len, texts)) > 4096, "too small to show what a window is for"
    assert mean(sent[1:]) < 0.05 * mean(map(len, texts[1:]))


def test_a_state_refers_to_the_last_one_over_what_came_between() -> None:
    line = Line(SentMessages())
    sizes = []
    for n, state in enumerate(states(5)):
        sizes.append(line.send(state))
        line.send(b"S\x02" + bytes(500 + n), Opcode.BINARY)
        line.send(b'{"kind":"offer","seq":%d}' % n)
    assert max(sizes[1:]) < 0.05 * sizes[0]


def test_pages_that_got_the_same_share_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where each requested something of its own meanwhile."""
    made = []
    compressobj = zlib.compressobj

    def counted(*args: object, **kwargs: object) -> object:
        made.append(kwargs)
        return compressobj(*args, **kwargs)  # type: ignore[arg-type]

    messages = SentMessages()
    lines = [Line(messages) for _ in range(20)]
    monkeypatch.setattr("server.web.middleware.http_protocol.zlib.compressobj", counted)
    for n, state in enumerate(states(10)):
        for k, line in enumerate(lines):
            line.send(state)
            line.send(b'{"kind":"offer","seq":%d}' % (n + k))
    assert len(made) == 10
    lines[0].send(b'{"kind":"log","n":1}' + bytes(300))
    made.clear()
    for state in states(13)[10:]:
        for line in lines:
            line.send(state)
    assert len(made) == 3 + 1, "one page refers to its own answer once, and to the common state from then on"


def test_no_more_is_kept_than_pages_may_refer_to() -> None:
    messages = SentMessages()
    lines = [Line(messages) for _ in range(3)]
    for state in states(50):
        _send_to_all(lines, state)
    gc.collect()
    assert len(messages) <= 3, "as many as begin in 32 kB"
    stalled = lines.pop()
    for state in states(90)[50:]:
        _send_to_all(lines, state)
    assert len(messages) <= 6, "the window of the page that stopped as well"
    lines.clear()
    del stalled
    gc.collect()
    assert len(messages) == 0


@pytest.mark.parametrize("seed", range(4))
def test_each_page_reads_what_was_sent_whatever_it_was_and_whatever_it_agreed_to(seed: int) -> None:
    """Long and short messages of several kinds, in an order of each page's own."""
    chance = random.Random(seed)
    messages = SentMessages()
    common = [
        *states(12),
        *states(4, length=70_000),
        *(b"S\x02" + chance.randbytes(chance.randrange(400)) for _ in range(8)),
        *(b'{"kind":"cars","n":%d' % n + b"car" * chance.choice((10, 400, 30_000)) for n in range(6)),
        b"",
        b"x",
    ]
    for k in range(12):
        line = Line(messages, bits=chance.choice((9, 10, 12, 15, 15, 15)), is_forgetful=k % 4 == 3)
        for _ in range(60):
            data = chance.choice(common)
            line.send(data, Opcode.BINARY if data[:1] == b"S" else Opcode.TEXT)
            assert line.server._size < (1 << 15) + max(map(len, common))

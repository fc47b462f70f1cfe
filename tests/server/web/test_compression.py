"""What a page's socket sends is compressed, with the frame before still in memory."""

from __future__ import annotations

import json
from statistics import mean

import websockets
from websockets.extensions.permessage_deflate import PerMessageDeflate
from websockets.frames import Frame, Opcode

from server.rosbridge_server.server import RosBridge
from server.web.compression import deflate
from tests.server.cars import driving
from tests.server.viewer import viewer


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


async def test_a_state_shrinks_to_a_tenth(bridge: RosBridge, server: str) -> None:
    async with driving(bridge, speed=lambda n: 4.2 + n / 100), viewer(server) as one:
        await one.until(lambda: len(one.states) >= 12)
    _, extension = deflate().process_request_params([], [])
    texts = [json.dumps(state, separators=(",", ":")).encode() for state in one.states]
    sent = [len(extension.encode(Frame(Opcode.TEXT, text)).data) for text in texts]
    assert mean(map(len, texts)) > 4096, "too small to show what a window is for"
    assert mean(sent[1:]) < 0.1 * mean(map(len, texts[1:]))

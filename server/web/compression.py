"""Compression of the frames to a page.

A state of 12 kB differs from the previous one by a few hundred bytes. uvicorn's default window of 4 kB compresses it to
3.2 kB in 650 µs; zlib's full window of 32 kB at level 3 gives 0.9 kB in 95 µs (level 6: 0.4 kB in 220 µs), for 270 kB
of memory per page. `tests/server/web/test_compression.py` tests both.
"""

from __future__ import annotations

from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.extensions.permessage_deflate import ServerPerMessageDeflateFactory

SETTINGS = {"level": 3, "memLevel": 8}
FROM_PAGES_BITS = 12  # of the window for what a page sends: little


def deflate() -> ServerPerMessageDeflateFactory:
    """The extension as it is offered to a page (RFC 7692)."""
    return ServerPerMessageDeflateFactory(client_max_window_bits=FROM_PAGES_BITS, compress_settings=SETTINGS)


class PageSocket(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, compressing as we want it. Written against uvicorn 0.54 and websockets 17."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.conn.available_extensions = [deflate()]

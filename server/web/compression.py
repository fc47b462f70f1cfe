"""How what goes to a page is compressed.

A whole state is 12 kB and differs from the one before it in a few hundred bytes, if the compressor remembers the one
before. uvicorn's own setting remembers 4 kB, so that a state shrinks to 3.2 kB at 650 µs; with zlib's whole window of
32 kB and level 3 it is 0.9 kB at 95 µs (level 6: 0.4 kB at 220 µs). It costs some 270 kB of memory for each page.
`tests/server/web/test_compression.py` holds both to it.
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

"""The text of a mail, from its file to the line: read off the loop, written as fast as the line takes it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, BinaryIO

from aiosmtplib.protocol import SMTPProtocol

STALL_S = 60.0  # without a byte taken; RFC 5321 4.5.3.2 has minutes
_PIECE = 1 << 18


@contextlib.asynccontextmanager
async def opened(path: Path) -> AsyncIterator[BinaryIO]:
    """The file, opened for reading in a thread; closed at the end, also if that comes while it is being opened."""
    opening: asyncio.Future[BinaryIO] = asyncio.ensure_future(asyncio.to_thread(open, path, "rb"))
    try:
        file = await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close)
        raise
    with file:
        yield file


def _close(opening: asyncio.Future[BinaryIO]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()


def next_piece(file: BinaryIO, is_line_start: bool) -> tuple[bytes, bool, int]:
    """The next piece with its dots doubled (RFC 5321 4.5.2), whether it ends a line, and how long it was."""
    piece = file.read(_PIECE)
    escaped = piece.replace(b"\n.", b"\n..")
    if is_line_start and piece.startswith(b"."):
        escaped = b"." + escaped
    return escaped, piece.endswith(b"\n"), len(piece)


async def write(protocol: SMTPProtocol, piece: bytes, answer: asyncio.Future[Any]) -> None:
    """Writes, and waits until the line has taken most of it, the server answers, or nothing moves any more."""
    protocol.write(piece)
    drained: asyncio.Future[Any] = asyncio.ensure_future(protocol._drain_helper())
    try:
        done, _ = await asyncio.wait({drained, answer}, timeout=STALL_S, return_when=asyncio.FIRST_COMPLETED)
        if not done:
            raise TimeoutError
        if drained in done:
            drained.result()
    finally:
        drained.cancel()
        with contextlib.suppress(asyncio.CancelledError, OSError):
            await drained

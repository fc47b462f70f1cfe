"""Map files made in the test: every tile is a picture of its own, so that a test sees which one it got."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Iterable
from pathlib import Path


def png(red: int, green: int, blue: int, size: int = 256) -> bytes:
    """A picture of one colour."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    row = b"\x00" + bytes((red, green, blue)) * size
    header = struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(row * size)) + chunk(b"IEND", b"")
    )


def write(path: Path, tiles: Iterable[tuple[int, int, int, bytes]], **metadata: str) -> Path:
    """An MBTiles file. `tiles`: zoom level, column, row as MBTiles counts it (from the south), data."""
    with sqlite3.connect(path) as rows:
        rows.execute("CREATE TABLE metadata (name text, value text)")
        rows.execute("CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob)")
        rows.execute("CREATE UNIQUE INDEX tile_index ON tiles (zoom_level, tile_column, tile_row)")
        rows.executemany("INSERT INTO metadata VALUES (?, ?)", metadata.items())
        rows.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", tiles)
    rows.close()
    return path

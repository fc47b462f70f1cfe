"""Map files and site pictures that would take gigabytes or never end: refused in a sentence, or without that tile."""

from __future__ import annotations

import sqlite3
import struct
import time
from contextlib import closing
from pathlib import Path

import pytest

from server.web import mbtiles
from server.web.mbtiles import LARGEST_BYTES, MapFile, MapRefused
from server.web.pictures import pixels
from server.web.site_image import site_image

pytestmark = pytest.mark.world(n=24)

TABLES = "CREATE TABLE tiles(zoom_level, tile_column, tile_row, tile_data); CREATE TABLE metadata(name, value);"
FOREVER = "WITH RECURSIVE c(n) AS (SELECT 0 UNION ALL SELECT n + 1 FROM c)"
PNG = b"\x89PNG\r\n\x1a\n"


def png(width: int, height: int) -> bytes:
    return PNG + struct.pack(">I4sII", 13, b"IHDR", width, height) + b"\x08\x00\x00\x00\x00" + bytes(4)


def jpeg(width: int, height: int) -> bytes:
    before = b"\xff\xe0" + struct.pack(">H", 16) + bytes(14) + b"\xff\xc4" + struct.pack(">H", 4) + bytes(2)
    return b"\xff\xd8" + before + b"\xff\xff\xc2" + struct.pack(">HBHH", 11, 8, height, width) + bytes(20)


def webp(kind: bytes, body: bytes) -> bytes:
    return b"RIFF" + bytes(4) + b"WEBP" + kind + bytes(4) + body


def made(path: Path, script: str, *tiles: tuple[object, object, object, object]) -> Path:
    with closing(sqlite3.connect(path)) as rows:
        rows.executescript(script)
        for tile in tiles:
            rows.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", tile)
        rows.commit()
    return path


@pytest.mark.parametrize(
    ("script", "tile", "expected"),
    [
        (TABLES, (10**12, 0, 0, png(256, 256)), "zoom levels go from 1000000000000"),
        (TABLES, ("many", 0, 0, png(256, 256)), "zoom levels go from many"),
        (TABLES, (0, 0, 0, PNG + bytes(LARGEST_BYTES)), "cannot be read: string or blob too big"),
        (
            TABLES + f"INSERT INTO metadata VALUES ('name', zeroblob({LARGEST_BYTES + 1}))",
            (0, 0, 0, png(256, 256)),
            "cannot be read: string or blob too big",
        ),
        (
            f"CREATE VIEW tiles AS {FOREVER} SELECT 0 zoom_level, 0 tile_column, n tile_row, x'89504e470d0a1a0a'"
            " tile_data FROM c",
            None,
            "cannot be read: it takes too long",
        ),
        (
            "CREATE VIEW tiles AS SELECT 0 zoom_level, 0 tile_column, 0 tile_row,"
            " CAST(x'89504e470d0a1a0a' || zeroblob(900000000) AS BLOB) tile_data",
            None,
            "cannot be read: string or blob too big",
        ),
    ],
    ids=["zoom", "zoom in words", "huge tile", "huge name", "endless view", "view that is a bomb"],
)
def test_a_map_file_that_is_a_bomb_is_refused(
    script: str,
    tile: tuple[object, object, object, object] | None,
    expected: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(mbtiles, "LOOK_S", 0.3)
    path = made(tmp_path / "a.mbtiles", script, *([tile] if tile else []))
    began_s = time.monotonic()
    with pytest.raises(MapRefused, match=expected):
        MapFile(path)
    assert time.monotonic() - began_s < 5.0


def test_metadata_without_end_are_read_in_part_and_a_tile_that_takes_too_long_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mbtiles, "TILE_S", 0.2)
    endless = f"CREATE VIEW metadata AS {FOREVER} SELECT CASE n WHEN 0 THEN 'minzoom' WHEN 1 THEN 'maxzoom' ELSE n END"
    tiles = f" name, '1' value FROM c; CREATE VIEW tiles AS {FOREVER} SELECT 1 zoom_level, 0 tile_column, n + 5"
    path = made(tmp_path / "a.mbtiles", f"{endless}{tiles} tile_row, x'89504e470d0a1a0a' tile_data FROM c")
    began_s = time.monotonic()
    with closing(MapFile(path)) as opened:
        assert opened.layer.zoom == (1, 1)
        assert opened.tile(1, 0, 0) is None
    assert time.monotonic() - began_s < 5.0


def test_a_tile_of_gigapixels_is_no_tile(tmp_path: Path) -> None:
    tiles = [(1, 0, 0, png(60_000, 60_000)), (1, 0, 1, png(512, 512)), (1, 1, 0, PNG + bytes(LARGEST_BYTES))]
    path = made(tmp_path / "a.mbtiles", TABLES, tiles[1], tiles[0], tiles[2])
    with closing(MapFile(path)) as opened:
        assert opened.tile(1, 0, 0) == (png(512, 512), "image/png")
        assert opened.tile(1, 0, 1) is None
        assert opened.tile(1, 1, 1) is None
        assert opened.tile(1, 0, 0) is not None, "the others are still there"


@pytest.mark.parametrize("data", [png(60_000, 60_000), jpeg(65_000, 65_000)], ids=["png", "jpeg"])
def test_a_site_picture_of_gigapixels_is_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "site.png"
    path.write_bytes(data)
    with pytest.raises(MapRefused, match=r"has 6\d000 × 6\d000 pixels; a phone can draw 64 million"):
        site_image(path)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (png(3, 7), (3, 7)),
        (jpeg(300, 700), (300, 700)),
        (webp(b"VP8X", bytes(4) + (299).to_bytes(3, "little") + (699).to_bytes(3, "little")), (300, 700)),
        (webp(b"VP8L", b"\x2f" + (299 | 699 << 14).to_bytes(4, "little")), (300, 700)),
        (webp(b"VP8 ", bytes(6) + struct.pack("<HH", 300, 700)), (300, 700)),
        (png(3, 7)[:20], None),
        (PNG, None),
        (jpeg(3, 7)[:30], None),
        (b"\xff\xd8\xff", None),
        (b"\xff\xd8\xff\xe0\x00\x00" * 3, None),
        (webp(b"VP8L", b""), None),
        (webp(b"what", b""), None),
        (b"", None),
    ],
)
def test_pixels_are_read_from_the_header(data: bytes, expected: tuple[int, int] | None) -> None:
    assert pixels(data) == expected

"""Map files and site pictures beyond a bound: refused in a sentence, or without that tile."""

from __future__ import annotations

import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import pytest

from server.web.maps import mbtiles
from server.web.maps.image_type import pixels
from server.web.maps.layers import site_image
from server.web.maps.mbtiles import MOST_PIXELS, MapFile, MapRefused

pytestmark = pytest.mark.world(n=24)

TABLES = "CREATE TABLE tiles(zoom_level, tile_column, tile_row, tile_data); CREATE TABLE metadata(name, value);"
MANY = "WITH RECURSIVE c(n) AS (SELECT 0 UNION ALL SELECT n + 1 FROM c LIMIT 100000)"  # some 0.05 s
LARGEST = 900_000  # bytes, where 4 MB are allowed outside these tests
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
        (TABLES, (10**12, 0, 0, png(256, 256)), "invalid zoom levels: 1000000000000"),
        (TABLES, ("many", 0, 0, png(256, 256)), "invalid zoom levels: many"),
        (TABLES, (0, 0, 0, PNG + bytes(LARGEST)), "cannot be read: string or blob too big"),
        (
            TABLES + f"INSERT INTO metadata VALUES ('name', zeroblob({LARGEST + 1}))",
            (0, 0, 0, png(256, 256)),
            "cannot be read: string or blob too big",
        ),
        (
            f"CREATE VIEW tiles AS {MANY} SELECT 0 zoom_level, 0 tile_column, n tile_row, x'89504e470d0a1a0a'"
            " tile_data FROM c",
            None,
            "cannot be read: it takes too long",
        ),
        (
            "CREATE VIEW tiles AS SELECT 0 zoom_level, 0 tile_column, 0 tile_row,"
            " CAST(x'89504e470d0a1a0a' || zeroblob(1000000) AS BLOB) tile_data",
            None,
            "cannot be read: string or blob too big",
        ),
    ],
    ids=["zoom", "zoom in words", "huge tile", "huge name", "long view", "large view"],
)
def test_a_map_file_beyond_the_bounds_is_refused(
    script: str,
    tile: tuple[object, object, object, object] | None,
    expected: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(mbtiles, "LARGEST_BYTES", LARGEST)
    monkeypatch.setattr(mbtiles, "LOOK_S", 0.0 if "long" in expected else 60.0)
    path = made(tmp_path / "a.mbtiles", script, *([tile] if tile else []))
    with pytest.raises(MapRefused, match=expected):
        MapFile(path)


def test_many_metadata_are_read_in_part_and_a_tile_that_takes_too_long_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = f"CREATE VIEW metadata AS {MANY} SELECT CASE n WHEN 0 THEN 'minzoom' WHEN 1 THEN 'maxzoom' ELSE n END"
    tiles = f" name, '1' value FROM c; CREATE VIEW tiles AS {MANY} SELECT 1 zoom_level, 0 tile_column, n"
    path = made(tmp_path / "a.mbtiles", f"{rows}{tiles} tile_row, x'89504e470d0a1a0a0000' tile_data FROM c")
    with closing(MapFile(path)) as opened:
        assert opened.layer.zoom == (1, 1)
        assert opened.tile(1, 0, 1) is not None
        monkeypatch.setattr(mbtiles, "TILE_S", 0.0)
        assert opened.tile(1, 1, 0) is None


def test_a_tile_of_too_many_pixels_is_no_tile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mbtiles, "LARGEST_BYTES", LARGEST)
    wide = png(MOST_PIXELS + 1, 256)
    tiles = [(1, 0, 0, wide), (1, 0, 1, png(512, 512)), (1, 1, 0, PNG + bytes(LARGEST))]
    path = made(tmp_path / "a.mbtiles", TABLES, tiles[1], tiles[0], tiles[2])
    with closing(MapFile(path)) as opened:
        assert opened.tile(1, 0, 0) == (png(512, 512), "image/png")
        assert opened.tile(1, 0, 1) is None
        assert opened.tile(1, 1, 1) is None
        assert opened.tile(1, 0, 0) is not None, "the others are still there"


@pytest.mark.parametrize("data", [png(8_001, 8_000), jpeg(8_001, 8_000)], ids=["png", "jpeg"])
def test_a_site_picture_of_too_many_pixels_is_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "site.png"
    path.write_bytes(data)
    with pytest.raises(MapRefused, match="has 8001 × 8000 pixels; a phone can draw 64 million"):
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

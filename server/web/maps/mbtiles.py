"""A map file: raster MBTiles 1.3, read only. https://github.com/mapbox/mbtiles-spec"""

from __future__ import annotations

import hashlib
import logging
import math
import sqlite3
import threading
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.web.maps.image_type import media_type, pixels, plain_text

log = logging.getLogger("catgraph.map")

LARGEST_BYTES = 4 << 20  # of a tile, and of all else that the file holds in one place; tiles have some 50 kB
MOST_PIXELS = 4096  # along an edge of a tile; usual are 256 and 512
MOST_METADATA = 1000  # rows
LOOK_S, TILE_S = 60.0, 1.0  # without an index a lookup scans all tiles
_STEPS = 100_000  # SQLite steps between two checks of the clock, some ms
DEEPEST = 24  # 1 cm a pixel; a deeper number is no zoom level
_VECTOR = ("pbf", "mvt", "mlt")
_GZIP = b"\x1f\x8b"  # vector tiles are packed so, pictures never


class MapRefused(Exception):
    """A file that cannot be used as a map; `str()` is one sentence for the user."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """What a page must know of a map file to draw it."""

    name: str  # another content has another name, so that a tile may be kept for ever
    title: str
    attribution: str  # plain text
    zoom: tuple[int, int]  # least and deepest there is
    bounds: tuple[float, float, float, float]  # west, south, east, north; degrees


class MapFile:
    """One open map file. Tiles can be read from any thread."""

    def __init__(self, path: Path) -> None:
        """Open and validate the file. Raises MapRefused."""
        self._path = path
        self._lock = threading.Lock()
        self._is_damage_logged = False
        self._rows = _opened(path)
        self._until_s = math.inf
        self._rows.set_progress_handler(lambda: time.monotonic() > self._until_s, _STEPS)
        try:
            self._until_s = time.monotonic() + LOOK_S
            self.layer = self._look()
        except MapRefused:
            self._rows.close()
            raise
        except (sqlite3.Error, OverflowError) as error:
            self._rows.close()
            why = "it takes too long" if time.monotonic() > self._until_s else error
            raise MapRefused(f"The map {path} cannot be read: {why}.") from None

    def close(self) -> None:
        self._rows.close()

    def tile(self, z: int, x: int, y: int) -> tuple[bytes, str] | None:
        """The picture of column x, row y from the north (XYZ, as browsers count), and its media type; None: no such."""
        if not (0 <= z <= DEEPEST and 0 <= x < 1 << z and 0 <= y < 1 << z):
            return None
        try:
            data = self._read(z, x, (1 << z) - 1 - y)  # MBTiles counts rows from the south (TMS)
        except sqlite3.Error as why:
            if not self._is_damage_logged:
                self._is_damage_logged = True
                log.error("map damaged: path=%s error=%s", self._path, why)
            return None
        kind = media_type(data) if data else None
        if not data or not kind or max(pixels(data) or (0, 0)) > MOST_PIXELS:
            return None
        return data, kind

    def _read(self, z: int, column: int, row: int) -> bytes | None:
        with self._lock:
            self._until_s = time.monotonic() + TILE_S
            found = self._rows.execute(
                "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                (z, column, row),
            ).fetchone()
        return found[0] if found and isinstance(found[0], bytes) else None

    def _look(self) -> Layer:
        names = {row[0] for row in self._rows.execute("SELECT name FROM sqlite_master WHERE type IN ('table', 'view')")}
        if "tiles" not in names:
            raise MapRefused(f"{self._path} is not an MBTiles file: it has no tiles.")
        metadata: dict[str, str] = {}
        if "metadata" in names:
            metadata = {
                str(name): str(value)
                for name, value in self._rows.execute(f"SELECT name, value FROM metadata LIMIT {MOST_METADATA}")
            }
        one = self._rows.execute("SELECT tile_data FROM tiles LIMIT 1").fetchone()
        if one is None:
            raise MapRefused(f"The map {self._path} has no tiles.")
        data = one[0] if isinstance(one[0], bytes) else b""
        if metadata.get("format", "").lower() in _VECTOR or data.startswith(_GZIP):
            raise MapRefused(
                f"The map {self._path} has vector tiles; catgraph draws raster tiles: export it as png or jpg."
            )
        if media_type(data) is None:
            raise MapRefused(f"The map {self._path} holds tiles that are neither png, nor jpg, nor webp.")
        stat = self._path.stat()
        mark = f"{self._path.resolve()} {stat.st_size} {stat.st_mtime_ns}"
        return Layer(
            name=hashlib.sha256(mark.encode()).hexdigest()[:12],
            title=plain_text(metadata.get("name") or self._path.stem),
            attribution=plain_text(metadata.get("attribution", "")),
            zoom=self._zoom(metadata),
            bounds=_bounds(metadata.get("bounds")),
        )

    def _zoom(self, metadata: dict[str, str]) -> tuple[int, int]:
        least: Any
        deepest: Any
        try:
            least, deepest = int(metadata["minzoom"]), int(metadata["maxzoom"])
        except (KeyError, ValueError):
            least, deepest = self._rows.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
        if not (isinstance(least, int) and isinstance(deepest, int) and 0 <= least <= deepest <= DEEPEST):
            raise MapRefused(f"The map {self._path} has invalid zoom levels: {least} to {deepest}.")
        return least, deepest


def _opened(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise MapRefused(f"There is no map {path}.")
    rows: sqlite3.Connection | None = None
    why: Exception | None = None
    # A file in WAL mode cannot be read without writing beside it, unless it is opened as immutable.
    for promise in ("mode=ro", "mode=ro&immutable=1"):
        try:
            rows = sqlite3.connect(f"{path.resolve().as_uri()}?{promise}", uri=True, check_same_thread=False)
            rows.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_BYTES)
            rows.execute("PRAGMA query_only = on")
            with closing(rows.execute("SELECT count(*) FROM sqlite_master")) as counted:
                counted.fetchone()
            return rows
        except sqlite3.Error as error:
            why = error
            if rows is not None:
                rows.close()
    raise MapRefused(f"{path} is not an MBTiles file, or is damaged: {why}.")


def _bounds(stated: str | None) -> tuple[float, float, float, float]:
    """West, south, east, north of the file [deg]; the whole world if they are invalid."""
    try:
        west, south, east, north = (float(part) for part in (stated or "").split(","))
    except ValueError:
        return -180.0, -90.0, 180.0, 90.0
    if not (-180 <= west < east <= 180 and -90 <= south < north <= 90 and math.isfinite(west + south + east + north)):
        return -180.0, -90.0, 180.0, 90.0
    return west, south, east, north

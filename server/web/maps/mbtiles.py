"""A map file: raster MBTiles 1.3, read only. https://github.com/mapbox/mbtiles-spec"""

from __future__ import annotations

import hashlib
import logging
import math
import sqlite3
import threading
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.web.maps.image_type import media_type, plain_text

log = logging.getLogger("catgraph.map")

DEEPEST = 24  # 1 cm a pixel; a deeper number is no zoom level
_VECTOR = ("pbf", "mvt", "mlt")
_GZIP = b"\x1f\x8b"  # vector tiles are packed so, pictures never


class MapRefused(Exception):
    """A file that cannot be shown under the map; `str()` is one sentence for whoever started the server."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """What a page must know of a map file to draw it."""

    name: str  # another content has another name, so that a tile may be kept for ever
    title: str
    attribution: str  # plain text
    zoom: tuple[int, int]  # least and deepest there is
    bounds: tuple[float, float, float, float]  # west, south, east, north; degrees


class MapFile:
    """One open map file. Its tiles may be asked for from any thread."""

    def __init__(self, path: Path) -> None:
        """Opens and looks through it. Raises MapRefused."""
        self._path = path
        self._lock = threading.Lock()
        self._said_damaged = False
        self._rows = _opened(path)
        try:
            self.layer = self._look()
        except MapRefused:
            self._rows.close()
            raise
        except (sqlite3.Error, OverflowError) as why:
            self._rows.close()
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
            if not self._said_damaged:
                self._said_damaged = True
                log.error("the map %s is damaged: %s", self._path, why)
            return None
        kind = media_type(data) if data else None
        return (data, kind) if data and kind else None

    def _read(self, z: int, column: int, row: int) -> bytes | None:
        with self._lock:
            found = self._rows.execute(
                "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                (z, column, row),
            ).fetchone()
        return found[0] if found and isinstance(found[0], bytes) else None

    def _look(self) -> Layer:
        names = {row[0] for row in self._rows.execute("SELECT name FROM sqlite_master WHERE type IN ('table', 'view')")}
        if "tiles" not in names:
            raise MapRefused(f"{self._path} is no MBTiles file: it has no tiles.")
        told: dict[str, str] = {}
        if "metadata" in names:
            told = {str(name): str(value) for name, value in self._rows.execute("SELECT name, value FROM metadata")}
        one = self._rows.execute("SELECT tile_data FROM tiles LIMIT 1").fetchone()
        if one is None:
            raise MapRefused(f"The map {self._path} has no tile in it.")
        data = one[0] if isinstance(one[0], bytes) else b""
        if told.get("format", "").lower() in _VECTOR or data.startswith(_GZIP):
            raise MapRefused(
                f"The map {self._path} holds vector tiles; catgraph draws pictures: export it as png or jpg tiles."
            )
        if media_type(data) is None:
            raise MapRefused(f"The map {self._path} holds tiles that are neither png, nor jpg, nor webp.")
        stat = self._path.stat()
        mark = f"{self._path.resolve()} {stat.st_size} {stat.st_mtime_ns}"
        return Layer(
            name=hashlib.sha256(mark.encode()).hexdigest()[:12],
            title=plain_text(told.get("name") or self._path.stem),
            attribution=plain_text(told.get("attribution", "")),
            zoom=self._zoom(told),
            bounds=_bounds(told.get("bounds")),
        )

    def _zoom(self, told: dict[str, str]) -> tuple[int, int]:
        least: Any
        deepest: Any
        try:
            least, deepest = int(told["minzoom"]), int(told["maxzoom"])
        except (KeyError, ValueError):
            least, deepest = self._rows.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
        if not (isinstance(least, int) and isinstance(deepest, int) and 0 <= least <= deepest <= DEEPEST):
            raise MapRefused(f"The map {self._path} says that its zoom levels go from {least} to {deepest}.")
        return least, deepest


def _opened(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise MapRefused(f"There is no map {path}.")
    rows: sqlite3.Connection | None = None
    why: Exception | None = None
    # A file left in WAL mode cannot even be read without writing beside it, unless it is promised that nobody writes.
    for promise in ("mode=ro", "mode=ro&immutable=1"):
        try:
            rows = sqlite3.connect(f"{path.resolve().as_uri()}?{promise}", uri=True, check_same_thread=False)
            rows.execute("PRAGMA query_only = on")
            with closing(rows.execute("SELECT count(*) FROM sqlite_master")) as counted:
                counted.fetchone()
            return rows
        except sqlite3.Error as error:
            why = error
            if rows is not None:
                rows.close()
    raise MapRefused(f"{path} is no MBTiles file, or is damaged: {why}.")


def _bounds(said: str | None) -> tuple[float, float, float, float]:
    """West, south, east, north as the file says; the whole world where what it says can be no bounds."""
    try:
        west, south, east, north = (float(part) for part in (said or "").split(","))
    except ValueError:
        return -180.0, -90.0, 180.0, 90.0
    if not (-180 <= west < east <= 180 and -90 <= south < north <= 90 and math.isfinite(west + south + east + north)):
        return -180.0, -90.0, 180.0, 90.0
    return west, south, east, north

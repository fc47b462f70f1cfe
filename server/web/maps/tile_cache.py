"""The cache of fetched tiles: an MBTiles file, readable by other programs and by `--map`.

One table is added to MBTiles 1.3: expiry, validators and last use of each tile. Any thread may use it.
"""

from __future__ import annotations

import logging
import math
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from server.web.maps.image_type import media_type

log = logging.getLogger("catgraph.map")

APPLICATION_ID = 0x4D504258  # "MPBX", MBTiles 1.3
_LOOKED_EVERY_S = 3600.0  # so seldom is it written down that a tile was looked at
_ROOM = 0.9  # of the limit is left when tiles had to go
_ROW_BYTES = 200  # of what is known of a tile, also of one that does not exist
_FORMATS = {"image/png": "png", "image/jpeg": "jpg", "image/webp": "webp"}
_TABLES = """
CREATE TABLE IF NOT EXISTS metadata (name TEXT, value TEXT);
CREATE UNIQUE INDEX IF NOT EXISTS metadata_index ON metadata (name);
CREATE TABLE IF NOT EXISTS tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB);
CREATE UNIQUE INDEX IF NOT EXISTS tile_index ON tiles (zoom_level, tile_column, tile_row);
CREATE TABLE IF NOT EXISTS catgraph_kept (
  zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER,
  bytes INTEGER, until_s REAL, etag TEXT, modified TEXT, looked_s REAL,
  PRIMARY KEY (zoom_level, tile_column, tile_row)
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS catgraph_looked ON catgraph_kept (looked_s);
"""
_AT = "zoom_level = ? AND tile_column = ? AND tile_row = ?"

Place = tuple[int, int, int]  # zoom, column, row from the north


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """A tile that is kept, or that is known not to exist (`data` None)."""

    data: bytes | None
    until_s: float  # time of day, after which it is requested again
    etag: str | None
    modified: str | None


class TileCache:
    """One cache file. A write error is logged once and the tile is not stored."""

    def __init__(self, path: Path, *, title: str, attribution: str, limit_bytes: int) -> None:
        """Opens or makes it; a file that is no such is put aside. Raises OSError where the folder cannot be used."""
        self.path = path
        self.limit_bytes = limit_bytes
        self.evicted = 0
        self.problem: str | None = None
        self._bytes = 0
        self._lock = threading.Lock()
        self._is_open = True  # a fetch may end after the server did
        path.parent.mkdir(parents=True, exist_ok=True)
        metadata = {"name": title, "attribution": attribution, "type": "baselayer", "version": "1"}
        metadata["description"] = "Tiles that catgraph fetched when they were viewed."
        try:
            self._rows = self._open(metadata)
        except sqlite3.DatabaseError as why:
            log.warning("tile cache damaged, set aside: path=%s error=%s", path, why)
            for end in ("-wal", "-shm"):
                path.with_name(path.name + end).unlink(missing_ok=True)
            path.replace(path.with_name(path.name + ".damaged"))
            self._rows = self._open(metadata)

    @property
    def size_bytes(self) -> int:
        """What the tiles take, without the file's own."""
        return self._bytes

    def close(self) -> None:
        """Leaves one file that is whole by itself."""
        with self._lock:
            if not self._is_open:
                return
            self._is_open = False
            try:
                self._describe()
                self._rows.execute("PRAGMA journal_mode = delete")
            except sqlite3.Error as why:
                log.warning("tile cache not closed: path=%s error=%s", self.path, why)
            self._rows.close()

    def get(self, place: Place, now_s: float) -> Kept | None:
        """What is kept of a tile; `now_s` is the time of day."""
        at = _mbtiles(place)
        try:
            with self._lock:
                if not self._is_open:
                    return None
                row = self._rows.execute(
                    f"SELECT until_s, etag, modified, looked_s FROM catgraph_kept WHERE {_AT}", at
                ).fetchone()
                if row is None:
                    return None
                found = self._rows.execute(f"SELECT tile_data FROM tiles WHERE {_AT}", at).fetchone()
                if now_s - row[3] > _LOOKED_EVERY_S:
                    with self._rows:
                        self._rows.execute(f"UPDATE catgraph_kept SET looked_s = ? WHERE {_AT}", (now_s, *at))
        except sqlite3.Error as why:
            self._say(why)
            return None
        data = found[0] if found and isinstance(found[0], bytes) else None
        return Kept(data=data, until_s=row[0], etag=row[1], modified=row[2])

    def put(self, place: Place, kept: Kept, now_s: float) -> None:
        """Keeps a tile, or that there is none; the ones not looked at for longest go where there is no more room."""
        at = _mbtiles(place)
        size = _ROW_BYTES + len(kept.data or b"")
        try:
            with self._lock, self._writing() as is_open:
                if not is_open:
                    return
                was = self._rows.execute(f"SELECT bytes FROM catgraph_kept WHERE {_AT}", at).fetchone()
                self._rows.execute(
                    "INSERT OR REPLACE INTO catgraph_kept VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                    (*at, size, kept.until_s, kept.etag, kept.modified, now_s),
                )
                if kept.data is None:
                    self._rows.execute(f"DELETE FROM tiles WHERE {_AT}", at)
                else:
                    self._rows.execute("INSERT OR REPLACE INTO tiles VALUES (?, ?, ?, ?)", (*at, kept.data))
                    self._widen(place[0], kept.data)
                total = self._bytes + size - (was[0] if was else 0)
                self._bytes = self._make_room(total) if total > self.limit_bytes else total
            self.problem = None
        except sqlite3.Error as why:
            self._say(why)

    def renew(self, place: Place, kept: Kept) -> None:
        """Renew the lifetime of an unchanged tile."""
        at = _mbtiles(place)
        try:
            with self._lock, self._writing() as is_open:
                if not is_open:
                    return
                self._rows.execute(
                    f"UPDATE catgraph_kept SET until_s = ?, etag = ?, modified = ? WHERE {_AT}",
                    (kept.until_s, kept.etag, kept.modified, *at),
                )
        except sqlite3.Error as why:
            self._say(why)

    @contextmanager
    def _writing(self) -> Iterator[bool]:
        """One transaction; nothing where the file is closed."""
        if not self._is_open:
            yield False
            return
        with self._rows:
            yield True

    def _open(self, metadata: dict[str, str]) -> sqlite3.Connection:
        rows = sqlite3.connect(self.path, check_same_thread=False, timeout=5.0)
        try:
            rows.execute("PRAGMA journal_mode = wal")
            rows.execute("PRAGMA synchronous = normal")
            rows.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            rows.executescript(_TABLES)
            with rows:
                rows.executemany("INSERT OR REPLACE INTO metadata VALUES (?, ?)", metadata.items())
            self._bytes = int(rows.execute("SELECT coalesce(sum(bytes), 0) FROM catgraph_kept").fetchone()[0])
            self._zoom = rows.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
        except BaseException:
            rows.close()
            raise
        return rows

    def _make_room(self, total: int) -> int:
        """How much is left once the longest unseen are gone."""
        gone = 0
        oldest = self._rows.execute(
            "SELECT zoom_level, tile_column, tile_row, bytes FROM catgraph_kept ORDER BY looked_s"
        )
        places = []
        for z, column, row, size in oldest:
            if total <= self.limit_bytes * _ROOM:
                break
            places.append((z, column, row))
            total -= size
            gone += 1
        oldest.close()
        for table in ("tiles", "catgraph_kept"):
            self._rows.executemany(f"DELETE FROM {table} WHERE {_AT}", places)
        self.evicted += gone
        log.warning("map tiles deleted, least recently viewed: count=%d path=%s", gone, self.path)
        return total

    def _widen(self, zoom: int, data: bytes) -> None:
        """Write the zoom levels, so that a file is valid even if its writer is killed."""
        least, deepest = self._zoom
        if least is not None and least <= zoom <= deepest:
            return
        self._zoom = (zoom, zoom) if least is None else (min(least, zoom), max(deepest, zoom))
        metadata = {"minzoom": str(self._zoom[0]), "maxzoom": str(self._zoom[1]), "bounds": "-180,-85,180,85"}
        if least is None:
            metadata["format"] = _FORMATS.get(media_type(data) or "", "png")
        self._rows.executemany("INSERT OR REPLACE INTO metadata VALUES (?, ?)", metadata.items())

    def _describe(self) -> None:
        """Zoom levels and bounds of what is there."""
        least, deepest = self._rows.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
        if least is None:
            return
        west, east, south, north = self._rows.execute(
            "SELECT min(tile_column), max(tile_column), min(tile_row), max(tile_row) FROM tiles WHERE zoom_level = ?",
            (deepest,),
        ).fetchone()
        n = 1 << deepest
        degrees = (_lon_deg(west, n), _lat_deg(south, n), _lon_deg(east + 1, n), _lat_deg(north + 1, n))
        bounds = ",".join(f"{one:.6f}" for one in degrees)
        metadata = {"minzoom": str(least), "maxzoom": str(deepest), "bounds": bounds}
        with self._rows:
            self._rows.executemany("INSERT OR REPLACE INTO metadata VALUES (?, ?)", metadata.items())

    def _say(self, why: sqlite3.Error) -> None:
        if self.problem is None:
            log.error("map tiles not stored: path=%s error=%s", self.path, why)
        self.problem = "Tiles cannot be stored: check the disk space."


def _mbtiles(place: Place) -> Place:
    z, x, y = place
    return z, x, (1 << z) - 1 - y  # MBTiles counts rows from the south


def _lon_deg(column: int, n: int) -> float:
    return column / n * 360.0 - 180.0


def _lat_deg(row: int, n: int) -> float:
    """The southern edge of a row counted from the south, in Web Mercator (EPSG:3857)."""
    return math.degrees(math.atan(math.sinh(math.pi * (2.0 * row / n - 1.0))))

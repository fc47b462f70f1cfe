"""A map layer that fetches tiles when a page shows them, and serves them from its cache without internet.

Two fetches run at a time, newest request first. A cached tile is served at once; an expired one is then revalidated in
the background. Files and sockets are used in threads only, never on the loop.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
import queue
import re
import threading
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from server.web.maps.image_type import media_type, plain_text
from server.web.maps.map_options import MapUpstream
from server.web.maps.mbtiles import Layer, MapRefused
from server.web.maps.tile_cache import Kept, Place, TileCache
from server.web.maps.tile_fetcher import CONNECTIONS, Pace, SourceTrouble, TileSource

T = TypeVar("T")
_Work = tuple[Callable[[], Any], "asyncio.Future[Any]"]


class DaemonThreads:
    """A few threads for work that may hang on a network: unlike a pool's they keep no server from ending.

    So many pieces of work at a time; what hangs is left to hang.
    """

    def __init__(self, count: int) -> None:
        self._work: queue.SimpleQueue[_Work | None] = queue.SimpleQueue()
        self._count = count
        self._threads: list[threading.Thread] = []

    def do(self, work: Callable[[], T]) -> Awaitable[T]:
        """Has it done by a thread; the threads begin with the first piece."""
        if not self._threads:
            self._threads = [
                threading.Thread(target=self._run, daemon=True, name="map tiles") for _ in range(self._count)
            ]
            for thread in self._threads:
                thread.start()
        answer: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        self._work.put((work, answer))
        return answer

    def close(self) -> None:
        """Each thread ends after what it is at."""
        for _ in self._threads:
            self._work.put(None)

    def _run(self) -> None:
        while (one := self._work.get()) is not None:
            work, answer = one
            found: Any = None
            failed: BaseException | None = None
            try:
                found = work()
            except BaseException as why:  # it is raised in the caller
                failed = why
            loop = answer.get_loop()
            if not loop.is_closed():
                loop.call_soon_threadsafe(_resolve, answer, found, failed)


def _resolve(answer: asyncio.Future[Any], found: Any, failed: BaseException | None) -> None:
    if answer.done():
        return
    if failed is not None:
        answer.set_exception(failed)
    else:
        answer.set_result(found)


log = logging.getLogger("catgraph.map")

WAITS_S = 12.0  # a page for a tile; then the place stays empty, and the tile is kept for the next time
LONGEST_QUEUE = 96  # three screens of tiles: older requests are no longer in view
ABSENT_S = 86_400.0  # a tile counts as missing for at most so long
_BOUNDS = (-180.0, -85.06, 180.0, 85.06)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """A picture for a page; `fresh_s` is how long the page may keep it."""

    data: bytes
    kind: str
    fresh_s: float


@dataclass(slots=True)
class _TileRequest:
    place: Place
    kept: Kept | None
    answer: asyncio.Future[Kept | None]


@dataclass(slots=True)
class _Queue:
    """Tiles that are requested and not yet there; only the loop touches it."""

    requests: dict[Place, _TileRequest] = field(default_factory=dict)
    waiting: list[_TileRequest] = field(default_factory=list)
    at_work: set[asyncio.Task[None]] = field(default_factory=set)
    dropped: int = 0


class Upstream:
    """One configured server of tiles, and what is kept of it."""

    def __init__(
        self, upstream: MapUpstream, folder: Path | None, *, now: Callable[[], float], wall_s: Callable[[], float]
    ) -> None:
        """Raises MapRefused."""
        if folder is None:
            raise MapRefused("--map-upstream needs a data folder: fetched tiles are stored there.")
        digest = hashlib.sha256(upstream.template.encode()).hexdigest()
        attribution = plain_text(upstream.attribution)
        path = folder / "maps" / f"{_slug(upstream.host)}-{digest[:8]}.mbtiles"
        try:
            self._cache = TileCache(
                path, title=upstream.host, attribution=attribution, limit_bytes=upstream.limit_mb * 1_000_000
            )
        except Exception as why:
            raise MapRefused(f"The tiles of --map-upstream cannot be kept in {path}: {why}.") from None
        self.layer = Layer(
            name=digest[8:20], title=upstream.host, attribution=attribution, zoom=upstream.zoom, bounds=_BOUNDS
        )
        self._source = TileSource(upstream)
        self._now, self._wall_s = now, wall_s
        self._pace = Pace()
        self._queue = _Queue()
        self._threads = DaemonThreads(CONNECTIONS)
        self._is_closed = False

    def close(self) -> None:
        self._is_closed = True
        self._threads.close()
        self._source.close()
        self._cache.close()

    def description(self) -> dict[str, Any]:
        """The layer's description for a page, without the address, which may contain a key."""
        return {
            "host": self._source.host,
            "problem": self._pace.problem_now(self._now()) or self._cache.problem,
            "kept_bytes": self._cache.size_bytes,
            "limit_bytes": self._cache.limit_bytes,
            "evicted": self._cache.evicted,
        }

    async def tile(self, z: int, x: int, y: int) -> Tile | None:
        """The picture of column x, row y from the north; None: there is none, or none now."""
        least, deepest = self.layer.zoom
        if self._is_closed or not (least <= z <= deepest and 0 <= x < 1 << z and 0 <= y < 1 << z):
            return None
        place = (z, x, y)
        loop = asyncio.get_running_loop()
        kept = await loop.run_in_executor(None, self._cache.get, place, self._wall_s())
        if kept is None or kept.until_s <= self._wall_s():
            tile_request = self._request(place, kept)
            if kept is None and tile_request is not None:
                try:
                    kept = await asyncio.wait_for(asyncio.shield(tile_request.answer), WAITS_S)
                except TimeoutError:
                    return None
        if kept is None or kept.data is None:
            return None
        kind = media_type(kept.data)
        if kind is None:
            return None
        return Tile(data=kept.data, kind=kind, fresh_s=max(0.0, kept.until_s - self._wall_s()))

    def _request(self, place: Place, kept: Kept | None) -> _TileRequest | None:
        """Queue a fetch; None if the tile server must not be contacted now."""
        queue = self._queue
        if place in queue.requests:
            return queue.requests[place]
        if not self._pace.may_ask(self._now()):
            return None
        tile_request = _TileRequest(place, kept, asyncio.get_running_loop().create_future())
        queue.requests[place] = tile_request
        queue.waiting.append(tile_request)
        if len(queue.waiting) > LONGEST_QUEUE:
            queue.dropped += 1
            self._done(queue.waiting.pop(0), None)
        self._go_on()
        return tile_request

    def _go_on(self) -> None:
        queue = self._queue
        while queue.waiting and len(queue.at_work) < CONNECTIONS:
            tile_request = queue.waiting.pop()
            if self._is_closed or not self._pace.may_ask(self._now()):
                self._done(tile_request, tile_request.kept)
                continue
            self._pace.note_request(self._now())
            work = asyncio.get_running_loop().create_task(self._fulfil(tile_request))
            queue.at_work.add(work)
            work.add_done_callback(self._worked)

    def _worked(self, work: asyncio.Task[None]) -> None:
        self._queue.at_work.discard(work)
        self._go_on()

    async def _fulfil(self, tile_request: _TileRequest) -> None:
        found = tile_request.kept
        try:
            found = await self._threads.do(lambda: self._fetch(tile_request.place, tile_request.kept))
            if self._pace.problem is not None:
                log.info("%s answers again", self._source.host)
            self._pace.well()
        except SourceTrouble as why:
            if self._pace.problem is None:
                log.warning("%s Stored tiles are shown.", why)
            self._pace.failed(str(why), self._now(), why.pause_s)
        finally:
            self._done(tile_request, found)

    def _done(self, tile_request: _TileRequest, found: Kept | None) -> None:
        self._queue.requests.pop(tile_request.place, None)
        if not tile_request.answer.done():
            tile_request.answer.set_result(found)

    def _fetch(self, place: Place, kept: Kept | None) -> Kept:
        """In a thread. Raises SourceTrouble."""
        wall_s = self._wall_s()
        newest = self._cache.get(place, wall_s)
        if newest is not None and newest.until_s > wall_s:  # fetched since the cache was read for this request
            return newest
        etag, modified = (kept.etag, kept.modified) if kept is not None and kept.data is not None else (None, None)
        got = self._source.fetch(*place, wall_s=wall_s, etag=etag, modified=modified)
        until_s = wall_s + (got.fresh_s or 0.0)
        if got.is_same and kept is not None:
            same = replace(kept, until_s=until_s, etag=got.etag or kept.etag, modified=got.modified or kept.modified)
            self._cache.renew(place, same)
            return same
        if got.data is None:
            until_s = min(max(until_s, wall_s + 60.0), wall_s + ABSENT_S)
        new = Kept(data=got.data, until_s=until_s, etag=got.etag, modified=got.modified)
        if got.fresh_s is not None:
            self._cache.put(place, new, wall_s)
        return new


def _slug(host: str) -> str:
    return re.sub(r"[^a-z0-9.-]+", "-", host.lower()).strip(".-")[:60] or "tiles"

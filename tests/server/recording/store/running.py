"""A car whose recordings go into a store, and what a test sees of them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

from server.protocol.answers import StoredCopy
from server.recording.catalog.catalog import Catalog
from server.recording.store.object_store import ObjectStore
from server.recording.store.rules import Situation, StoreRule
from server.recording.store.uploader import Uploader
from server.recording.store.uploads import Uploads
from tests.server.recording.store.s3 import S3

ID = "car_20260921T141320Z"
OLD = "car_20260921T131320Z"
FAST = 1e12
PART = 8192


@dataclass
class Car:
    """A server's folder, and what its clock and settings say."""

    data: Path
    s3: S3
    rule: StoreRule = field(default_factory=lambda: StoreRule(bytes_per_s=FAST, clips=False))
    later_ms: int = 0

    @property
    def folder(self) -> Path:
        return self.data / "recordings" / "car"

    def wall_ms(self) -> int:
        return time.time_ns() // 1_000_000 + self.later_ms

    @asynccontextmanager
    async def running(self) -> AsyncIterator[Running]:
        catalog = Catalog(self.folder.parent, self.data / "recordings.sqlite", now=time.monotonic, wall_ms=self.wall_ms)
        uploads = Uploads(self.data / "store" / "uploads.sqlite")
        uploader = Uploader(
            ObjectStore(self.s3.address),
            uploads,
            catalog,
            lambda: {"car": Situation(rule=self.rule)},
            clips=self.data / "store" / "clips",
            now=time.monotonic,
            wall_ms=self.wall_ms,
            look_s=0.05,
        )
        await catalog.start()
        await catalog.settled()
        await uploader.start()
        try:
            yield Running(catalog, uploader, uploads)
        finally:
            await uploader.stop()
            await catalog.stop()


@dataclass
class Running:
    catalog: Catalog
    uploader: Uploader
    uploads: Uploads

    def copy(self, id: str = ID) -> StoredCopy:
        row = self.catalog.row(id)
        assert row is not None
        return self.uploader.copy_of(row)

    async def until(self, what: Callable[[], bool]) -> None:
        async with asyncio.timeout(30):
            while not await asyncio.to_thread(what):
                await asyncio.sleep(0.02)

    async def stored(self, id: str = ID) -> None:
        await self.until(lambda: self.copy(id)["state"] == "stored")

    async def deleted_here(self, id: str = ID) -> None:
        """A file that is on its way to the trash may still be put back."""
        path = self.catalog.folder / "car" / f"{id}.mcap"

        def is_destroyed() -> bool:
            is_decided = self.uploads.get(id).is_deleted
            return is_decided and not path.exists() and self.catalog.row(id, is_trashed=True) is None

        await self.until(is_destroyed)


def whole(s3: S3, id: str = ID) -> bytes:
    """What a person with an S3 client joins."""
    prefix = f"files/car/{id}/{id}.mcap"
    return b"".join(body for key, body in sorted(s3.keys().items()) if key.startswith(prefix))

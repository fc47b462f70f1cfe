"""A store, and a car with one recording that was read already."""

from __future__ import annotations

import asyncio
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.recording.catalog.catalog import Catalog
from server.recording.store import names
from tests.server.recording.made import record
from tests.server.recording.store.running import ID, PART, Car
from tests.server.recording.store.s3 import S3, s3_server


@pytest.fixture
def s3() -> Iterator[S3]:
    with s3_server() as one:
        yield one


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(names, "PART_BYTES", PART)


@pytest.fixture(scope="module")
def read_already(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder whose recording is in the catalog: reading it takes a process and two seconds."""
    data = tmp_path_factory.mktemp("data")
    record(data / "recordings" / "car" / f"{ID}.mcap", alarms=[(2.0, "critical"), (15.0, "advisory")], seconds=60.0)

    async def survey() -> None:
        catalog = Catalog(data / "recordings", data / "recordings.sqlite", now=time.monotonic, wall_ms=lambda: 0)
        await catalog.start()
        await catalog.settled()
        await catalog.stop()

    asyncio.run(survey())
    return data


@pytest.fixture
def car(tmp_path: Path, read_already: Path, s3: S3) -> Car:
    shutil.copytree(read_already, tmp_path / "data")
    return Car(tmp_path / "data", s3)

"""Which recordings are one drive, also while some are yet to be read or cannot be."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.recording.catalog.catalog import Catalog
from server.recording.catalog.survey import VERSION
from tests.server.recording.made import record

FIRST = "car_20260921T141320Z"
DRIVE = [FIRST, f"{FIRST}_p2", f"{FIRST}_p3", f"{FIRST}_p10"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "recordings"
    for id in (*DRIVE, "car_20260921T161320Z", f"{FIRST}_clip_141330", f"{FIRST}-2"):
        record(folder / "car" / f"{id}.mcap", seconds=0.2)
    record(folder / "other" / f"{FIRST}_p4.mcap", seconds=0.2)
    return folder


@pytest.fixture
def catalog(folder: Path) -> Iterator[Catalog]:
    catalog = Catalog(folder, None, wall_ms=lambda: 0, now=lambda: 0.0)
    catalog.walk()
    yield catalog
    catalog._entries.close()


def test_parts_that_are_yet_to_be_read_are_grouped_by_their_names(catalog: Catalog) -> None:
    for id in DRIVE:
        assert catalog.drive_of(id) == DRIVE
    assert catalog.drive_of(f"{FIRST}-2") == [f"{FIRST}-2"]
    assert catalog.drive_of("car_none") == ["car_none"]


def test_a_part_that_cannot_be_read_is_of_the_drive(catalog: Catalog) -> None:
    for id, found in ((DRIVE[1], {"problem": "spoilt"}), (DRIVE[2], {"session": "s1", "sha256": "a"})):
        (entry,) = catalog._entries.select("WHERE id = ?", [id])
        entry = type(entry)(
            **{name: getattr(entry, name) for name in entry.__slots__} | {"found": found | {"survey": VERSION}}
        )
        catalog._entries.put([entry])
    for id in DRIVE:
        assert catalog.drive_of(id) == DRIVE

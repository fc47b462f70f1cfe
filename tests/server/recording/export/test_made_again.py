"""A report that was made is not returned again once the annotations of the recording have changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import Annotations
from server.recording.export.jobs import Exports
from server.recording.folder import RecordingsFolder

MARK: DriveMark = {
    "mark": "late", "marked_ms": 1_790_000_000_000, "category": None, "words": "", "voice": False, "photo": False,
    "source": "page", "by": None,
}  # fmt: skip


def add_photo(path: Path) -> None:
    folder = annotation_store.media_beside(path)
    folder.mkdir(exist_ok=True)
    (folder / "late.photo.jpg").write_bytes(b"\xff\xd8\xff")


CHANGES: dict[str, Callable[[Path], object]] = {
    "weather": lambda path: annotation_store.write(path, Annotations(weather="rain")),
    "late mark": lambda path: annotation_store.write_marks(path, [MARK], []),
    "late photo": add_photo,
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
async def test_what_was_changed_since_is_in_another_export(tmp_path: Path, change: Callable[[Path], object]) -> None:
    path = tmp_path / "recordings" / "car" / "car_1.mcap"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"")
    exports = Exports(
        tmp_path / "exports",
        RecordingsFolder(tmp_path / "recordings"),
        lambda id: path,
        lambda _: None,
        now=lambda: 0.0,
        wall_ms=lambda: 0,
    )
    first = await exports.begin("car_1", "csv")
    assert await exports.begin("car_1", "csv") is first
    change(path)
    second = await exports.begin("car_1", "csv")
    assert second is not first
    assert await exports.begin("car_1", "csv") is second
    await exports.stop()

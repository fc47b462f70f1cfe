"""Marks that came too late go into the store with the row of their recording, voice notes and photos too."""

from __future__ import annotations

import orjson
import pytest

from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from tests.server.marks.media_samples import VOICE
from tests.server.recording.made import BEGAN_MS
from tests.server.recording.store.conftest import *  # noqa: F403  (its fixtures)
from tests.server.recording.store.running import ID, Car
from tests.server.recording.store.s3 import S3

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("small_parts")]


@pytest.mark.field
async def test_late_marks_are_uploaded_once(car: Car, s3: S3) -> None:
    path = car.folder / f"{ID}.mcap"
    row: DriveMark = {
        "mark": "late", "marked_ms": BEGAN_MS + 1000, "category": "Planner", "words": "swerve", "voice": True,
        "photo": False, "source": "page", "by": "Ana",
    }  # fmt: skip
    async with car.running() as now:
        await now.until(lambda: bool(s3.sent("catalogue")))
        folder = annotation_store.media_beside(path)
        folder.mkdir()
        (folder / "late.voice.webm").write_bytes(VOICE)
        annotation_store.write_marks(path, [row], [])
        now.catalog.reread_annotations(path)
        now.uploader.rouse()
        await now.until(lambda: len(s3.sent("catalogue")) == 2)
        now.uploader.ask(ID, deletes=False)
        await now.stored()
    stored = orjson.loads(s3.keys()[f"catalogue/car/{ID}.json"])
    assert stored["late_marks"] == [row]
    assert s3.keys()[f"files/car/{ID}/marks/late.voice.webm"] == VOICE
    assert len(s3.sent("catalogue")) <= 4, "not again and again"


async def test_nothing_that_was_said_is_deleted_here_before_it_is_there(car: Car, s3: S3) -> None:
    path = car.folder / f"{ID}.mcap"
    rows: list[DriveMark] = [
        {
            "mark": f"late-{n}", "marked_ms": BEGAN_MS + n, "category": None, "words": "", "voice": n == 300,
            "photo": False, "source": "page", "by": None,
        }
        for n in range(301)
    ]  # fmt: skip
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.stored()
        await now.until(lambda: len(s3.sent("catalogue")) == 2)
        written: list[str] = []

        def say(method: str, _: str) -> float:
            if method == "PUT" and not written:  # while the deletion sends its row
                written.append(ID)
                now.catalog.annotate(ID, weather="rain")
                annotation_store.write_marks(path, rows, ["m-1"])
                folder = annotation_store.media_beside(path)
                folder.mkdir()
                (folder / "late-300.voice.webm").write_bytes(VOICE)
            return 0.0

        s3.delay_s = say
        now.uploader.ask(ID, deletes=True)
        await now.deleted_here()
    assert written
    stored = orjson.loads(s3.keys()[f"catalogue/car/{ID}.json"])
    assert stored["weather"] == "rain"
    assert stored["stored_annotations"]["name"] == "annotations.json"
    body = orjson.loads(s3.keys()[f"files/car/{ID}/annotations.json"])
    assert (body["weather"], body["marks"], body["removed"]) == ("rain", rows, ["m-1"])
    assert s3.keys()[f"files/car/{ID}/marks/late-300.voice.webm"] == VOICE

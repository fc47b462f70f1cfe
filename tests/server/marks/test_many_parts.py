"""A session of many parts, as bad radio makes them: what comes late goes beside the part of its moment."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import orjson
import pytest

from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.folder import RecordingsFolder, part_id
from server.recording.marks import described
from server.recording.marks import keeper as keeper_module
from server.recording.marks.keeper import MarkKeeper
from server.recording.marks.pending import PendingMedia
from server.recording.marks.recorded import read_marks
from server.recording.marks.settle import named_at
from server.storage import durable_file
from tests.server.recording.made import record

FIRST = "car_20260921T133320Z"
PARTS = 45
Parts = Callable[[int], Path]
EVERY_MS = 10_000
HOLDS = {5: "i-5", 8: "i-7", 6: "i-9", 40: "i-40"}  # i-7 was logged later, i-9 stands earlier than its moment
BEGAN_MS = named_at(Path(f"{FIRST}.mcap"))


def moment(part: int, s: float = 1.0) -> int:
    return BEGAN_MS + (part - 1) * EVERY_MS + round(s * 1000)


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """By HOLDS the intervention whose event a part holds."""
    folder = tmp_path_factory.mktemp("parts") / "car"
    folder.mkdir()
    for part in range(1, PARTS + 1):
        own = [{"change": "intervention", "intervention": HOLDS[part]}] if part in HOLDS else []
        record(folder / f"{part_id(FIRST, part)}.mcap", began_ms=moment(part, 0.0), seconds=2.0, own=own)
    return folder


@pytest.fixture
def part(parts: Path, tmp_path: Path) -> Parts:
    """The path of each part."""
    folder = tmp_path / "recordings" / "car"
    shutil.copytree(parts, folder)
    return lambda part: folder / f"{part_id(FIRST, part)}.mcap"


def event(n: int, change: str, **more: Any) -> dict[str, Any]:
    return {"n": n, "at_ms": moment(PARTS, 3_600.0), "change": change, "alarm": None, "by": None, **more}


def entry(n: int, id: str) -> dict[str, Any]:
    return event(n, "intervention_described", intervention=id, what=f"Words on {id}.", category=None)


def mark(id: str, marked_ms: int) -> DriveMark:
    return {
        "mark": id, "marked_ms": marked_ms, "category": None, "words": "", "voice": False, "photo": False,
        "source": "page", "by": None,
    }  # fmt: skip


def keeper(tmp_path: Path, events: list[dict[str, Any]]) -> MarkKeeper:
    async def find_events(vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        return [one for one in events if one["change"] == filters["change"]][::-1][: filters["limit"]]

    return MarkKeeper(
        RecordingsFolder(tmp_path / "recordings"),
        PendingMedia(tmp_path / "marks"),
        vehicles=lambda: ("car",),
        find_events=find_events,
        on_changed=lambda _: None,
        wall_ms=lambda: moment(PARTS, 7_200.0),
    )


def words(path: Path) -> list[str]:
    return [row["what"] for row in annotation_store.read(path).described]


async def test_each_goes_to_the_part_of_its_moment(
    part: Parts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[dict[str, Any]] = [
        entry(1, "i-5"),
        entry(2, "i-7"),
        entry(3, "i-9"),
        entry(4, "i-0"),
        entry(5, "i-40"),
    ]
    read: list[Path] = []
    reads = described.late_of

    def late_of(path: Path, *args: Any) -> Any:
        read.append(path)
        return reads(path, *args)

    one = keeper(tmp_path, events)
    one.start()
    await one.settled()
    monkeypatch.setattr(described, "late_of", late_of)
    for id, at in (("i-5", 5), ("i-7", 7), ("i-9", 9), ("i-0", 44), ("i-40", 40)):
        one.late("car", moment(at), id)
    await one.settled()
    assert [words(part(n)) for n in (5, 8, 6, 40)] == [
        ["Words on i-5."], ["Words on i-7."], ["Words on i-9."], ["Words on i-40."]
    ]  # fmt: skip
    assert set(read) == {part(5), part(8), part(6), part(40)}, "only what holds one is read as a whole"
    events += [event(10 + n, "mark", **mark(f"m{n}", moment(n, 1.5))) for n in (1, 9, 30)]
    for n in (1, 9, 30):
        one.late("car", moment(n, 1.5))
    await one.settled()
    await one.stop()
    assert [[row["mark"] for row in read_marks(part(n))] for n in (1, 2, 8, 9, 10, 30)] == [
        ["m1"], [], [], ["m9"], [], ["m30"]
    ]  # fmt: skip


async def test_a_restart_finds_it_too(part: Parts, tmp_path: Path) -> None:
    one = keeper(tmp_path, [event(1, "intervention", intervention="i-5", moment_ms=moment(5)), entry(2, "i-5")])
    one.start()
    await one.settled()
    await one.stop()
    assert words(part(5)) == ["Words on i-5."]


async def test_an_intervention_in_the_part_being_written_is_not_looked_for(
    part: Parts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part(PARTS).rename(part(PARTS).with_suffix(".mcap.writing"))
    looked: list[Path] = []

    def holds(path: Path, id: str) -> bool:
        looked.append(path)
        return False

    monkeypatch.setattr(described, "holds", holds)
    one = keeper(tmp_path, [entry(1, "i-45")])
    one.start()
    one.late("car", moment(PARTS), "i-45")
    await one.settled()
    assert looked == []
    one.late("car", moment(PARTS - 1), "i-44")
    await one.settled()
    await one.stop()
    assert len(looked) == 1 + keeper_module.MOST_PARTS


async def test_what_a_full_disk_refused_is_tried_again(
    part: Parts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = 0
    writes = durable_file.write

    def write(*args: Any, **more: Any) -> None:
        nonlocal refused
        refused += 1
        if refused <= 2:
            raise OSError(28, "No space left on device")
        writes(*args, **more)

    one = keeper(tmp_path, [entry(1, "i-5")])
    one.start()
    await one.settled()
    monkeypatch.setattr(durable_file, "write", write)
    monkeypatch.setattr(keeper_module, "TIDIES_S", 0.05)
    monkeypatch.setattr(keeper_module, "SETTLES_S", 0.0)
    one.late("car", moment(5), "i-5")
    async with asyncio.timeout(20):
        while words(part(5)) != ["Words on i-5."]:
            await asyncio.sleep(0.02)
    await one.stop()
    assert refused == 3
    assert orjson.loads(annotation_store.beside(part(5)).read_bytes())["described"]


async def test_a_folder_that_could_not_be_looked_through_is_tried_again(
    part: Parts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = 0
    holds = described.holds

    def look(path: Path, id: str) -> bool:
        nonlocal refused
        refused += 1
        if refused == 1:
            raise OSError(5, "Input/output error")
        return holds(path, id)

    monkeypatch.setattr(described, "holds", look)
    monkeypatch.setattr(keeper_module, "TIDIES_S", 0.05)
    monkeypatch.setattr(keeper_module, "SETTLES_S", 0.0)
    one = keeper(tmp_path, [entry(1, "i-5")])
    one.start()
    one.late("car", moment(5), "i-5")
    async with asyncio.timeout(20):
        while words(part(5)) != ["Words on i-5."]:
            await asyncio.sleep(0.02)
    await one.stop()

"""An intervention that is described after its recording was complete: beside the recording once, and in all that is
made of it."""

from __future__ import annotations

import asyncio
import csv
import io
import time
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import orjson
import pytest
from rosbags.highlevel import AnyReader

from server.analysis.drive.form import write_forms
from server.analysis.drive.tables import write_report_csv, write_report_json
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import Annotations
from server.recording.catalog.catalog import Catalog
from server.recording.catalog.catalog_db import Which
from server.recording.export.clip import Window, write_clip
from server.recording.export.formats.bag import write_bag
from server.recording.export.formats.csv_zip import write_csv_zip
from server.recording.folder import RecordingsFolder
from server.recording.marks.described import CHANGE, newest
from server.recording.marks.keeper import LEFT_AT_START, MarkKeeper
from server.recording.marks.pending import PendingMedia
from server.recording.marks.settle import settle_described
from server.recording.read.read import open_recording
from server.recording.verify import verify
from server.storage import durable_file
from tests.server.recording.drive.story import BEGIN_MS, BEGIN_S, EVIL, NS, STORY, logged, recorded
from tests.server.recording.made import record

FILE = "car_20260921T133320Z.mcap"
TAKEN = next(one for one in STORY if one[2]["change"] == "intervention")
BEFORE: Sequence[Any] = [one for one in STORY if one[2]["change"] != "intervention_described"]


def entry(n: int, what: str, at_s: float = 500.0, **more: Any) -> dict[str, Any]:
    at_ms = BEGIN_MS + round(at_s * 1000)
    fields = {"n": n, "at_ms": at_ms, "change": "intervention_described", "alarm": None, "by": "M. R. (Tablet)"}
    return {**fields, "intervention": "i1", "what": what, "category": "object late", **more}


def beside(path: Path) -> list[str]:
    return [row["what"] for row in annotation_store.read(path).described]


def test_the_newest_is_kept_and_only_what_the_recording_does_not_say(tmp_path: Path) -> None:
    path = recorded(tmp_path, [*BEFORE, logged(90, "intervention_described", intervention="i1", what="first")])
    annotation_store.write(path, Annotations(title="Lap"))
    entries = [entry(1, "first", category=None, by=None)]
    assert not settle_described(path, newest(entries)), "the recording has it itself"
    entries += [entry(2, "second"), entry(3, EVIL), entry(4, "of another recording", intervention="i9")]
    assert settle_described(path, newest(entries))
    assert not settle_described(path, newest(entries))
    assert beside(path) == [EVIL]
    assert annotation_store.read(path).title == "Lap"
    assert not settle_described(path, {}), "what the log no longer has stays"
    annotation_store.write_marks(path, [], ["m1"])
    assert beside(path) == [EVIL]


def test_what_is_made_of_the_recording_has_it(tmp_path: Path) -> None:
    path = recorded(tmp_path, BEFORE)
    settle_described(path, newest([entry(1, "A box.", initiated_by="operator")]))
    with open_recording([path]) as recording:
        write_report_json(recording, tmp_path / "r.json")
        write_report_csv(recording, tmp_path / "r.csv")
        write_forms(recording, tmp_path / "r.zip")
    (one,) = orjson.loads((tmp_path / "r.json").read_bytes())["interventions"]
    assert (one["what"], one["category"], one["initiated_by"]) == ("A box.", "object late", "operator")
    assert one["described_by"] == "M. R. (Tablet)"
    rows = [row for row in csv.reader(io.StringIO((tmp_path / "r.csv").read_text())) if row[0] == "intervention"]
    assert [row[-1] for row in rows] == ["object late: A box."]
    with zipfile.ZipFile(tmp_path / "r.zip") as packed:
        assert any("object late. A box." in packed.read(name).decode() for name in packed.namelist())


def test_tables_bags_and_clips_have_it_too(tmp_path: Path) -> None:
    path = recorded(tmp_path, BEFORE)
    settle_described(path, newest([entry(1, EVIL)]))
    moment_ns = TAKEN[0]
    minute = Window(at_ns=moment_ns, before_s=1.0, after_s=1.0)
    other = Window(at_ns=BEGIN_S * NS, before_s=0.0, after_s=1.0)
    with open_recording([path]) as recording:
        write_csv_zip(recording, tmp_path / "t.zip")
        write_bag(recording, tmp_path / "b.bag")
        write_clip(recording, tmp_path / "clip.mcap", minute, clip_of="ours")
        write_clip(recording, tmp_path / "other.mcap", other, clip_of="ours")
    with zipfile.ZipFile(tmp_path / "t.zip") as packed:
        table = list(csv.DictReader(io.StringIO(packed.read("alarms.csv").decode())))
    assert [orjson.loads(row["details"])["what"] for row in table if row["change"] == CHANGE] == [EVIL]
    with AnyReader([tmp_path / "b.bag"]) as reader:
        log = [one for one in reader.connections if one.topic == "/catgraph/alarms"]
        rows = [orjson.loads(reader.deserialize(raw, of.msgtype).data) for of, _, raw in reader.messages(log)]
    assert [(row["what"], row["at_ms"]) for row in rows if row["change"] == CHANGE] == [(EVIL, BEGIN_MS + 500_000)]
    found = []
    for name in ("clip.mcap", "other.mcap"):
        with open_recording([tmp_path / name]) as recording:
            found.append([event["what"] for _, event in recording.own("/catgraph/alarms") if event["change"] == CHANGE])
    assert found == [[EVIL], []]
    assert verify(tmp_path / "clip.mcap").state == "intact"


async def kept(tmp_path: Path, events: list[dict[str, Any]], changed: list[Path], then: Any = None) -> None:
    async def find_events(vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        return [one for one in events if one["change"] == filters["change"]][::-1][: filters["limit"]]

    keeper = MarkKeeper(
        RecordingsFolder(tmp_path / "recordings"),
        PendingMedia(tmp_path / "marks"),
        vehicles=lambda: ("car",),
        find_events=find_events,
        on_changed=changed.append,
        wall_ms=lambda: BEGIN_MS + 3_600_000,
    )
    keeper.start()
    await keeper.settled()
    if then is not None:
        events.append(then)
        keeper.late("car", BEGIN_MS + 80_000, "i1")
        await keeper.settled()
    await keeper.stop()


async def test_a_server_that_was_killed_does_it_at_its_next_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "recordings" / "car"
    folder.mkdir(parents=True)
    path = recorded(folder, BEFORE, name=FILE)
    path = path.rename(folder / "car_20230101T000000Z.mcap")
    for day in range(LEFT_AT_START):  # later ones, which the start looks through anyway
        record(folder / f"car_2026102{day}T000000Z.mcap", seconds=1.0)
    events = [{"n": 1, **TAKEN[2], "moment_ms": BEGIN_MS + 80_000}, entry(2, "A box.")]
    changed: list[Path] = []

    def killed(*args: Any, **more: Any) -> None:
        raise OSError("killed")

    with monkeypatch.context() as patched:
        patched.setattr(durable_file, "write", killed)
        await kept(tmp_path, events, changed)
    assert (beside(path), changed) == ([], [])
    for _ in range(2):
        await kept(tmp_path, events, changed)
    assert (beside(path), changed) == (["A box."], [path])
    await kept(tmp_path, events, changed, then=entry(3, "Two boxes."))
    assert beside(path) == ["Two boxes."]


async def test_the_logbook_counts_what_came_later_at_once(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    (folder / "car").mkdir(parents=True)
    path = recorded(folder / "car", BEFORE, name=FILE)
    (path.parent / f"{FILE}.bag").unlink()
    one = Catalog(folder, None, now=time.monotonic, wall_ms=lambda: BEGIN_MS)
    await one.start()
    try:
        async with asyncio.timeout(60):
            await one.settled()
        (drive,) = one.drives(Which())
        assert (drive["interventions"], drive["undescribed"], drive["marks"]) == (1, 1, 2)
        settle_described(path, newest([entry(1, "A box.")]))
        annotation_store.write_marks(path, [], ["m1"])
        one.reread_annotations(path)
        (drive,) = one.drives(Which())
        assert (drive["interventions"], drive["undescribed"], drive["marks"]) == (1, 0, 1)
        course = orjson.loads(one.course(drive["id"]) or b"")
        assert [event["text"] for event in course["events"] if event["kind"] == "mark"] == ["comfort"]
    finally:
        await one.stop()

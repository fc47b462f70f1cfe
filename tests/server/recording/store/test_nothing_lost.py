"""What is in the store, and what people ask for and note meanwhile, is not lost."""

from __future__ import annotations

import asyncio
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import orjson
import pytest

from server.recording.catalog.entries import Refused
from server.recording.export.export_format import ExportRefused
from server.recording.store import clips, stored_list
from server.recording.store.object_store import Found, ObjectStore
from server.recording.store.row import RowFile, RowPart
from server.recording.store.rules import StoreRule, WholeFiles
from server.recording.store.stored_list import StoredRecordings
from server.recording.store.trouble import Kind, StoreTrouble
from tests.server.recording.made import BEGAN_MS, record
from tests.server.recording.read.test_bag2 import left_open
from tests.server.recording.store.running import FAST, ID, Car, Running, whole
from tests.server.recording.store.s3 import S3

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("small_parts")]


async def deleted_here(now: Running) -> None:
    now.uploader.ask(ID, deletes=True)
    await now.deleted_here()


def recordings_below(folder: Path) -> list[Path]:
    """Recordings in this folder and below, also while folders are removed (unlike `rglob`, `walk` leaves those out)."""
    return [Path(where, name) for where, _, names in os.walk(folder) for name in names if name.endswith(".mcap")]


async def read(now: Running, path: Path) -> None:
    now.catalog.add(path)

    def is_read() -> bool:
        now.catalog._survey.rouse()
        row = now.catalog.row(ID)
        return row is not None and row["state"] == "read"

    await now.until(is_read)


@pytest.mark.field
async def test_a_name_that_is_used_again_overwrites_nothing_in_the_store(car: Car, s3: S3) -> None:
    path = car.folder / f"{ID}.mcap"
    content = path.read_bytes()
    async with car.running() as now:
        await deleted_here(now)
        kept = s3.keys()
        record(path, seconds=20.0)
        await read(now, path)
        other = path.read_bytes()
        await now.until(lambda: now.copy()["state"] == "failed")
        assert now.copy()["sentence"] == "The store has another recording of this name: rename this file."
        with pytest.raises(Refused, match="rename"):
            now.uploader.ask(ID, deletes=True)
        car.rule = StoreRule(bytes_per_s=FAST, clips=False, whole=WholeFiles.ALWAYS, deletes=True)
        now.uploader.rouse()
        await asyncio.sleep(0.3)
        with pytest.raises(Refused, match="rename"):
            now.uploader._copying.send_row(ID)
        with pytest.raises(Refused, match="rename"):
            now.uploader._copying.send_file(ID, None, print)  # type: ignore[arg-type]
        assert s3.keys() == kept
        assert path.read_bytes() == other != content
        path.write_bytes(content)  # taken back from the store
        await read(now, path)
        await now.stored()
        await asyncio.sleep(0.3)
        assert path.read_bytes() == content  # not deleted again, though the rule deletes
        assert now.copy()["is_deletion_asked"] is False
        assert s3.keys() == kept
        await deleted_here(now)
    assert whole(s3) == content


async def test_a_database_is_not_deleted_with_a_log_that_was_not_uploaded(car: Car, s3: S3, tmp_path: Path) -> None:
    killed = left_open(tmp_path / "made")
    path, log = car.folder / "drive_0.db3", car.folder / "drive_0.db3-wal"
    shutil.copy(killed, path)
    async with car.running() as now:
        id = next(row["id"] for row in now.catalog.rows().rows if row["format"] == "db3")
        now.uploader.ask(id, deletes=False)
        await now.stored(id)
        shutil.copy(f"{killed}-wal", log)
        copying = now.uploader._copying
        with pytest.raises(Refused, match="A database with a log that holds a part of it is not uploaded"):
            copying.delete_here(id, None)  # type: ignore[arg-type]
        with pytest.raises(Refused, match="A database with a log that holds a part of it is not uploaded"):
            copying.send_file(id, None, print)  # type: ignore[arg-type]
        now.uploader.ask(id, deletes=True)
        now.catalog.walk()
        now.catalog._survey.rouse()
        await now.until(lambda: now.copy(id)["sentence"].startswith("A database with a log"))
    assert (path.read_bytes(), log.stat().st_size) == (killed.read_bytes(), Path(f"{killed}-wal").stat().st_size)


async def test_only_what_was_uploaded_is_destroyed_in_the_trash(car: Car, s3: S3) -> None:
    path = car.folder / f"{ID}.mcap"
    older = car.folder.parent / ".trash" / str(2**43) / "car" / path.name
    older.parent.mkdir(parents=True)
    shutil.copyfile(path, older)
    async with car.running() as now:
        now.uploader.ask(ID, deletes=True)
        await now.until(lambda: not path.exists())
        await now.until(lambda: recordings_below(older.parents[2]) == [older])
    assert older.exists()


@pytest.mark.field
async def test_a_request_that_is_taken_back_ends_the_deletion(car: Car, s3: S3) -> None:
    path = car.folder / f"{ID}.mcap"
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.stored()
        await now.until(lambda: len(s3.sent("catalogue")) == 2)
        withdrawn: list[str] = []

        def withdraw(method: str, path: str) -> float:
            if method == "PUT" and not withdrawn:
                withdrawn.append(path)
                now.uploader.withdraw(ID)
            return 0.0

        s3.delay_s = withdraw  # while the deletion sends its row
        now.uploader.ask(ID, deletes=True)
        await now.until(lambda: bool(withdrawn))
        await asyncio.sleep(0.5)
        assert path.exists()
        assert now.copy()["is_deletion_asked"] is False
    assert len(withdrawn) == 1


async def test_a_note_that_comes_while_the_file_is_deleted_is_kept(car: Car, s3: S3) -> None:
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.stored()
        await now.until(lambda: len(s3.sent("catalogue")) == 2)
        noted: list[str] = []

        def note(method: str, path: str) -> float:
            if method == "PUT" and not noted:
                noted.append(path)
                now.catalog.annotate(ID, title="Brakes late", note="at the gate")
            return 0.0

        s3.delay_s = note
        await deleted_here(now)
    row = orjson.loads(s3.keys()[f"catalogue/car/{ID}.json"])
    assert (row["title"], row["note"]) == ("Brakes late", "at the gate")


@pytest.mark.field
async def test_a_clip_that_could_not_be_made_is_reported_and_made_later(
    car: Car, s3: S3, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def killed(arguments: object, progress: object) -> None:
        raise ExportRefused("The export failed: it ran out of memory or was killed.")

    car.rule = StoreRule(bytes_per_s=FAST)
    with monkeypatch.context() as broken:
        broken.setattr(clips, "run_worker", killed)
        async with car.running() as now:
            await now.until(lambda: "ran out of memory" in now.copy()["sentence"])
            assert now.uploader._uploads.get(ID).clips_are_made is False
    car.later_ms += 6_000
    async with car.running() as now:
        await now.until(lambda: now.copy()["clips"] == 1)
        path = car.folder / f"{ID}.mcap"
        maker = clips.ClipMaker(car.data / "none", lambda: None)

        def nothing_then() -> None:
            with maker.made(path, ID, BEGAN_MS + 86_400_000) as clip:
                assert clip is None

        await asyncio.to_thread(nothing_then)


async def test_a_name_with_a_line_after_it_is_no_name() -> None:
    good = {"name": "clip_1.mcap", "size": 1, "sha256": "a" * 64}
    assert RowPart.model_validate(good).name == "clip_1.mcap"
    for bad in ({"name": "clip_1.mcap/../x"}, {"name": "../clip_1.mcap"}, {"name": "a\n"}, {"sha256": "a" * 65}):
        with pytest.raises(ValueError, match="pattern"):
            RowPart.model_validate(good | bad)
        with pytest.raises(ValueError, match="pattern"):
            RowFile.model_validate({**good, "checked_ms": 1, "parts": [], **bad})


def test_a_store_that_hangs_takes_one_request_and_is_left_alone_after_a_failure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stored_list, "_WAITS_S", 0.05)
    entered, goes_on, calls, time_s = threading.Event(), threading.Event(), [], [0.0]

    class Hanging(ObjectStore):
        def list(self, prefix: str) -> Iterator[Found]:
            calls.append(prefix)
            entered.set()
            assert goes_on.wait(20)
            raise StoreTrouble(Kind.UNREACHABLE, "The store does not answer.")

    stored = StoredRecordings(Hanging(S3("http://127.0.0.1:9").address), now=lambda: time_s[0])

    def ask() -> str:
        with pytest.raises(StoreTrouble) as why:
            stored.page(vehicle=None, cursor=None, limit=1)
        return str(why.value)

    first = threading.Thread(target=ask)
    first.start()
    assert entered.wait(20)
    assert "is slow" in ask()
    goes_on.set()
    first.join()
    assert ask() == "The store does not answer."
    assert len(calls) == 1
    time_s[0] = stored_list.FAILED_S
    ask()
    assert len(calls) == 2

"""Recordings go into a real S3 server: in order, verified, resumed, and deleted on the car only where that is safe."""

from __future__ import annotations

import asyncio
import hashlib
import os
import time
from pathlib import Path

import orjson
import pytest

from server.recording.catalog.entries import NotThere, Refused
from server.recording.store import names
from server.recording.store.object_store import ObjectStore
from server.recording.store.rules import StoreRule, WholeFiles
from server.recording.store.stored_list import StoredRecordings
from tests.server.recording.made import BEGAN_MS, record
from tests.server.recording.store.running import FAST, ID, OLD, Car, whole
from tests.server.recording.store.s3 import S3

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("small_parts")]


@pytest.mark.field
async def test_rows_come_first_then_clips_then_whole_files(car: Car, s3: S3) -> None:
    record(car.folder / f"{OLD}.mcap", alarms=[(2.0, "advisory")], began_ms=BEGAN_MS - 3_600_000)
    car.rule = StoreRule(bytes_per_s=FAST, whole=WholeFiles.ALWAYS)
    async with car.running() as now:
        await now.stored(ID)
        await now.stored(OLD)
        await now.until(lambda: orjson.loads(s3.keys()[f"catalogue/car/{ID}.json"])["stored_file"] is not None)
        assert now.copy()["clips"] == 1
    sent = s3.sent()
    kinds = ["row" if key.startswith("catalogue") else "clip" if "/clip_" in key else "file" for key in sent]
    assert kinds[:2] == ["row", "row"]
    first_file = kinds.index("file")
    assert kinds[2:first_file] == ["clip", "row"]
    assert [key for key in sent if key.startswith("catalogue")][:2] == [
        f"catalogue/car/{ID}.json",
        f"catalogue/car/{OLD}.json",
    ]
    assert whole(s3) == (car.folder / f"{ID}.mcap").read_bytes()
    assert len(s3.sent(rf"{ID}.mcap.part-\d{{5}}$")) == names.part_count((car.folder / f"{ID}.mcap").stat().st_size) > 2
    row = orjson.loads(s3.keys()[f"catalogue/car/{ID}.json"])
    assert row["alarms"] == {"critical": 1, "warning": 0, "advisory": 1}
    assert [alarm["priority"] for alarm in row["raised"]] == ["critical", "advisory"]
    assert row["sketch"]["lines"]
    assert row["speed_mps"]
    assert row["stored_file"]["sha256"] == hashlib.sha256(whole(s3)).hexdigest()
    (clip,) = row["stored_clips"]
    body = s3.keys()[f"files/car/{ID}/{clip['name']}"]
    assert (hashlib.sha256(body).hexdigest(), body[:5]) == (clip["sha256"], b"\x89MCAP")


async def test_a_whole_file_is_sent_on_request_and_listed_for_all(car: Car, s3: S3) -> None:
    async with car.running() as now:
        await now.until(lambda: bool(s3.sent("catalogue")))
        assert now.copy()["state"] == "none"
        assert now.copy()["sentence"] == "The whole file is uploaded on request."
        stored = StoredRecordings(ObjectStore(s3.address), now=time.monotonic)
        page = stored.page(vehicle=None, cursor=None, limit=10)
        assert [(one["id"], one["file"]) for one in page["recordings"]] == [(ID, None)]
        with pytest.raises(NotThere, match="whole file"):
            stored.file("car", ID)
        now.uploader.ask(ID, deletes=False)
        await now.stored()
        await now.until(lambda: len(s3.sent("catalogue")) == 2)
    file = stored.file("car", ID)
    assert b"".join(stored.read(file)) == (car.folder / f"{ID}.mcap").read_bytes()
    s3.corrupt(file.keys[-1][0])
    with pytest.raises(Exception, match="not what it was"):
        b"".join(stored.read(file))
    with pytest.raises(NotThere):
        stored.file("..", ID)
    assert (car.folder / f"{ID}.mcap").exists()


async def test_a_stop_in_the_middle_sends_no_finished_part_again(car: Car, s3: S3) -> None:
    car.rule = StoreRule(bytes_per_s=FAST, clips=False, whole=WholeFiles.ALWAYS)
    s3.delay_s = lambda method, path: 0.05 if "part-" in path else 0.0
    async with car.running() as now:
        await now.until(lambda: len(s3.sent("part-")) >= 2)
        assert now.copy()["state"] == "uploading"
        assert 0.0 < (now.copy()["share"] or 0.0) < 1.0
    s3.delay_s = lambda method, path: 0.0
    async with car.running() as now:
        await now.stored()
    parts = s3.sent("part-")
    assert len(parts) - len(set(parts)) <= 1  # the one that was cut may have come twice
    assert whole(s3) == (car.folder / f"{ID}.mcap").read_bytes()


async def test_a_damaged_part_is_found_before_it_counts_as_stored(car: Car, s3: S3) -> None:
    car.rule = StoreRule(bytes_per_s=FAST, clips=False, whole=WholeFiles.ALWAYS, deletes=True)
    size = (car.folder / f"{ID}.mcap").stat().st_size
    last = names.part_key("car", ID, "mcap", names.part_count(size), names.part_count(size))
    second = names.part_key("car", ID, "mcap", 2, names.part_count(size))
    done: list[int] = []

    def damage(method: str, path: str) -> float:
        if method == "PUT" and path.endswith(last) and not done:
            done.append(1)
            s3.corrupt(second)
        return 0.0

    s3.delay_s = damage
    async with car.running() as now:
        await now.until(lambda: now.copy()["state"] == "failed")
        assert now.copy()["sentence"] == "The copy in the store differs from the file (part 2); it is sent again."
        assert (car.folder / f"{ID}.mcap").exists()
        car.later_ms += 6_000
        await now.deleted_here()
    assert s3.sent("part-00002") == [second, second]
    assert len(s3.sent("part-00001")) == 1


@pytest.mark.field
async def test_a_recording_is_deleted_only_after_a_verified_copy_and_only_on_request(car: Car, s3: S3) -> None:
    path = car.folder / f"{ID}.mcap"
    content = path.read_bytes()
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.stored()
        await asyncio.sleep(0.3)
        assert path.exists()
        assert now.copy()["is_deletion_asked"] is False
        s3.corrupt(names.part_key("car", ID, "mcap", 1, names.part_count(len(content))))
        car.later_ms += 11 * 60_000  # it was read back too long ago
        now.uploader.ask(ID, deletes=True)
        await now.until(lambda: "differs" in now.copy()["sentence"])
        assert path.read_bytes() == content
        car.later_ms += 6_000
        await now.deleted_here()
        assert now.catalog.row(ID) is None
    assert whole(s3) == content


async def test_a_file_that_changed_after_its_copy_was_verified_is_not_deleted(car: Car, s3: S3) -> None:
    path = car.folder / f"{ID}.mcap"
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.stored()
        body = bytearray(path.read_bytes())
        stat = path.stat()
        body[len(body) // 2] ^= 1
        path.write_bytes(bytes(body))
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))  # size and time say nothing
        now.uploader.ask(ID, deletes=True)
        await now.until(lambda: now.copy()["sentence"] == "The file changed after it was uploaded.")
        assert path.read_bytes() == bytes(body)
        assert whole(s3) != bytes(body)


@pytest.mark.field
async def test_what_is_being_recorded_is_neither_listed_nor_deleted(car: Car, s3: S3) -> None:
    car.rule = StoreRule(bytes_per_s=FAST, clips=False, whole=WholeFiles.ALWAYS, deletes=True)
    running = car.folder / "car_20260921T151320Z.mcap"
    record(running, is_closed=False, began_ms=BEGAN_MS + 3_600_000)
    async with car.running() as now:
        await now.deleted_here()
        await asyncio.sleep(0.2)
    assert [path.name for path in car.folder.iterdir()] == [f"{running.name}.writing"]
    assert s3.sent(running.stem) == []


async def test_a_setting_of_never_refuses_requests(car: Car) -> None:
    car.rule = StoreRule(whole=WholeFiles.NEVER)
    async with car.running() as now:
        with pytest.raises(Refused, match="not uploaded"):
            now.uploader.ask(ID, deletes=False)
        with pytest.raises(NotThere):
            now.uploader.ask("nothing", deletes=False)


@pytest.mark.field
async def test_a_request_that_is_taken_back_ends_the_upload(car: Car, s3: S3) -> None:
    s3.delay_s = lambda method, path: 0.1 if "part-" in path else 0.0
    async with car.running() as now:
        now.uploader.ask(ID, deletes=True)
        await now.until(lambda: len(s3.sent("part-")) >= 1)
        now.uploader.withdraw(ID)
        await now.until(lambda: now.copy()["state"] == "none")
        count = len(s3.sent("part-"))
        await asyncio.sleep(0.3)
        assert len(s3.sent("part-")) <= count + 1
        assert now.copy()["is_deletion_asked"] is False


@pytest.mark.field
@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ((507, "InsufficientStorage"), "is full."),
        ((403, "AccessDenied"), "refuses the login (AccessDenied)."),
        ((404, "NoSuchBucket"), "has no bucket recordings."),
        ((503, "SlowDown"), "requests a pause (503)."),
    ],
)
async def test_a_store_that_refuses_is_named_and_tried_again(
    car: Car, s3: S3, fault: tuple[int, str], sentence: str
) -> None:
    s3.fault = lambda method, path: fault if "part-" in path else None
    async with car.running() as now:
        now.uploader.ask(ID, deletes=True)
        await now.until(lambda: now.uploader.facts()["problem"] is not None)
        assert now.copy()["state"] == "failed"
        assert now.copy()["sentence"].endswith(sentence)
        assert (car.folder / f"{ID}.mcap").exists()
        count = len(s3.requests)
        await asyncio.sleep(0.3)
        assert len(s3.requests) == count  # it waits
        s3.fault = lambda method, path: None
        car.later_ms += 6_000
        await now.deleted_here()
        assert now.uploader.facts()["problem"] is None


async def test_a_store_that_is_away_is_named(tmp_path: Path, car: Car, s3: S3) -> None:
    endpoint, s3.endpoint = s3.endpoint, "http://127.0.0.1:9"
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.until(lambda: now.copy()["state"] == "failed")
        assert now.copy()["sentence"] == "The store 127.0.0.1:9 does not answer."
    s3.endpoint = endpoint
    async with car.running() as now:
        await now.stored()  # the request was kept


async def test_a_damaged_state_is_set_aside(car: Car, s3: S3) -> None:
    database = car.data / "store" / "uploads.sqlite"
    database.parent.mkdir()
    database.write_bytes(b"no database at all" * 1000)
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.stored()
    assert database.with_name("uploads.unusable.sqlite").exists()


async def test_the_login_is_in_no_log(car: Car, s3: S3, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("DEBUG")
    s3.fault = lambda method, path: (500, "InternalError") if "part-" in path else None
    async with car.running() as now:
        now.uploader.ask(ID, deletes=False)
        await now.until(lambda: now.copy()["state"] == "failed")
    ours = " ".join(record.getMessage() for record in caplog.records if record.name.startswith("catgraph"))
    assert "part=" not in ours
    assert "a-secret" not in caplog.text
    assert "Signature" not in ours

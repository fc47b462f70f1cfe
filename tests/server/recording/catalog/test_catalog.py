"""The list of recordings: made of the files alone, in pages, searched, deleted and taken back."""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import signal
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog import catalog_db
from server.recording.catalog.annotations import Annotations
from server.recording.catalog.catalog import Catalog
from server.recording.catalog.catalog_db import Entry, Which
from server.recording.catalog.discovery import id_of
from server.recording.catalog.entries import NotThere, Refused
from server.recording.folder import is_id
from tests.server.recording.made import BEGAN_MS, record

NOW_MS = BEGAN_MS + 1_000_000
HOUR_MS = 3_600_000


def made(root: Path, *, now: Callable[[], float] = time.monotonic) -> Catalog:
    return Catalog(root / "recordings", root / "recordings.sqlite", wall_ms=lambda: NOW_MS, now=now)


@contextlib.asynccontextmanager
async def catalog(root: Path, *, settle: bool = True) -> AsyncIterator[Catalog]:
    one = made(root)
    await one.start()
    try:
        if settle:
            async with asyncio.timeout(60):
                await one.settled()
        yield one
    finally:
        await one.stop()


def some(root: Path) -> Path:
    """Two vehicles, a clip, a bag, and two files that are none."""
    folder = root / "recordings"
    record(folder / "blue" / "blue_20260921T141320Z.mcap", alarms=[(3.0, "critical")], began_ms=BEGAN_MS)
    record(folder / "blue" / "blue_20260921T151320Z.mcap", began_ms=BEGAN_MS + HOUR_MS, part="2")
    record(folder / "red" / "red_20260921T161320Z.mcap", began_ms=BEGAN_MS + 2 * HOUR_MS, at=None)
    record(folder / "red" / "red_20260921T171320Z_clip_1.mcap", began_ms=BEGAN_MS + 3 * HOUR_MS, clip_of="red_x")
    (folder / "red" / "notes.mcap").write_text("hello")
    (folder / "blue" / "blue_20260921T171320Z.mcap.damaged").write_bytes(b"\x89MCAP0\r\n")
    annotation_store.write(
        folder / "blue" / "blue_20260921T141320Z.mcap", Annotations(title="Wet lot", tags=("wet", "lot 3"))
    )
    return folder


def ids(rows: list[dict[str, Any]]) -> list[str]:
    return [row["id"] for row in rows]


async def test_a_drive_keeps_the_sketch_of_its_signals_until_it_is_destroyed(tmp_path: Path) -> None:
    record(tmp_path / "recordings" / "blue" / "blue_20260921T141320Z.mcap")
    async with catalog(tmp_path) as one:
        (row,) = one.rows().rows
        found = one.trends(row["id"])
        assert found is not None
        assert any(low is not None for low in found["signals"]["speed"]["lowest"])
        assert found["length_s"] == row["length_s"]
        assert one.trends("no_such") is None
        assert "trends" not in (one._entries.by_id(row["id"]) or row).found  # a list reads every row
        one.delete(row["id"])
        one.restore(row["id"])
        await one.settled()
        assert one.trends(row["id"]) == found  # by its content, wherever it is
    async with catalog(tmp_path) as one:
        assert one.trends(row["id"]) == found
        one.delete(row["id"])
        one.destroy(None)
    async with catalog(tmp_path) as one:
        assert one._entries.body("trends", row["sha256"] or "") is None


@pytest.mark.field
async def test_what_is_in_the_folder_is_listed_newest_first(tmp_path: Path) -> None:
    some(tmp_path)
    async with catalog(tmp_path) as one:
        rows = one.rows().rows
        by_id = {row["id"]: row for row in rows}
        assert [row["started_ms"] for row in rows] == sorted((row["started_ms"] for row in rows), reverse=True)
        assert len(rows) == 6
        wet = by_id["blue_20260921T141320Z"]
        assert (wet["title"], wet["tags"], wet["alarms"]["critical"]) == ("Wet lot", ["wet", "lot 3"], 1)
        assert (wet["state"], wet["format"], wet["vehicle"], wet["length_s"]) == ("read", "mcap", "blue", 20.0)
        assert by_id["red_20260921T171320Z_clip_1"]["is_clip"]
        broken = [row for row in rows if row["state"] == "unreadable"]
        assert sorted(row["file"] for row in broken) == ["blue_20260921T171320Z.mcap.damaged", "notes.mcap"]
        assert all(row["problem"].endswith(".") for row in broken)
        assert one.unreadable == 2
        assert one.totals()["count"] == 6
        assert one.totals()["bytes"] == sum(row["size_bytes"] for row in rows)
        assert one.names() == {"vehicles": ["blue", "red"], "tags": ["lot 3", "wet"]}
        full = one.row("blue_20260921T141320Z")
        assert full is not None
        assert [raised["priority"] for raised in full["raised"]] == ["critical"]


@pytest.mark.field
async def test_a_lost_database_is_made_anew_to_the_same_rows(tmp_path: Path) -> None:
    some(tmp_path)
    async with catalog(tmp_path) as one:
        one.annotate("red_20260921T161320Z", title="No sky", note="under the roof\nall the way", tags=["roof"])
        one.delete("blue_20260921T151320Z")
        before, trash = one.rows().rows, one.rows(Which(is_trashed=True)).rows
    assert len(before) == 5
    for path in tmp_path.glob("recordings.sqlite*"):
        path.unlink()
    async with catalog(tmp_path) as one:
        assert one.rows().rows == before
        assert one.rows(Which(is_trashed=True)).rows == trash
        one.rebuild()
        await one.settled()
        assert one.rows().rows == before


@pytest.mark.parametrize("content", [b"not a database at all" * 900, b"SQLite format 3\x00" + b"\xff" * 5000])
async def test_a_damaged_database_is_made_anew(tmp_path: Path, content: bytes) -> None:
    some(tmp_path)
    (tmp_path / "recordings.sqlite").write_bytes(content)
    async with catalog(tmp_path) as one:
        assert len(one.rows().rows) == 6


async def test_a_database_that_cannot_be_written_is_one_in_memory(tmp_path: Path) -> None:
    some(tmp_path)
    (tmp_path / "recordings.sqlite").mkdir()
    async with catalog(tmp_path) as one:
        assert len(one.rows().rows) == 6
        assert one.annotate("red_20260921T161320Z", title="Kept all the same")["title"] == "Kept all the same"
    assert annotation_store.read(tmp_path / "recordings/red/red_20260921T161320Z.mcap").title == "Kept all the same"


async def test_what_is_known_is_not_read_again_and_what_changed_is(tmp_path: Path) -> None:
    folder = some(tmp_path)
    async with catalog(tmp_path):
        pass
    path = folder / "blue" / "blue_20260921T141320Z.mcap"
    path.unlink()
    record(path, seconds=5.0)
    async with catalog(tmp_path, settle=False) as one:
        one.walk()
        assert one.waiting == 1
        row = one.row("blue_20260921T141320Z")
        assert row is not None
        assert (row["state"], row["length_s"], row["title"]) == ("waiting", None, "Wet lot")
        await one.settled()
        assert one.row("blue_20260921T141320Z")["length_s"] == 5.0  # type: ignore[index]


async def test_a_recording_is_listed_as_soon_as_it_is_finished(tmp_path: Path) -> None:
    async with catalog(tmp_path) as one:
        assert one.rows().rows == []
        path = record(tmp_path / "recordings" / "car" / "car_20260921T141320Z.mcap")
        one.add(path)
        (row,) = one.rows().rows
        assert row["id"] == "car_20260921T141320Z"
        assert row["state"] in ("waiting", "read")
        assert row["started_ms"] // 1000 == BEGAN_MS // 1000
        assert one.path(row["id"]) == path
        async with asyncio.timeout(30):
            await one.settled()
        assert one.rows().rows[0]["state"] == "read"
        one.add(tmp_path / "elsewhere.mcap")  # not in the folder
        one.add(tmp_path / "recordings" / "car" / "gone.mcap")
        assert len(one.rows().rows) == 1


async def test_files_copied_in_by_hand_are_found_once_a_list_is_requested(tmp_path: Path) -> None:
    some(tmp_path)
    async with catalog(tmp_path) as one:
        shutil.copytree(tmp_path / "recordings" / "blue", tmp_path / "recordings" / "copy of blue")
        one.look_again()  # that was done a moment ago
        assert len(one.rows().rows) == 6
        one._survey._walked_s = -1000.0
        one.look_again()
        async with asyncio.timeout(30):
            while len(rows := one.rows().rows) < 9:
                await asyncio.sleep(0.02)
            await one.settled()
        assert len(set(ids(rows))) == 9
        shutil.rmtree(tmp_path / "recordings" / "copy of blue")
        one.walk()
        assert len(one.rows().rows) == 6


async def test_an_unchanged_folder_is_not_walked_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = some(tmp_path)
    for path in folder.rglob("*.mcap*"):
        os.utime(path, ns=(1, NOW_MS * 1_000_000 - 10**12))
    looked: list[Path] = []
    one = made(tmp_path)
    listing = one._listing
    look = listing.look
    monkeypatch.setattr(listing, "look", lambda path, known: looked.append(path) or look(path, known))
    for change, seen in (
        (lambda: None, 12),  # each once while walking, and once more where it is new
        (lambda: None, 0),
        (lambda: annotation_store.write(folder / "red" / "notes.mcap", Annotations(title="New")), 7),
        (lambda: (folder / "red" / "notes.mcap").write_text("it grows while it is copied"), 0),
        (lambda: os.utime(folder / "red" / "notes.mcap", ns=(1, NOW_MS * 1_000_000)), 0),
        (lambda: (folder / "red" / "more.mcap").write_text("x"), 9),
        (lambda: None, 7),  # two of them changed just now
    ):
        looked.clear()
        change()
        listing.walk_if_changed()
        assert len(looked) == seen
    await one.stop()


async def test_hidden_files_links_and_what_is_being_written_are_not_listed(tmp_path: Path) -> None:
    folder = some(tmp_path)
    outside = tmp_path / "outside.mcap"
    outside.write_text("secret")
    (folder / "red" / "link.mcap").symlink_to(outside)
    (folder / "loop").symlink_to(folder)
    (folder / "red" / ".hidden.mcap").write_text("x")
    (folder / "red" / "red_20260921T181320Z.mcap.writing").write_text("x")
    (folder / "red" / "red_20260921T181320Z.mcap.recovering").write_text("x")
    (folder / ".trash" / "not a time" / "red").mkdir(parents=True)
    (folder / ".trash" / "not a time" / "red" / "a.mcap").write_text("x")
    async with catalog(tmp_path) as one:
        assert one.totals()["count"] == 6
        assert one.totals(Which(is_trashed=True))["count"] == 0


async def test_names_that_are_no_text(tmp_path: Path) -> None:
    folder = tmp_path / "recordings" / "car"
    folder.mkdir(parents=True)
    try:
        Path(os.fsdecode(bytes(folder) + b"/odd\xff name.mcap")).write_text("x")
    except OSError:
        pytest.skip("this disk takes no such names")
    async with catalog(tmp_path) as one:
        (row,) = one.rows().rows
        assert is_id(row["id"])
        assert row["file"] == "odd name.mcap"
        assert one.path(row["id"]) is not None
        one.delete(row["id"])
        one.restore(row["id"])
        assert one.path(row["id"]) is not None


@pytest.mark.parametrize(
    ("which", "expected"),
    [
        (Which(vehicle="blue"), 3),
        (Which(vehicle="green"), 0),
        (Which(tag="WET"), 1),
        (Which(tag="we"), 0),
        (Which(tag="lot 3"), 1),
        (Which(text="wet LOT"), 1),
        (Which(text="red"), 3),
        (Which(text="%"), 0),
        (Which(text="'"), 0),
        (Which(since_ms=BEGAN_MS + 2 * HOUR_MS, until_ms=BEGAN_MS + 3 * HOUR_MS), 1),
        (Which(since_ms=BEGAN_MS, until_ms=BEGAN_MS), 0),
        (Which(vehicle="blue", text="wet", since_ms=BEGAN_MS), 1),
    ],
    ids=str,
)
async def test_filters(tmp_path: Path, which: Which, expected: int) -> None:
    some(tmp_path)
    one = made(tmp_path)
    one.walk()
    rows = one.rows(which).rows
    assert len(rows) == expected
    assert one.totals(which)["count"] == expected
    await one.stop()


async def test_a_search_names_the_mark_that_it_found(tmp_path: Path) -> None:
    names = ("twice", "Steering hunts", "hunts again")
    marks = tuple(
        DriveMark(mark=f"m{n}", marked_ms=BEGAN_MS + n, category="comfort" if n == 2 else None, words=words,
                  voice=False, photo=False, source="page", by=None)
        for n, words in enumerate(names)
    )  # fmt: skip
    folder = some(tmp_path)
    annotation_store.write_marks(folder / "blue" / "blue_20260921T141320Z.mcap", marks, [])
    one = made(tmp_path)
    one.walk()
    for text, mark in (("HUNTS", "m1"), ("comfort", "m2"), ("wet lot", None)):
        (row,) = one.rows(Which(text=text)).rows
        assert row.get("matched", {}).get("mark") == mark, text
    assert all("matched" not in row for row in one.rows().rows)
    await one.stop()


async def test_pages_follow_each_other_without_a_gap_or_a_double(tmp_path: Path) -> None:
    one = made(tmp_path)
    catalog_db.put(
        one._entries._database,
        [
            Entry(
                path=f"car/car_{n}.mcap", id=f"car_{n}", trashed_ms=None, vehicle="car",
                started_ms=BEGAN_MS + n // 3, size=n, changed_ns=n,
            )
            for n in range(100)
        ],
    )  # fmt: skip
    found, cursor = [], None
    while True:
        page = one.rows(cursor=cursor, limit=7)
        found += ids(page.rows)
        if page.next is None:
            break
        cursor = page.next
    assert len(found) == len(set(found)) == 100
    for bad in ("", "x", "1", "1.", "1.a b", "9" * 30 + ".a", "1.a; DROP TABLE recording"):
        with pytest.raises(Refused, match="start again"):
            one.rows(cursor=bad)
    await one.stop()


async def test_deleted_is_not_gone_until_somebody_empties_the_trash(tmp_path: Path) -> None:
    folder = some(tmp_path)
    id = "blue_20260921T141320Z"
    async with catalog(tmp_path) as one:
        deleted = one.delete(id)
        assert deleted["trashed_ms"] == NOW_MS
        assert one.row(id) is None
        assert one.path(id) is None
        assert not (folder / "blue" / f"{id}.mcap").exists()
        (row,) = one.rows(Which(is_trashed=True)).rows
        assert (row["id"], row["title"], row["alarms"]["critical"]) == (id, "Wet lot", 1)
        with pytest.raises(NotThere, match="no such recording"):
            one.delete(id)
    async with catalog(tmp_path) as one:  # after a restart too
        back = one.restore(id)
        assert back["title"] == "Wet lot"
        assert one.path(id) == folder / "blue" / f"{id}.mcap"
        assert not any((folder / ".trash").iterdir())
        with pytest.raises(NotThere, match="not in the trash"):
            one.restore(id)
        one.delete(id)
        one.delete("red_20260921T161320Z")
        assert one.destroy(id)["count"] == 1
        with pytest.raises(NotThere):
            one.destroy(id)
        assert one.destroy(None)["count"] == 1
        assert not any((folder / ".trash").iterdir())
        assert one.totals()["count"] == 4


class Killed(BaseException):
    """As kill -9: nothing after it is done."""


@pytest.mark.parametrize("back", [False, True], ids=["deleting", "taking back"])
@pytest.mark.parametrize("at", ["shutil.copyfile", "os.rename", "renamed"])
def test_a_kill_while_it_is_moved_costs_neither_the_recording_nor_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: str, back: bool
) -> None:
    some(tmp_path)
    id = "blue_20260921T141320Z"
    one = made(tmp_path)
    one.walk()
    if back:
        one.delete(id)

    rename = os.rename

    def kill(*paths: Any) -> None:
        if at == "renamed":
            rename(*paths)
        raise Killed

    with monkeypatch.context() as patched:
        patched.setattr("os.rename" if at == "renamed" else at, kill)
        with pytest.raises(Killed):
            (one.restore if back else one.delete)(id)
    again = made(tmp_path)
    again.walk()
    found = [row for is_trashed in (False, True) for row in again.rows(Which(is_trashed=is_trashed)).rows]
    assert [row["title"] for row in found if row["id"] == id] == ["Wet lot"]
    assert len(found) == 6
    one._entries._database.close()
    again._entries._database.close()


async def test_what_is_being_recorded_is_not_deleted(tmp_path: Path) -> None:
    folder = some(tmp_path)
    (folder / "red" / "red_20260921T181320Z.mcap.writing").write_text("x")
    async with catalog(tmp_path) as one:
        with pytest.raises(Refused, match="being recorded now"):
            one.delete("red_20260921T181320Z")
    assert (folder / "red" / "red_20260921T181320Z.mcap.writing").exists()


async def test_one_of_the_same_name_again_is_not_overwritten(tmp_path: Path) -> None:
    folder = some(tmp_path)
    path = folder / "red" / "red_20260921T161320Z.mcap"
    async with catalog(tmp_path) as one:
        old = path.read_bytes()
        one.delete(path.stem)
        record(path, seconds=3.0)
        one.add(path)
        with pytest.raises(Refused, match="recording of that name exists"):
            one.restore(path.stem)
        one.delete(path.stem)  # both at the same moment of the clock
        assert one.totals(Which(is_trashed=True))["count"] == 2
        one.restore(path.stem)
        assert path.read_bytes() != old, "the one that was deleted last comes back first"


async def test_a_folder_that_may_not_be_written_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    some(tmp_path)
    id = "blue_20260921T141320Z"
    async with catalog(tmp_path) as one:

        def refuse(*_: object, **__: object) -> None:
            raise OSError(30, "Read-only file system")

        monkeypatch.setattr("os.rename", refuse)
        monkeypatch.setattr("os.replace", refuse)
        with pytest.raises(Refused, match="It cannot be moved: read-only file system"):
            one.delete(id)
        with pytest.raises(Refused, match="It cannot be stored: read-only file system"):
            one.annotate(id, title="New")
        assert one.row(id)["title"] == "Wet lot"  # type: ignore[index]


async def test_a_file_that_kills_its_reader_is_reported_and_the_next_one_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    some(tmp_path)
    async with catalog(tmp_path, settle=False) as one:
        surveyor = one._survey._surveyor
        ask = surveyor.ask

        async def ask_and_kill(path: Path) -> dict[str, Any]:
            if path.name == "red_20260921T161320Z.mcap":
                (await surveyor._running()).send_signal(signal.SIGSTOP)  # so that it does not answer before
                asyncio.get_running_loop().call_later(0.1, kill)
            return await ask(path)

        def kill() -> None:
            assert surveyor._starting is not None
            surveyor._starting.result().kill()

        monkeypatch.setattr(surveyor, "ask", ask_and_kill)
        one.rebuild()
        async with asyncio.timeout(60):
            await one.settled()
        row = one.row("red_20260921T161320Z")
        assert row is not None
        assert row["problem"] == "red_20260921T161320Z.mcap could not be read: the reader failed."
        assert one.row("blue_20260921T141320Z")["state"] == "read"  # type: ignore[index]


async def test_a_disk_that_is_full_leaves_a_list_in_memory(tmp_path: Path) -> None:
    some(tmp_path)
    async with catalog(tmp_path) as one:
        one._entries._database.execute("PRAGMA query_only=ON")  # as a disk that takes nothing more
        assert one.annotate("red_20260921T161320Z", title="Still")["title"] == "Still"
        assert len(one.rows().rows) == 6
        assert one.row("red_20260921T161320Z")["title"] == "Still"  # type: ignore[index]


@given(st.text(max_size=200), st.booleans())
def test_any_name_of_a_file_gets_an_id_that_is_one(name: str, in_folder: bool) -> None:
    inside = f"car/{name}.mcap" if in_folder else f"{name}.mcap"
    with contextlib.suppress(UnicodeEncodeError):
        assert is_id(id_of(inside))


def test_ids_are_those_of_the_recorder_and_otherwise_of_the_place() -> None:
    assert id_of("car/car_20260921T141320Z_p2.mcap") == "car_20260921T141320Z_p2"
    copies = {id_of(f"{folder}/car_20260921T141320Z.mcap") for folder in ("car", "copy", "a/car", "b/car")}
    assert len(copies) == 4
    assert id_of("car/car_1.bag") != id_of("car/car_1.mcap")


@given(st.text(max_size=300))
def test_no_id_leads_out_of_the_folder(id: str) -> None:
    one = Catalog(Path("/proc/none"), None, wall_ms=lambda: 0, now=time.monotonic)
    assert one.path(id) is None
    assert one.row(id) is None
    for act in (one.delete, one.restore, one.destroy):
        if id:
            with pytest.raises(NotThere):
                act(id)
    one._entries._database.close()


@pytest.mark.field
async def test_a_thousand_recordings_are_listed_fast(tmp_path: Path) -> None:
    folder = tmp_path / "recordings" / "car"
    source = record(tmp_path / "car" / "car_0.mcap", seconds=1.0)
    folder.mkdir(parents=True)
    for n in range(1000):
        os.link(source, folder / f"car_20260921T{n:06d}Z.mcap")
    one = made(tmp_path)
    began = time.perf_counter()
    one.walk()
    walked_s = time.perf_counter() - began
    sketched = {"lines": [[1.5] * 80], "start": [1, 2], "marks": []}
    with one._entries.lock:
        entries = one._entries.select("", [])
        catalog_db.put(one._entries._database, [_found(entry, sketched) for entry in entries])
    began = time.perf_counter()
    page = one.rows(limit=50)
    listed_s = time.perf_counter() - began
    began = time.perf_counter()
    assert one.rows(Which(text="t000999")).rows
    found_s = time.perf_counter() - began
    print(f"walked {walked_s * 1000:.0f} ms, a page {listed_s * 1000:.1f} ms, a search {found_s * 1000:.1f} ms")
    assert len(page.rows) == 50
    assert one.totals()["count"] == 1000
    assert walked_s < 5.0
    assert listed_s < 0.25
    assert found_s < 0.25
    await one.stop()


def _found(entry: Entry, sketched: dict[str, Any]) -> Entry:
    return replace(entry, found={"survey": 2, "length_s": 1.0, "sketch": sketched})

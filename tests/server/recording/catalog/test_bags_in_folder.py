"""A ROS 2 bag in the folder of recordings is one recording, whatever files it is made of."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
import zstandard

from server.analysis.drive.drive_report import DriveReport
from server.protocol.marks import DriveMark
from server.recording import space
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.catalog import Catalog
from server.recording.catalog.discovery import files_below
from server.recording.catalog.entries import Refused
from server.recording.catalog.survey import survey
from server.recording.marks.recorded import marks_of
from server.recording.marks.rows import row_of
from server.recording.read import temporary_copy
from server.recording.read.read import open_recording
from tests.server.recording.bags import Drive, write_ros2
from tests.server.recording.read.test_bag2 import EACH, PARTS, database, left_open, split


def catalog(folder: Path) -> Catalog:
    found = Catalog(folder, None, wall_ms=lambda: 1_790_000_000_000, now=lambda: 0.0)
    found.walk()
    return found


def test_a_split_bag_is_one_recording(tmp_path: Path) -> None:
    bag = split(tmp_path / "recordings", "mcap")
    for made in (tmp_path / "recordings").glob("part_*"):
        shutil.rmtree(made)
    listed = catalog(tmp_path / "recordings")
    (row,) = listed.rows().rows
    assert (row["file"], row["format"]) == ("drive", "folder")
    assert row["size_bytes"] == sum(file.stat().st_size for file in bag.iterdir())
    assert listed.path(row["id"]) == bag
    assert row["several_files"] == "a folder of several files"
    found = survey(bag)
    assert (found["messages"], found["damage"]) == (PARTS * EACH, [])
    assert len(found["sha256"]) == 64
    before = found["sha256"]
    (bag / "drive_1.mcap").write_bytes((bag / "drive_0.mcap").read_bytes())
    assert survey(bag)["sha256"] != before


def test_a_split_bag_without_metadata_is_one_and_what_is_beside_it_another(tmp_path: Path) -> None:
    bag = split(tmp_path, "sqlite3")
    for made in tmp_path.glob("part_*"):
        shutil.rmtree(made)
    (bag / "metadata.yaml").unlink()
    assert list(files_below(tmp_path)) == [bag]
    shutil.copy(bag / "drive_0.db3", bag / "other.db3")  # whether they are parts of it nobody knows
    assert len(list(files_below(tmp_path))) == PARTS + 1


def test_parts_that_were_listed_one_by_one_are_listed_no_more(tmp_path: Path) -> None:
    bag = split(tmp_path / "r", "mcap")
    for made in (tmp_path / "r").glob("part_*"):
        shutil.rmtree(made)
    text = (bag / "metadata.yaml").read_text()
    (bag / "metadata.yaml").unlink()
    bag.rename(bag.with_name("x"))
    listed = catalog(tmp_path / "r")
    assert len(listed.rows().rows) == PARTS
    (tmp_path / "r" / "x" / "metadata.yaml").write_text(text)
    listed.walk()
    assert [row["file"] for row in listed.rows().rows] == ["x"]


def test_a_bag_of_one_file_stays_its_file(tmp_path: Path) -> None:
    """Ids and notes of what was listed before hold."""
    bag = write_ros2(tmp_path / "drive", Drive(messages=[(0.0, "/n", "std_msgs/msg/Int32", {"data": 1})]))
    assert list(files_below(tmp_path)) == [bag / "drive.mcap"]


def test_a_packed_file_is_listed_and_read(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "drive", Drive(messages=[(0.0, "/n", "std_msgs/msg/Int32", {"data": 1})]))
    content = (bag / "drive.mcap").read_bytes()
    shutil.rmtree(bag)
    packed = tmp_path / "drive.mcap.zstd"
    packed.write_bytes(zstandard.ZstdCompressor().compress(content))
    (row,) = catalog(tmp_path).rows().rows
    assert row["file"] == "drive.mcap.zstd"
    assert survey(packed)["messages"] == 1


def test_a_split_bag_and_a_database_with_its_log_go_into_the_trash_and_back(tmp_path: Path) -> None:
    bag = split(tmp_path / "r", "mcap")
    for made in (tmp_path / "r").glob("part_*"):
        shutil.rmtree(made)
    killed = left_open(tmp_path / "made")
    shutil.copytree(killed.parent, tmp_path / "r" / "killed")
    before = {file: file.read_bytes() for file in (tmp_path / "r").rglob("*") if file.is_file()}
    listed = catalog(tmp_path / "r")
    ids = [row["id"] for row in listed.rows().rows]
    assert len(ids) == 2
    for id in ids:
        listed.delete(id)
    assert list(bag.iterdir()) == []
    assert list((tmp_path / "r" / "killed").iterdir()) == []
    listed.walk()
    assert listed.rows().rows == []
    for id in ids:
        listed.restore(id)
    assert {file: file.read_bytes() for file in (tmp_path / "r").rglob("*") if file.is_file()} == before
    for id in ids:
        listed.delete(id)
    assert listed.destroy(None)["count"] == 2
    assert [file for file in (tmp_path / "r").rglob("*") if file.is_file()] == []


def bag_in(vehicle: Path) -> list[Path]:
    """The parts and the metadata of a split bag, right in a vehicle's folder."""
    made = split(vehicle.parent / "made", "mcap")
    vehicle.mkdir(parents=True, exist_ok=True)
    files = [Path(shutil.copy(file, vehicle)) for file in sorted(made.iterdir())]
    shutil.rmtree(made.parent)
    return files


@pytest.mark.parametrize("has_metadata", [True, False])
@pytest.mark.parametrize(
    "other",
    ["car_20260101T000000Z.mcap.writing", "car_20260101T000000Z.mcap.recovering", "car_20260101T000000Z.mcap", "a.bag",
     "other_0.db3", "inner/notes.txt"],
)  # fmt: skip
def test_a_folder_with_anything_else_in_it_is_no_recording(tmp_path: Path, other: str, has_metadata: bool) -> None:
    vehicle = tmp_path / "r" / "drive"
    files = bag_in(vehicle)
    if not has_metadata:
        files.pop().unlink()
    assert list(files_below(tmp_path / "r")) == [vehicle]
    (vehicle / other).parent.mkdir(exist_ok=True)
    (vehicle / other).write_bytes(files[0].read_bytes())
    listed = catalog(tmp_path / "r")
    assert {f"drive_{n}.mcap" for n in range(PARTS)} <= {row["file"] for row in listed.rows().rows}
    assert "folder" not in {row["format"] for row in listed.rows().rows}
    listed.delete(next(row["id"] for row in listed.rows().rows if row["file"] == "drive_1.mcap"))
    listed.destroy(None)
    assert sorted(file for file in vehicle.rglob("*") if file.is_file()) == sorted(
        {*files, vehicle / other} - {vehicle / "drive_1.mcap"}
    )


def test_what_came_into_the_folder_of_a_bag_since_it_was_listed_stays(tmp_path: Path) -> None:
    vehicle = tmp_path / "r" / "car"
    files = bag_in(vehicle)
    (vehicle / "read me.txt").write_text("not of the recording")
    listed = catalog(tmp_path / "r")
    (row,) = listed.rows().rows
    writing = vehicle / "car_20260101T000000Z.mcap.writing"
    writing.write_bytes(b"is being recorded")
    with pytest.raises(Refused, match="holds other recordings"):
        listed.delete(row["id"])
    assert all(file.exists() for file in (*files, writing))
    listed.walk()
    assert {row["file"] for row in listed.rows().rows} == {file.name for file in files if file.suffix == ".mcap"}
    writing.unlink()
    listed.walk()
    listed.delete(row["id"])
    assert list(vehicle.iterdir()) == [vehicle / "read me.txt"]
    writing.write_bytes(b"is being recorded")
    listed.restore(row["id"])
    assert sorted(vehicle.iterdir()) == sorted([*files, writing, vehicle / "read me.txt"])
    listed.walk()
    assert {row["file"] for row in listed.rows().rows} == {file.name for file in files if file.suffix == ".mcap"}


def test_what_is_put_into_a_bag_in_the_trash_is_not_destroyed_with_it(tmp_path: Path) -> None:
    bag_in(tmp_path / "r" / "drive")
    listed = catalog(tmp_path / "r")
    (row,) = listed.rows().rows
    listed.delete(row["id"])
    (there,) = (tmp_path / "r" / ".trash").glob("*/drive")
    (there / "notes.txt").write_text("kept")
    listed.destroy(None)
    assert list(there.iterdir()) == [there / "notes.txt"]


@pytest.mark.parametrize("links", [True, False])
@pytest.mark.parametrize("at", range(PARTS + 1))
def test_a_bag_of_which_one_file_cannot_be_moved_stays_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: int, links: bool
) -> None:
    files = bag_in(tmp_path / "r" / "drive")
    annotation_store.write(tmp_path / "r" / "drive", annotation_store.Annotations(title="kept"))
    listed = catalog(tmp_path / "r")
    (row,) = listed.rows().rows
    link, rename = os.link, os.rename

    def broken(how: Any) -> Any:
        def call(source: Any, target: Any) -> None:
            if Path(source) == files[at]:
                raise OSError(errno.EIO, "input/output error")
            how(source, target)

        return call

    def none(source: Any, target: Any) -> None:
        raise OSError(errno.EPERM, "no hard links")

    monkeypatch.setattr(os, "link", broken(link) if links else none)
    monkeypatch.setattr(os, "rename", broken(rename))
    with pytest.raises(Refused):
        listed.delete(row["id"])
    monkeypatch.undo()
    assert sorted((tmp_path / "r" / "drive").iterdir()) == files
    assert listed.rows().rows[0]["title"] == "kept"
    assert not [file for file in (tmp_path / "r" / ".trash").rglob("*") if file.is_file()]
    listed.delete(row["id"])
    assert list((tmp_path / "r" / "drive").iterdir()) == []


@pytest.mark.parametrize("failing", ["link", "rename"])
@pytest.mark.parametrize("why", [OSError(errno.EIO, "input/output error"), KeyboardInterrupt()])
def test_a_database_is_never_without_its_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str, why: BaseException
) -> None:
    """Whether a disk fails or the server is killed in the middle."""
    path = tmp_path / "r" / "killed" / "drive_0.db3"
    shutil.copytree(left_open(tmp_path / "made").parent, path.parent)
    before = {file: file.read_bytes() for file in path.parent.iterdir()}
    listed = catalog(tmp_path / "r")
    (row,) = listed.rows().rows

    def fail(*_: Any) -> None:
        raise why

    monkeypatch.setattr(os, failing, fail)
    if failing == "link":
        monkeypatch.setattr(shutil, "copy2", fail)
    with pytest.raises((Refused, KeyboardInterrupt)):
        listed.delete(row["id"])
    monkeypatch.undo()
    assert {file: file.read_bytes() for file in path.parent.iterdir()} == before
    listed.delete(row["id"])
    listed.restore(row["id"])
    assert {file: file.read_bytes() for file in path.parent.iterdir()} == before


def late_mark(text: str) -> DriveMark:
    row = row_of({"mark": "m1", "marked_ms": 5000, "category": None, "words": text})
    assert row is not None
    return row


@pytest.mark.parametrize("kind", ["texts", "media"])
def test_a_part_with_notes_of_its_own_keeps_them_and_its_row(tmp_path: Path, kind: str) -> None:
    files = bag_in(tmp_path / "r" / "drive")
    if kind == "texts":
        annotation_store.write(files[1], annotation_store.Annotations(title="the gate"))
        annotation_store.write_marks(files[1], [late_mark("late")], [])
    else:
        annotation_store.media_beside(files[1]).mkdir()
        (annotation_store.media_beside(files[1]) / "m1.photo.png").write_bytes(b"a photo")
    before = {file: file.read_bytes() for file in (tmp_path / "r").rglob("*") if file.is_file()}
    listed = catalog(tmp_path / "r")
    rows = {row["file"]: row for row in listed.rows().rows}
    assert set(rows) == {file.name for file in files if file.suffix == ".mcap"}
    found = rows[files[1].name]
    assert (found["title"], found["marks"]) == (("the gate", 1) if kind == "texts" else ("", 0))
    listed.delete(rows[files[0].name]["id"])
    listed.restore(rows[files[0].name]["id"])
    assert {file: file.read_bytes() for file in (tmp_path / "r").rglob("*") if file.is_file()} == before


def test_annotations_of_a_split_bag_are_in_its_report_and_among_its_marks(tmp_path: Path) -> None:
    bag_in(tmp_path / "r" / "drive")
    listed = catalog(tmp_path / "r")
    (row,) = listed.rows().rows
    listed.annotate(row["id"], title="the gate")
    path = listed.path(row["id"])
    assert path is not None
    annotation_store.write_marks(path, [late_mark("late")], [])
    with open_recording([path]) as recording:
        assert [mark["words"] for mark in marks_of(recording)] == ["late"]
        assert DriveReport.read(recording, name="drive").found["title"] == "the gate"


@pytest.mark.parametrize("how", ["little room", "full"])
def test_a_file_for_whose_copy_there_was_no_room_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    bag = write_ros2(tmp_path / "made", Drive(messages=[(0.0, "/n", "std_msgs/msg/Int32", {"data": 1})]))
    vehicle = tmp_path / "r" / "drive"
    vehicle.mkdir(parents=True)
    for part in range(2):  # the other one could be read
        content = (bag / "made.mcap").read_bytes()
        end, content = (".zstd", zstandard.ZstdCompressor().compress(content)) if part else ("", content)
        (vehicle / f"drive_{part}.mcap{end}").write_bytes(content)
    listed = catalog(tmp_path / "r")
    with monkeypatch.context() as now:
        if how == "full":
            now.setattr(temporary_copy.TemporaryCopy, "_write", full)
        else:
            now.setattr(space, "free_at", lambda path: 0)
        (entry,) = listed._entries.select("", [])
        listed._survey._keep(entry, survey(vehicle))
    (row,) = listed.rows().rows
    assert row["state"] == "unreadable"
    assert "does not fit on the disk" in (row["problem"] or "")
    listed.walk()
    (entry,) = listed._entries.select("", [])
    assert entry.found is None
    listed._survey._keep(entry, survey(vehicle))
    listed.walk()
    assert [row["state"] for row in listed.rows().rows] == ["read"]


def test_the_row_names_what_is_left_out_and_what_is_in_a_log(tmp_path: Path) -> None:
    path = tmp_path / "r" / "drive.db3"
    path.parent.mkdir()
    database(path, "INSERT INTO topics VALUES (2, '/x', 'a/msg/X', 'cdr_xml')",
             "INSERT INTO messages VALUES (3, 2, 3000000000, x'00')")  # fmt: skip
    shutil.copytree(left_open(tmp_path / "made").parent, tmp_path / "r" / "killed")
    listed = catalog(tmp_path / "r")
    for entry in listed._entries.select("", []):
        listed._survey._keep(entry, survey(tmp_path / "r" / entry.path))
    rows = {row["file"]: row for row in listed.rows().rows}
    found, killed = rows["drive.db3"], rows["drive_0.db3"]
    assert found["unread"] == ["/x (1 messages) is left out: messages encoded as 'cdr_xml' are not supported."]
    assert (found["damage"], found["several_files"]) == ([], None)
    assert (killed["unread"], killed["several_files"]) == ([], "a database with a log that holds a part of it")


def full(*_: Any) -> None:
    raise OSError(errno.ENOSPC, "no space left on device")

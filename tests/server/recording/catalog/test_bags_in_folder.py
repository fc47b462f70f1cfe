"""A ROS 2 bag in the folder of recordings is one recording, whatever files it is made of."""

from __future__ import annotations

import shutil
from pathlib import Path

import zstandard

from server.recording.catalog.catalog import Catalog
from server.recording.catalog.discovery import files_below
from server.recording.catalog.survey import survey
from tests.server.recording.bags import Drive, write_ros2
from tests.server.recording.read.test_bag2 import EACH, PARTS, left_open, split


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
    assert not bag.exists()
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

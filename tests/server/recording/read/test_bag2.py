"""ROS 2 bags as recorders, copies and power losses leave them: split, without metadata, not closed."""

from __future__ import annotations

import os
import random
import re
import shutil
import sqlite3
import tempfile
from pathlib import Path
from typing import Any, Literal

import pytest
from ruamel.yaml import YAML

from server.cli.main import main
from server.recording.read.bag2_metadata import is_latched
from server.recording.read.read import RecordingUnreadable, open_recording
from tests.server.recording.bags import Drive, write_ros2

Storage = Literal["mcap", "sqlite3"]
STORAGES = pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
PARTS, EACH = 4, 25


def split(to: Path, storage: Storage, *, seed: int = 3) -> Path:
    """One drive in parts, which its metadata name in any order."""
    folder = to / "drive"
    folder.mkdir(parents=True)
    names: list[str] = []
    metadata: dict[str, Any] = {}
    for part in range(PARTS):
        first = part * EACH
        rows = [(n / 10, "/n", "std_msgs/msg/Int32", {"data": n}) for n in range(first, first + EACH)]
        made = write_ros2(to / f"part_{part}", Drive(messages=rows), storage=storage)
        (file,) = (one for one in made.iterdir() if one.name != "metadata.yaml")
        names.append(f"drive_{part}{file.suffix}")
        shutil.move(file, folder / names[-1])
        metadata = YAML(typ="safe").load((made / "metadata.yaml").read_text())
    about = metadata["rosbag2_bagfile_information"]
    random.Random(seed).shuffle(names)
    about["relative_file_paths"] = names
    with (folder / "metadata.yaml").open("w") as text:
        YAML(typ="safe").dump(metadata, text)
    return folder


def numbers(*paths: Path) -> tuple[list[int], list[str]]:
    with open_recording(list(paths)) as recording:
        assert recording.topics["/n"].count == recording.count
        return [content["data"] for *_, content in recording.rows()], [*recording.notes, *recording.damage]


@STORAGES
@pytest.mark.parametrize("seed", range(4))
def test_parts_come_in_the_order_of_time_whatever_the_metadata_say(tmp_path: Path, storage: Storage, seed: int) -> None:
    assert numbers(split(tmp_path, storage, seed=seed)) == (list(range(PARTS * EACH)), [])


@STORAGES
def test_parts_without_metadata_and_as_a_list(tmp_path: Path, storage: Storage) -> None:
    folder = split(tmp_path, storage)
    (folder / "metadata.yaml").unlink()
    assert numbers(folder) == (list(range(PARTS * EACH)), [])
    assert numbers(*sorted(folder.iterdir(), reverse=True)) == (list(range(PARTS * EACH)), [])


@STORAGES
def test_a_part_that_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str], storage: Storage) -> None:
    folder = split(tmp_path, storage)
    gone = next(folder.glob("drive_2.*"))
    gone.unlink()
    read, (sentence,) = numbers(folder)
    assert read == [n for n in range(PARTS * EACH) if not 2 * EACH <= n < 3 * EACH]
    assert re.fullmatch(rf"{gone.name} is missing beside drive_\d\.\w+: metadata\.yaml names it", sentence)
    assert main(["check", str(folder)]) == 2
    assert main(["export", str(folder), "--format", "bag", "--out", str(tmp_path / "out.bag")]) == 1
    assert f"{gone.name} is missing" in capsys.readouterr().err


@STORAGES
def test_a_part_that_the_metadata_do_not_name_yet_is_read(tmp_path: Path, storage: Storage) -> None:
    folder = split(tmp_path, storage)
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(re.sub(r"drive_3\.\w+", "drive_0" + next(folder.glob("*_3.*")).suffix, text))
    assert numbers(folder)[0] == list(range(PARTS * EACH))


@STORAGES
@pytest.mark.parametrize("part", [0, 1, PARTS - 1])
@pytest.mark.parametrize(
    ("bytes_left", "filler", "reason"),
    [(0, b"", "is empty: it has 0 bytes"), (60, b"", ""), (0, b"a text", "is not a recording: it is a text file")],
)
def test_a_part_that_cannot_be_read_is_named_and_the_rest_read(
    tmp_path: Path, storage: Storage, part: int, bytes_left: int, filler: bytes, reason: str
) -> None:
    """As a recorder leaves its last part that is killed."""
    folder = split(tmp_path, storage)
    torn = next(folder.glob(f"drive_{part}.*"))
    next(folder.glob(f"drive_{(part + 2) % PARTS}.*")).unlink()
    torn.write_bytes(torn.read_bytes()[:bytes_left] + filler)
    for _ in range(2):
        read, damage = numbers(folder)
        assert read == sorted(read)
        assert len(read) == (PARTS - 2) * EACH
        assert len([one for one in damage if one.startswith(f"{torn.name} {reason}")]) == 1
        assert len(damage) == 1 + (folder / "metadata.yaml").exists()
        assert str(tmp_path) not in " ".join(damage)
        (folder / "metadata.yaml").unlink(missing_ok=True)


@STORAGES
def test_parts_none_of_which_can_be_read_are_no_recording(tmp_path: Path, storage: Storage) -> None:
    folder = split(tmp_path, storage)
    for content in (b"", b"\x89MCAP0\r\n" if storage == "mcap" else b"SQLite format 3\0"):
        for file in folder.glob("drive_*"):
            file.write_bytes(content)
        with pytest.raises(RecordingUnreadable, match=r"has no file that can be read: drive_0\."):
            numbers(folder)


def test_a_part_without_a_whole_chunk_is_named_and_the_rest_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = split(tmp_path, "mcap")
    files = sorted(folder.glob("drive_*"))
    last = files[-1].read_bytes()
    for number, file in enumerate((files[1], files[0], *files[2:])):
        content = bytearray(file.read_bytes())
        at = content.index(b"\x00\x01\x00\x00")  # the first message, in its chunk
        content[at] ^= 0xFF
        file.write_bytes(content)
        if number < PARTS - 1:
            read, damage = numbers(folder)
            assert len(read) == (PARTS - 1 - number) * EACH
            assert len([one for one in damage if one.startswith(f"{file.name} is damaged")]) == 1
    assert main(["export", str(folder), "--format", "bag", "--out", str(tmp_path / "no.bag")]) == 2
    with pytest.raises(RecordingUnreadable, match="none of its 1 parts is whole"):
        numbers(folder)
    files[-1].write_bytes(last)
    assert main(["export", str(folder), "--format", "bag", "--out", str(tmp_path / "out.bag")]) == 1
    clip = ["export", str(folder), "--format", "mcap", "--at", "8", "--out", str(tmp_path / "out.mcap")]
    assert main(clip) == 1
    assert "drive_1.mcap is damaged" in capsys.readouterr().err


def test_a_clip_names_a_part_that_cannot_be_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = split(tmp_path, "mcap")
    (folder / "drive_2.mcap").write_bytes(b"")
    clip = ["export", str(folder), "--format", "mcap", "--at", "8", "--out", str(tmp_path / "out.mcap")]
    assert main(clip) == 1
    assert "drive_2.mcap is empty" in capsys.readouterr().err


def test_another_recording_in_the_folder_is_none_of_its_parts(tmp_path: Path) -> None:
    folder = split(tmp_path, "mcap")
    shutil.copy(folder / "drive_0.mcap", folder / "clip.mcap")
    assert numbers(folder) == (list(range(PARTS * EACH)), [])


# -- a database that was not closed ------------------------------------------------------------------------------------


def left_open(to: Path) -> Path:
    """A database as a killed recorder leaves it: most of it is in the write-ahead log."""
    rows = [(n / 10, "/n", "std_msgs/msg/Int32", {"data": n}) for n in range(EACH)]
    closed = next(write_ros2(to / "closed", Drive(messages=rows), storage="sqlite3").glob("*.db3"))
    database = sqlite3.connect(closed, isolation_level=None)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("PRAGMA wal_autocheckpoint = 0")
    for n in range(EACH, 2 * EACH):
        row = database.execute("SELECT topic_id, timestamp, data FROM messages WHERE id = 1").fetchone()
        data = row[2][:4] + n.to_bytes(4, "little")
        insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)"
        database.execute(insert, (row[0], row[1] + n * 100_000_000, data))
    (to / "killed").mkdir()
    for end in ("", "-wal"):
        shutil.copy(f"{closed}{end}", to / "killed" / f"drive_0.db3{end}")
    database.close()
    return to / "killed" / "drive_0.db3"


def test_what_is_in_the_write_ahead_log_is_read_and_nothing_is_changed(tmp_path: Path) -> None:
    path = left_open(tmp_path)
    before = {file.name: file.read_bytes() for file in path.parent.iterdir()}
    assert numbers(path) == (list(range(2 * EACH)), [])
    assert numbers(path.parent) == (list(range(2 * EACH)), [])
    assert {file.name: file.read_bytes() for file in path.parent.iterdir()} == before


def test_a_torn_log_is_read_to_its_last_whole_transaction_and_reported(tmp_path: Path) -> None:
    path = left_open(tmp_path)
    log = path.with_name(path.name + "-wal")
    os.truncate(log, log.stat().st_size * 2 // 3)
    read, (sentence,) = numbers(path)
    assert read == list(range(len(read)))
    assert EACH < len(read) < 2 * EACH
    assert sentence.startswith("drive_0.db3 was never closed")


def test_temporary_copies_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    beside = tmp_path / "temporary"
    beside.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(beside))
    path = left_open(tmp_path)
    with open_recording([path]) as recording:
        assert len(list(recording.rows())) == len(list(recording.rows())) == 2 * EACH
        assert list(beside.iterdir()) == [] or os.name != "posix"  # a process that is killed leaves none
    assert list(beside.iterdir()) == []
    for file in path.parent.iterdir():
        file.write_bytes(file.read_bytes()[:32] + bytes(10_000))
    with pytest.raises(RecordingUnreadable):
        numbers(path)
    assert list(beside.iterdir()) == []


# -- databases of other makers -----------------------------------------------------------------------------------------


def database(path: Path, *statements: str) -> Path:
    made = sqlite3.connect(path)
    made.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
        "INSERT INTO topics VALUES (1, '/n', 'std_msgs/msg/Int32', 'cdr');"
        "INSERT INTO messages VALUES (1, 1, 1000000000, x'0001000007000000'), (2, 1, 2000000000, x'0001000008000000');"
    )
    made.executescript(";".join(statements))
    made.close()
    return path


def test_the_first_version_of_the_schema_is_read(tmp_path: Path) -> None:
    assert numbers(database(tmp_path / "a.db3")) == ([7, 8], [])


def test_what_is_no_message_is_left_out_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd = database(
        tmp_path / "a.db3",
        "INSERT INTO messages VALUES (3, 9, 3000000000, x'00'), (4, 1, 'noon', x'0001000009000000')",
        "INSERT INTO messages VALUES (5, 1, 5000000000, 'text'), (6, 1, 6000000000, NULL)",
    )
    with open_recording([odd]) as recording:
        assert [content["data"] for *_, content in recording.rows()] == [7, 8]
        assert recording.damage == ["a.db3 is damaged: 4 pieces of it are left out"]
    assert main(["check", str(odd)]) == 2
    assert "4 pieces of it are left out" in capsys.readouterr().err


def test_a_topic_of_another_encoding_is_named_and_the_rest_read(tmp_path: Path) -> None:
    path = database(tmp_path / "a.db3", "INSERT INTO topics VALUES (2, '/x', 'a/msg/X', 'cdr_xml')",
                    "INSERT INTO messages VALUES (3, 2, 3000000000, x'00')")  # fmt: skip
    assert numbers_of_topic(path) == ([7, 8], ["/x (1 messages) is left out: messages encoded as 'cdr_xml' are not "
                                              "supported"])  # fmt: skip


def numbers_of_topic(path: Path) -> tuple[list[int], list[str]]:
    with open_recording([path]) as recording:
        return [content["data"] for _, topic, _, content in recording.rows() if topic == "/n"], recording.notes


def test_a_view_in_place_of_a_table_is_no_recording(tmp_path: Path) -> None:
    path = database(tmp_path / "a.db3", "ALTER TABLE messages RENAME TO m",
                    "CREATE VIEW messages AS WITH RECURSIVE c(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM c) "
                    "SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM c")  # fmt: skip
    with pytest.raises(RecordingUnreadable, match="missing tables"):
        numbers(path)


# -- quality of service ------------------------------------------------------------------------------------------------

NUMBERS = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: {}\n  avoid_ros_namespace_conventions: false\n"


@pytest.mark.parametrize(
    ("offered", "expected"),
    [
        (NUMBERS.format(1), True),
        (NUMBERS.format(2), False),
        (NUMBERS.format("transient_local"), True),
        (NUMBERS.format("TRANSIENT_LOCAL"), True),
        (NUMBERS.format("volatile"), False),
        (NUMBERS.format(2) + NUMBERS.format(1), True),
        ("[{durability: 1}]", True),
        ("{durability: transient_local}", True),
        ([{"durability": 1, "depth": 1}], True),
        ([{"durability": "transient_local"}], True),
        ([{"durability": "system_default"}, {"durability": 0}], False),
        ([], False),
        ("", False),
        (None, False),
        (7, False),
        ([1, None, "x"], False),
        ("not: [yaml", False),
        ("- durability: [1]\n", False),
    ],
)
def test_quality_of_service_in_names_numbers_and_lists(offered: Any, expected: bool) -> None:
    assert is_latched(offered) is expected


@STORAGES
@pytest.mark.parametrize("form", ["names", "numbers", "text", "odd"])
def test_metadata_with_any_quality_of_service_are_read(tmp_path: Path, storage: Storage, form: str) -> None:
    folder = split(tmp_path, storage)
    metadata = YAML(typ="safe").load((folder / "metadata.yaml").read_text())
    profiles: dict[str, Any] = {
        "names": [{"durability": "transient_local"}],
        "numbers": [{"history": 1, "durability": 1}],
        "text": NUMBERS.format(1),
        "odd": [{"durability": None, "deadline": 7}],
    }
    topic = metadata["rosbag2_bagfile_information"]["topics_with_message_count"][0]["topic_metadata"]
    topic["offered_qos_profiles"] = profiles[form]
    with (folder / "metadata.yaml").open("w") as file:
        YAML(typ="safe").dump(metadata, file)
    with open_recording([folder]) as recording:
        assert recording.topics["/n"].is_latched is (form != "odd")
        assert recording.count == PARTS * EACH

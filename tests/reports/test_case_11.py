"""A compressed ROS 2 bag is read the same as a folder, as a bare file, packed or not, split or not (rosbag2#1533)."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

import pytest
import zstandard

from server.cli.main import main
from tests.reports.cases import counted, made

GENERATOR = "case_11_message_compression.py"
MESSAGES = 780
BAGS = [f"{storage}-{mode}" for storage in ("mcap", "sqlite3") for mode in ("message", "file")]


def bag(name: str) -> Path:
    return made(GENERATOR) / "11-message-compression" / name


def copied(name: str, to: Path) -> Path:
    return Path(shutil.copytree(bag(name), to / name))


def file_of(folder: Path) -> Path:
    (file,) = (one for one in folder.iterdir() if one.name != "metadata.yaml")
    return file


@pytest.mark.parametrize("name", BAGS)
def test_case_11_as_a_folder_and_as_a_bare_file(tmp_path: Path, name: str) -> None:
    assert counted(bag(name)) == (MESSAGES, [])
    assert counted(file_of(bag(name))) == (MESSAGES, [])
    alone = shutil.copy(file_of(bag(name)), tmp_path)
    assert counted(Path(alone)) == (MESSAGES, [])


@pytest.mark.parametrize("name", BAGS)
def test_case_11_without_its_metadata(tmp_path: Path, name: str) -> None:
    folder = copied(name, tmp_path)
    (folder / "metadata.yaml").unlink()
    assert counted(folder) == (MESSAGES, [])


@pytest.mark.parametrize("name", BAGS)
def test_case_11_check_and_export(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    file = file_of(bag(name))
    assert main(["check", str(file)]) == 1  # a speeding alarm
    assert f"{MESSAGES} messages on 3 topics" in capsys.readouterr().out
    assert main(["export", str(file), "--format", "bag", "--out", str(tmp_path / "out.bag")]) == 0
    assert counted(tmp_path / "out.bag") == (MESSAGES, [])


def test_case_11_another_way_of_compressing_is_refused_by_name(tmp_path: Path) -> None:
    from server.recording.read.errors import RecordingUnreadable

    folder = copied("mcap-message", tmp_path)
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("zstd", "lz4"))
    with pytest.raises(RecordingUnreadable, match="it is compressed as 'lz4'"):
        counted(folder)


def test_case_11_a_damaged_message_is_left_out_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = copied("sqlite3-message", tmp_path)
    database = sqlite3.connect(file_of(folder))
    database.execute("UPDATE messages SET data = substr(data, 1, length(data) / 2) WHERE id IN (7, 300)")
    database.commit()
    database.close()
    assert main(["check", str(folder)]) == 2
    assert "sqlite3-message.db3 is damaged: 2 pieces of it are left out" in capsys.readouterr().err


def test_case_11_a_packed_file_that_is_cut_is_read_as_far_as_it_is_whole(tmp_path: Path) -> None:
    content = (made("case_10_fastwrite.py") / "10-fastwrite" / "fastwrite.mcap").read_bytes()
    packed = zstandard.ZstdCompressor().compress(content)
    (tmp_path / "whole.mcap.zstd").write_bytes(packed)
    assert counted(tmp_path / "whole.mcap.zstd") == (MESSAGES, [])
    (tmp_path / "cut.mcap.zstd").write_bytes(packed[: len(packed) * 4 // 5])
    read, (note,) = counted(tmp_path / "cut.mcap.zstd")
    assert MESSAGES // 2 < read < MESSAGES
    assert "was never closed" in note

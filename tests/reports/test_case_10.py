"""An MCAP file without chunks that a power loss cut is read to its last whole message (rosbag2#2389, #2133)."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Message
from mcap.stream_reader import StreamReader

from server.cli.main import main
from tests.reports.cases import counted, made

WHOLE = 780


def by_library(path: Path) -> int:
    """How many messages the library's own reader finds before the file ends."""
    found = 0
    with path.open("rb") as file:
        try:
            for record in StreamReader(file).records:
                found += isinstance(record, Message)
        except (EndOfFile, struct.error):
            pass
    return found


def test_case_10_the_whole_messages_of_a_cut_file_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = made("case_10_fastwrite.py") / "10-fastwrite" / "fastwrite-power-lost.mcap"
    read, (note,) = counted(path)
    assert read == by_library(path) == 627
    assert note.startswith("fastwrite-power-lost.mcap was never closed: it is read to its last whole part, ")
    assert main(["check", str(path)]) == 2
    assert "was never closed" in capsys.readouterr().err
    assert main(["export", str(path), "--format", "bag", "--out", str(tmp_path / "out.bag")]) == 1
    assert counted(tmp_path / "out.bag") == (627, [])


def test_case_10_the_same_with_chunks() -> None:
    path = made("case_10_fastwrite.py") / "10-fastwrite" / "chunked-power-lost.mcap"
    read, notes = counted(path)
    assert read == by_library(path)
    assert len(notes) == 1


@pytest.mark.parametrize("name", ["fastwrite", "chunked"])
def test_case_10_a_closed_file_is_whole(name: str) -> None:
    assert counted(made("case_10_fastwrite.py") / "10-fastwrite" / f"{name}.mcap") == (WHOLE, [])


@pytest.mark.parametrize("part", [0.03, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.999])
def test_case_10_wherever_it_is_cut(tmp_path: Path, part: float) -> None:
    content = (made("case_10_fastwrite.py") / "10-fastwrite" / "fastwrite.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    for end in range(int(len(content) * part), int(len(content) * part) + 40, 7):
        cut.write_bytes(content[:end])
        assert counted(cut)[0] == by_library(cut) > 0


def test_case_10_zeros_behind_the_end_are_no_messages(tmp_path: Path) -> None:
    """What a file system leaves of blocks that were not written when the power went."""
    content = (made("case_10_fastwrite.py") / "10-fastwrite" / "fastwrite-power-lost.mcap").read_bytes()
    (tmp_path / "zeros.mcap").write_bytes(content + bytes(100_000))
    assert counted(tmp_path / "zeros.mcap")[0] == 627

"""A recording's index does not stay in memory, and is the library's own in the finished file."""

from __future__ import annotations

import gc
import tracemalloc
from pathlib import Path

import pytest
from mcap.reader import make_reader

from server.recording.folder import writing_path
from server.recording.mcap import write
from server.recording.mcap.write import PartFile
from server.recording.read.schemas import Schema

CHANNELS = 12
FLUSHES_A_MINUTE = 300  # the recorder's: every 0.2 s
MOST_MB_AN_HOUR = 1.0
SCHEMA = Schema(
    name="std_msgs/Float32", encoding="ros1msg", message_encoding="ros1", data=b"float32 data\n", encode=None
)


def record(file: PartFile, first: int, flushes: int) -> None:
    """So many flushes' worth of a car's messages, from a moment that is a number of flushes."""
    for n in range(first, first + flushes):
        for channel in range(CHANNELS):
            file.add(file.channel(f"/topic{channel}", SCHEMA), 1_700_000_000_000_000_000 + n * 200_000_000, b"\0\0\0\0")
        file.flush()


def part(folder: Path) -> PartFile:
    return PartFile(folder / "car_20231114T221320Z.mcap", profile="ros1", metadata={"vehicle": "car"})


@pytest.mark.world(n=25)
def test_an_hour_of_recording_keeps_less_than_a_megabyte(tmp_path: Path) -> None:
    file = part(tmp_path)
    tracemalloc.start()
    try:
        record(file, 0, FLUSHES_A_MINUTE)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        record(file, FLUSHES_A_MINUTE, 3 * FLUSHES_A_MINUTE)
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        file.abandon()
    assert (after - before) * 20 / 1e6 < MOST_MB_AN_HOUR


@pytest.mark.world(n=25)
def test_the_finished_file_is_byte_for_byte_what_the_library_writes_from_its_own_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = part(tmp_path)
    record(ours, 0, 130)
    written = ours.close(ended="by hand").read_bytes()
    monkeypatch.setattr(write, "ChunkIndexes", lambda _: [])
    theirs = part(tmp_path / "list")
    record(theirs, 0, 130)
    assert written == theirs.close(ended="by hand").read_bytes()
    with (tmp_path / "car_20231114T221320Z.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 130
    assert all(len(index.message_index_offsets) == CHANNELS for index in summary.chunk_indexes)


def test_a_file_with_fewer_chunks_than_were_written_is_not_completed(tmp_path: Path) -> None:
    file = part(tmp_path)
    record(file, 0, 3)
    with writing_path(file.path).open("r+b") as damaged:
        damaged.truncate(200)
        damaged.truncate(file.size)
    with pytest.raises(OSError, match="chunks instead of 3"):
        file.close()
    assert not file.path.exists()
    assert writing_path(file.path).exists()

"""What a killed server leaves: cut at every byte, damaged, half-recovered. What was whole is readable afterwards."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader

from server.judge.message import RosVersion
from server.recording.folder import RecordingsFolder
from server.recording.mcap.chunks import HEAD_BYTES, Walk, WholeChunk
from server.recording.read.read import open_recording
from server.recording.recover import recover
from tests.server.recording.made import recover_all
from tests.server.recording.mcap.test_write import written


def left_by(tmp_path: Path, *, version: RosVersion = 1, n: int = 6) -> Path:
    """A file that was being written when its writer was killed; its last row was never flushed."""
    path = tmp_path / "recordings" / "car" / "car_1.mcap"
    written(path, version, n=n + 1).abandon()
    return path.with_name("car_1.mcap.writing")


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def alarms(path: Path) -> list[int]:
    with open_recording([path]) as recording:
        return [entry["n"] for _, entry in recording.own("/catgraph/alarms")]


@pytest.mark.parametrize("version", [1, 2])
def test_what_was_flushed_is_all_there_and_the_file_is_as_good_as_any(tmp_path: Path, version: RosVersion) -> None:
    left = left_by(tmp_path, version=version)
    done = recover(left)
    assert done.is_settled
    assert done.path == left.with_name("car_1.mcap")
    assert names(left.parent) == ["car_1.mcap"]
    assert done.messages == 24
    assert done.sentence == ("car_1 is truncated: 0.1 s with 24 messages are whole. Nothing was partly written.")
    with open_recording([done.path]) as recording:
        assert recording.ros_version == version
        assert recording.metadata == {"vehicle": "car", "part": "1", "ended": "recovered", "why": done.sentence}
        assert [m.topic for m in recording.messages()] == ["/vel", "/odd", "/secret"] * 6
        assert recording.damage == []
    assert alarms(done.path) == list(range(6))
    with done.path.open("rb") as raw:  # the library's own reader, checksums and all
        reader = make_reader(raw, validate_crcs=True)
        assert len(list(reader.iter_messages())) == 24
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 24
        assert [record.name for record in reader.iter_metadata()] == ["catgraph", "catgraph"]
        assert all(index.message_index_offsets for index in summary.chunk_indexes)


def test_the_copy_is_byte_for_byte_what_the_writer_would_have_closed(tmp_path: Path) -> None:
    whole = written(tmp_path / "a.mcap", 1, n=6).close(ended="closed")
    left = tmp_path / "b.mcap.writing"
    with whole.open("rb") as file:
        walk = Walk(file, whole.stat().st_size)
        end = max(chunk.at + len(chunk.raw) for chunk in walk.chunks() if isinstance(chunk, WholeChunk))
    shutil.copy(whole, left)
    os.truncate(left, end)
    done = recover(left)
    assert done.path is not None
    with whole.open("rb") as one, done.path.open("rb") as other:
        ours, theirs = make_reader(other), make_reader(one)
        assert list(ours.iter_messages()) == list(theirs.iter_messages())
        mine, its = ours.get_summary(), theirs.get_summary()
        assert mine is not None
        assert its is not None
        assert (mine.schemas, mine.channels, mine.chunk_indexes) == (its.schemas, its.channels, its.chunk_indexes)
        assert mine.statistics == its.statistics


@pytest.mark.slow
def test_cut_at_every_byte_everything_before_the_cut_is_kept(tmp_path: Path) -> None:
    left = left_by(tmp_path, n=4)
    original = left.read_bytes()
    with left.open("rb") as file:
        chunks = [chunk for chunk in Walk(file, len(original)).chunks() if isinstance(chunk, WholeChunk)]
    ends = [(chunk.at + len(chunk.raw), chunk.messages) for chunk in chunks]
    folder = RecordingsFolder(tmp_path / "recordings")
    for size in range(len(original) + 1):
        left.write_bytes(original[:size])
        done = recover_all(folder)
        expected = sum(messages for end, messages in ends if end <= size)
        (settled,) = done
        assert settled.is_settled, size
        assert settled.messages == expected, size
        if expected:
            assert names(left.parent) == ["car_1.mcap"], size
            assert settled.path is not None
            with settled.path.open("rb") as raw:
                assert len(list(make_reader(raw, validate_crcs=True).iter_messages())) == expected, size
            assert f"{expected} messages are whole" in settled.sentence
            settled.path.unlink()
        elif settled.aside is not None:
            assert names(left.parent) == ["car_1.mcap.damaged"], size
            assert settled.aside.read_bytes() == original[:size], "not a byte of it is gone"
            settled.aside.unlink()
        else:
            assert names(left.parent) == [], size
            assert settled.sentence == "car_1 had only started and is empty."
    assert folder.unfinished() == []


def test_one_that_had_only_begun_is_no_loss(tmp_path: Path) -> None:
    left = left_by(tmp_path)
    with left.open("rb") as file:
        first = next(iter(Walk(file, left.stat().st_size).chunks()))
    head = left.read_bytes()[: first.at]
    for begun in (b"", head):  # killed before its head was written, and after
        left.write_bytes(begun)
        done = recover(left)
        assert (done.path, done.aside) == (None, None)
        assert done.sentence == "car_1 had only started and is empty."
        assert names(left.parent) == []


def test_a_closed_file_that_only_missed_its_name_gets_it(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", 1).close(ended="closed")
    left = path.rename(tmp_path / "a.mcap.writing")
    before = left.read_bytes()
    done = recover(left)
    assert done.path == path
    assert done.sentence == "a was whole."
    assert path.read_bytes() == before


def test_a_recovery_that_was_killed_is_done_again_or_ended(tmp_path: Path) -> None:
    left = left_by(tmp_path)
    original = left.read_bytes()
    left.with_name("car_1.mcap.recovering").write_bytes(b"half of it")
    (done,) = recover_all(RecordingsFolder(tmp_path / "recordings"))
    assert done.messages == 24
    assert names(left.parent) == ["car_1.mcap"]
    left.write_bytes(original)  # the new one had its name, and the original was still there
    (again,) = recover_all(RecordingsFolder(tmp_path / "recordings"))
    assert again.path == done.path
    assert again.sentence == "car_1 had already been recovered."
    assert names(left.parent) == ["car_1.mcap"]
    assert alarms(left.parent / "car_1.mcap") == list(range(6))


def test_a_finished_one_that_is_no_recovery_is_never_overwritten(tmp_path: Path) -> None:
    left = left_by(tmp_path)
    other = left.with_name("car_1.mcap")
    other.write_bytes(b"cut")
    (done,) = recover_all(RecordingsFolder(tmp_path / "recordings"))
    assert done.path is None
    assert names(left.parent) == ["car_1.mcap", "car_1.mcap.damaged"]
    assert other.read_bytes() == b"cut"


@pytest.mark.parametrize("which", [1, 2])
def test_a_damaged_part_costs_itself_alone_and_is_kept_aside(tmp_path: Path, which: int) -> None:
    left = left_by(tmp_path)
    original = bytearray(left.read_bytes())
    with left.open("rb") as file:
        chunk = list(Walk(file, len(original)).chunks())[which]
    original[chunk.at + HEAD_BYTES + 60] ^= 1
    left.write_bytes(original)
    done = recover(left)
    assert done.path is not None
    assert done.aside is not None
    assert names(left.parent) == ["car_1.mcap", "car_1.mcap.damaged"]
    assert done.aside.read_bytes() == original
    assert "1 part is damaged and left out" in done.sentence
    assert done.sentence.endswith("The damaged file is kept as car_1.mcap.damaged.")
    kept = {0, 1, 2, 3, 4, 5} - {2 * which, 2 * which + 1}
    assert alarms(done.path) == sorted(kept)


def test_without_the_part_that_declares_them_messages_mean_nothing(tmp_path: Path) -> None:
    left = left_by(tmp_path)
    original = bytearray(left.read_bytes())
    with left.open("rb") as file:
        chunk = next(iter(Walk(file, len(original)).chunks()))
    original[chunk.at + HEAD_BYTES + 60] ^= 1
    left.write_bytes(original)
    done = recover(left)
    assert done.path is None
    assert done.sentence == "Nothing of car_1 can be read; it is kept as car_1.mcap.damaged."
    assert names(left.parent) == ["car_1.mcap.damaged"]


@pytest.mark.parametrize("tail", [b"\0" * 500, b"\xff" * 500, b"\x06" + b"\xff" * 8, os.urandom(5000)])
def test_what_a_loss_of_power_leaves_behind_the_last_part_is_no_part(tmp_path: Path, tail: bytes) -> None:
    left = left_by(tmp_path)
    with left.open("ab") as file:
        file.write(tail)
    done = recover(left)
    assert done.path is not None
    assert done.messages == 24
    assert "were only partly written" in done.sentence


def test_much_that_cannot_be_read_is_kept_aside(tmp_path: Path) -> None:
    left = left_by(tmp_path)
    with left.open("ab") as file:
        file.write(bytes(2_000_000))
    done = recover(left)
    assert done.messages == 24
    assert names(left.parent) == ["car_1.mcap", "car_1.mcap.damaged"]


def test_what_is_no_recording_at_all_is_kept_and_reported(tmp_path: Path) -> None:
    left = tmp_path / "a.mcap.writing"
    left.write_bytes(b"something else")
    (tmp_path / "a.mcap.damaged").write_bytes(b"of another time")
    done = recover(left)
    assert done.sentence == "Nothing of a can be read; it is kept as a-2.mcap.damaged."
    assert names(tmp_path) == ["a-2.mcap.damaged", "a.mcap.damaged"]

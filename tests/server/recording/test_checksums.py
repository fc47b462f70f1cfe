"""MCAP files carry a checksum for each part: a damaged part is left out and named, the whole ones are kept."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from server.cli.main import main
from server.recording.catalog.survey import survey
from server.recording.read.read import RecordingUnreadable, open_recording
from tests.server.recording.made import BEGAN_MS, record

MESSAGES = 400
EVERY_NS = 10_000_000
FILLER = "text " * 30


def written(
    path: Path,
    *,
    profile: str = "",
    compression: CompressionType = CompressionType.NONE,
    use_chunking: bool = True,
    enable_crcs: bool = True,
    times: Callable[[int], int] = lambda n: n * EVERY_NS,
) -> Path:
    """400 messages in some 15 parts; `profile` "ros2": a bag of std_msgs/String, else JSON."""
    with path.open("wb") as file:
        writer = Writer(
            file, chunk_size=5_000, compression=compression, use_chunking=use_chunking, enable_crcs=enable_crcs
        )
        writer.start(profile=profile)
        if profile == "ros2":
            schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
            channel = writer.register_channel("/text", "cdr", schema)
        else:
            schema = writer.register_schema("std_msgs/String", "jsonschema", b"{}")
            channel = writer.register_channel("/text", "json", schema)
        for n in range(MESSAGES):
            text = f"{n:04d} {FILLER}".encode()
            data = (
                b"\0\1\0\0" + (len(text) + 1).to_bytes(4, "little") + text + b"\0"
                if profile == "ros2"
                else b'{"data": "' + text + b'"}'
            )
            writer.add_message(channel, times(n), data, times(n), n)
        writer.finish()
    return path


def numbers(path: Path) -> tuple[list[int], list[str]]:
    """Which messages come, and what is reported as damaged."""
    with open_recording([path]) as recording:
        came = [int(cast("Any", one.message)["data"][:4]) for one in recording.messages()]
        return came, recording.damage


def hurt(path: Path, number: int) -> None:
    """One letter of one message becomes another: nothing about its shape is wrong."""
    content = path.read_bytes()
    mark = f"{number:04d} text".encode()
    assert content.count(mark) == 1
    path.write_bytes(content.replace(mark, f"{number:04d} test".encode()))


PROFILES = pytest.mark.parametrize("profile", ["", "ros2"], ids=["JSON", "ROS 2"])


@PROFILES
def test_a_whole_file_is_read_to_its_end(tmp_path: Path, profile: str) -> None:
    assert numbers(written(tmp_path / "a.mcap", profile=profile)) == (list(range(MESSAGES)), [])


@PROFILES
def test_one_wrong_letter_costs_its_part_and_no_more(tmp_path: Path, profile: str) -> None:
    path = written(tmp_path / "a.mcap", profile=profile)
    hurt(path, 200)
    came, damage = numbers(path)
    lost = sorted(set(range(MESSAGES)) - set(came))
    assert came == sorted(came)
    assert 200 in lost
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert len(lost) < 40
    (sentence,) = damage
    from_s, to_s = lost[0] / 100, lost[-1] / 100
    assert sentence.startswith("a.mcap is damaged: 1 part of ")
    assert sentence.endswith(f"between {from_s:.1f} s and {to_s:.1f} s, is left out")


@PROFILES
def test_several_damaged_parts_are_one_sentence(tmp_path: Path, profile: str) -> None:
    path = written(tmp_path / "a.mcap", profile=profile)
    for number in (50, 350):
        hurt(path, number)
    came, (sentence,) = numbers(path)
    assert {50, 350}.isdisjoint(came)
    assert 200 in came
    assert "is damaged: 2 parts of " in sentence
    assert sentence.endswith("are left out")


@PROFILES
@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_a_part_that_cannot_be_unpacked(tmp_path: Path, profile: str, compression: CompressionType) -> None:
    path = written(tmp_path / "a.mcap", profile=profile, compression=compression)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    part = summary.chunk_indexes[3]
    content = bytearray(path.read_bytes())
    middle = part.chunk_start_offset + part.chunk_length // 2
    content[middle : middle + 8] = bytes(8)
    path.write_bytes(content)
    came, damage = numbers(path)
    assert 0 < MESSAGES - len(came) < 200
    assert came == sorted(came)
    assert len(damage) == 1


@PROFILES
def test_without_checksums_nothing_can_be_detected(tmp_path: Path, profile: str) -> None:
    """The format allows it: zero means that there is none."""
    path = written(tmp_path / "a.mcap", profile=profile, enable_crcs=False)
    hurt(path, 200)
    assert numbers(path) == (list(range(MESSAGES)), [])


def test_a_file_without_parts_is_read(tmp_path: Path) -> None:
    assert numbers(written(tmp_path / "a.mcap", use_chunking=False))[0] == list(range(MESSAGES))


@PROFILES
def test_parts_that_overlap_in_time_come_in_order(tmp_path: Path, profile: str) -> None:
    path = written(tmp_path / "a.mcap", profile=profile, times=lambda n: (n * 7 % MESSAGES) * EVERY_NS)
    hurt(path, 200)
    with open_recording([path]) as recording:
        times = [one.at_s for one in recording.messages()]
        assert recording.damage
    assert times == sorted(times)
    assert len(times) > 350


@PROFILES
def test_a_file_of_which_nothing_is_whole(tmp_path: Path, profile: str) -> None:
    path = written(tmp_path / "a.mcap", profile=profile)
    path.write_bytes(path.read_bytes().replace(b" text text", b" test text"))
    with pytest.raises(RecordingUnreadable, match=r"a\.mcap is damaged: none of its \d+ parts is whole$"):
        numbers(path)


@PROFILES
def test_each_reading_tells_of_itself(tmp_path: Path, profile: str) -> None:
    path = written(tmp_path / "a.mcap", profile=profile)
    hurt(path, 50)
    with open_recording([path]) as recording:
        first = len(list(recording.messages())), recording.damage
        assert (len(list(recording.messages())), recording.damage) == first
        list(recording.messages(start_s=2.0))
        assert recording.damage == []  # what is damaged lies before it


def hurt_last_part(path: Path) -> None:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    part = summary.chunk_indexes[-1]
    content = bytearray(path.read_bytes())
    content[part.chunk_start_offset + part.chunk_length - 20] ^= 1
    path.write_bytes(content)


def test_reading_the_alarms_leaves_what_else_is_damaged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = record(tmp_path / "car" / "a.mcap", seconds=60.0, alarms=[(2.0, "critical")])
    hurt_last_part(path)
    with open_recording([path]) as recording:
        list(recording.messages())
        (sentence,) = recording.damage
        assert len(list(recording.own("/catgraph/alarms"))) == 2
        assert recording.damage == [sentence]
    found = survey(path)
    assert found["damage"] == [f"{sentence}."]
    assert found["alarms"]["critical"] == 1
    assert main(["export", str(path), "--format", "bag", "--out", str(tmp_path / "a.bag")]) == 1
    assert sentence in capsys.readouterr().err


def test_what_catgraph_wrote_into_several_files_comes_in_the_order_of_time(tmp_path: Path) -> None:
    for part in (2, 10):
        record(tmp_path / f"a_{part}.mcap", alarms=[(1.0, "critical")], began_ms=BEGAN_MS + part * 60_000)
    with open_recording([tmp_path]) as recording:
        times = [at_s for at_s, _ in recording.own("/catgraph/alarms")]
    assert len(times) == 4
    assert times == sorted(times)


# -- files that were never closed --------------------------------------------------------------------------------------


@PROFILES
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_a_file_that_was_never_closed_is_read_to_its_last_whole_part(
    tmp_path: Path, profile: str, share: float, compression: CompressionType
) -> None:
    path = written(tmp_path / "a.mcap", profile=profile, compression=compression)
    content = path.read_bytes()
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    cut_at = int(len(content) * share)
    path.write_bytes(content[:cut_at])
    whole = [part for part in summary.chunk_indexes if part.chunk_start_offset + part.chunk_length <= cut_at]
    came, damage = numbers(path)
    last_ns = max(part.message_end_time for part in whole)
    assert came == list(range(last_ns // EVERY_NS + 1))
    assert damage == [f"a.mcap was never closed: it is read to its last whole part, {last_ns / 1e9:.1f} s"]
    with open_recording([path]) as recording:
        assert recording.topics["/text"].count == len(came)
        assert recording.duration_s == pytest.approx(last_ns / 1e9)


@PROFILES
@pytest.mark.parametrize("number", [0, 2, -1])
def test_the_times_of_a_damaged_part_are_not_those_of_the_drive(tmp_path: Path, profile: str, number: int) -> None:
    path = written(tmp_path / "a.mcap", profile=profile, times=lambda n: 10**18 + n * EVERY_NS)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    content, at = bytearray(path.read_bytes()), summary.chunk_indexes[number].chunk_start_offset
    content[at + 9 : at + 25] = struct.pack("<QQ", 5, 2**63)  # behind opcode and length
    content[at + summary.chunk_indexes[number].chunk_length - 20] ^= 1
    path.write_bytes(content[:-8])
    with open_recording([path]) as recording:
        times = [message.at_s for message in recording.messages()]
        assert recording.start_s == times[0]
        assert recording.duration_s == pytest.approx(times[-1] - times[0])
        assert times[0] >= 1e9
        assert len(times) > 300
        assert "is damaged: 1 part of" in recording.damage[0]


@PROFILES
def test_a_file_that_was_never_closed_and_is_damaged(tmp_path: Path, profile: str) -> None:
    path = written(tmp_path / "a.mcap", profile=profile)
    hurt(path, 50)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    came, damage = numbers(path)
    assert 50 not in came
    assert 0 in came
    assert 100 in came
    assert len(damage) == 2


def test_a_file_cut_within_its_first_part(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap")
    path.write_bytes(path.read_bytes()[:2_000])
    with pytest.raises(RecordingUnreadable, match=r"a\.mcap is not complete: it ends too early$"):
        numbers(path)

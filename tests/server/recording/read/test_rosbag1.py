"""Bags of ROS 1 of many chunks: the messages that the library's own reader gives, from any moment on."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import pytest
from rosbags.rosbag1 import Reader

from server.recording.read.errors import RecordingUnreadable
from server.recording.read.read import open_recording
from server.recording.read.rosbag1 import Bag1
from tests.server.recording.bags import BEGIN_S, Drive, write_ros1

MESSAGES = 400
TOPICS = ("/speed", "/distance", "/never")


def written(path: Path, *, compression: str = "bz2", step: int = 1) -> Path:
    """Messages every 10 ms on two topics, in some fifty chunks. With another `step` the chunks overlap in time."""
    rows = [
        ((number * step % MESSAGES) / 100, TOPICS[number % 2], "std_msgs/msg/Float64", {"data": float(number)})
        for number in range(MESSAGES)
    ]
    return write_ros1(path, Drive(messages=rows, compression=compression, chunk_bytes=300))  # type: ignore[arg-type]


def read(bag: Bag1, start_ns: int = 0) -> list[tuple[int, str, bytes]]:
    topics = {channel.number: channel.topic for channel in bag.channels}
    return [(time_ns, topics[number], bytes(raw)) for time_ns, number, raw in bag.messages(set(topics), start_ns)]


@pytest.mark.parametrize("step", [1, 7, 399])
@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_it_reads_what_the_library_reads(tmp_path: Path, compression: str, step: int) -> None:
    path = written(tmp_path / "a.bag", compression=compression, step=step)
    with Reader(path) as reader:
        theirs = [(time_ns, connection.topic, bytes(raw)) for connection, time_ns, raw in reader.messages()]
        assert len(reader.chunks) > 20
    bag = Bag1(path)
    ours = read(bag)
    assert ours == sorted(theirs, key=lambda row: row[0])
    for start_s in (0.0, 1.234, 3.99, 9.0):  # again, and from elsewhere: what was unpacked ahead is of no use then
        start_ns = round((BEGIN_S + start_s) * 1e9)
        assert read(bag, start_ns) == [row for row in ours if row[0] >= start_ns]
    bag.close()


def test_two_readings_of_one_bag_at_once(tmp_path: Path) -> None:
    bag = Bag1(written(tmp_path / "a.bag"))
    numbers = {channel.number for channel in bag.channels}
    late_ns = round((BEGIN_S + 2) * 1e9)
    whole, half = bag.messages(numbers, 0), bag.messages(numbers, late_ns)
    seen = [(next(whole)[0], next(half)[0]) for _ in range(MESSAGES // 2)]
    assert [second - first for first, second in seen] == [2 * 10**9] * (MESSAGES // 2)
    bag.close()


def test_one_that_is_closed_while_it_is_read(tmp_path: Path) -> None:
    bag = Bag1(written(tmp_path / "a.bag"))
    rows = bag.messages({channel.number for channel in bag.channels}, 0)
    next(rows)
    bag.close()
    rows.close()  # type: ignore[attr-defined]


def test_a_chunk_that_cannot_be_unpacked_is_one_sentence(tmp_path: Path) -> None:
    path = written(tmp_path / "a.bag")
    raw = bytearray(path.read_bytes())
    at = raw.find(b"BZh9", len(raw) // 2)
    raw[at + 12 : at + 20] = bytes(8)
    path.write_bytes(raw)
    with open_recording([path]) as recording, pytest.raises(RecordingUnreadable, match=r"a\.bag is damaged"):
        list(recording.messages())


@pytest.mark.parametrize("damage", ["op", "version", "count", "length"])
def test_an_index_that_is_none_is_one_sentence(tmp_path: Path, damage: str) -> None:
    path = written(tmp_path / "a.bag")
    raw = bytearray(path.read_bytes())
    at = raw.find(b"\x0a\0\0\0count=") + 4  # of the first index record
    match damage:
        case "op":
            raw[raw.rfind(b"op=", 0, at + 60) + 3] = 9
        case "version":
            raw[raw.find(b"ver=") + 4] = 2
        case "count":
            raw[at + 6 : at + 10] = struct.pack("<I", 7_000)
        case "length":
            raw[at - 4 : at] = struct.pack("<I", 2**31)
    path.write_bytes(raw)
    with pytest.raises(RecordingUnreadable, match=r"a\.bag"):
        open_recording([path])


def test_an_index_that_names_a_part_twice_is_refused(tmp_path: Path) -> None:
    """Else a small bag, which names its one part a million times, would hold any number of messages."""
    path = written(tmp_path / "a.bag")
    content = bytearray(path.read_bytes())
    places = [found.end() for found in re.finditer(rb"chunk_pos=", content)]
    assert len(places) > 1
    content[places[1] : places[1] + 8] = content[places[0] : places[0] + 8]
    path.write_bytes(content)
    with pytest.raises(RecordingUnreadable, match="The index names a part twice"):
        open_recording([path])

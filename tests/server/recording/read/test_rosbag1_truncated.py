"""Bags of ROS 1 without their index: whatever is whole in them is read, and what they leave out is named."""

from __future__ import annotations

import signal
import struct
import subprocess
from pathlib import Path

import pytest
from rosbags.rosbag1 import Reader

from server.recording.read import rosbag1_truncated
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.read import open_recording
from server.recording.read.rosbag1 import Bag1, fields_of
from server.recording.read.rosbag1 import _message as message_at
from server.recording.read.rosbag1_truncated import CutBag1, is_cut
from tests.server.recording.bags import Drive, write_ros1
from tests.server.recording.read.test_rosbag1 import MESSAGES, read, written
from tests.vehicle.ros_nodes import ROS1_PYTHON

# The recorder of ROS 1 itself, which is killed while it records: 30 kB a chunk.
RECORDER = """
import sys, time
import rosbag
from std_msgs.msg import Float64, String
bag = rosbag.Bag(sys.argv[1], "w", compression=sys.argv[2], chunk_threshold=30_000)
for n in range(2000):
    bag.write("/speed", Float64(float(n)))
    if n % 10 == 0:
        bag.write("/text", String("x" * 100))
bag._file.flush()
print("recorded", flush=True)
time.sleep(60)
"""


def unindexed(path: Path) -> Path:
    """As a recorder leaves it whose last chunk was complete: its header does not know where the index is."""
    content = bytearray(path.read_bytes())
    at = content.index(b"index_pos=") + len(b"index_pos=")
    end = struct.unpack_from("<Q", content, at)[0]
    content[at : at + 8] = bytes(8)
    path.write_bytes(content[:end])
    return path


@pytest.mark.parametrize("step", [1, 7])
@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_without_its_index_it_has_all_that_it_had(tmp_path: Path, compression: str, step: int) -> None:
    path = written(tmp_path / "a.bag", compression=compression, step=step)
    whole = Bag1(path)
    there, channels = read(whole), list(whole.channels)
    whole.close()
    assert not is_cut(path)
    assert is_cut(unindexed(path))
    bag = CutBag1(path)
    assert read(bag) == there
    assert (bag.start_ns, bag.end_ns) == (there[0][0], there[-1][0])
    assert [one for one in channels if one.count] == [one for one in bag.channels if one.count]
    late_ns = there[len(there) // 2][0]
    assert read(bag, late_ns) == [row for row in there if row[0] >= late_ns]
    bag.close()


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_wherever_it_ends_what_is_whole_is_read(tmp_path: Path, compression: str) -> None:
    path = written(tmp_path / "a.bag", compression=compression)
    content = path.read_bytes()
    with Reader(path) as reader:
        there = [(time_ns, connection.topic, bytes(raw)) for connection, time_ns, raw in reader.messages()]
        ends = [one.datapos + one.datasize for one in reader.chunks.values()]
        counts = [sum(info.connection_counts.values()) for info in reader.chunk_infos]
    for size in (*range(4700, len(content), 997), *(end - 1 for end in ends), *ends, len(content) - 1):
        path.write_bytes(content[:size])
        assert is_cut(path)
        whole = sum(count for end, count in zip(ends, counts, strict=True) if end <= size)
        if whole == 0 and compression != "none":
            with pytest.raises(RecordingUnreadable, match=r"a.bag is not complete: it ends too early$"):
                CutBag1(path)
            continue
        with open_recording([path]) as recording:
            count = sum(1 for _ in recording.messages())
            assert "a.bag was never closed" in recording.damage[0]
        if compression == "none":  # of the chunk that ends too early, its whole messages too
            assert whole <= count < whole + max(counts)
        else:
            assert count == whole
    assert len(there) == sum(counts) == MESSAGES


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_a_recorder_that_is_killed_leaves_what_it_wrote(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "a.bag.active"
    if subprocess.run([ROS1_PYTHON, "-c", "import rosbag, std_msgs.msg"], capture_output=True, check=False).returncode:
        pytest.skip("Debian's python3-rosbag is not installed")
    with subprocess.Popen(
        [ROS1_PYTHON, "-c", RECORDER, str(path), compression], stdout=subprocess.PIPE, env={"PATH": "/usr/bin:/bin"}
    ) as recorder:
        assert recorder.stdout is not None
        assert recorder.stdout.readline() == b"recorded\n"
        recorder.send_signal(signal.SIGKILL)
    with open_recording([path]) as recording:
        numbers = [one.message["data"] for one in recording.messages() if one.topic == "/speed"]
    assert numbers == [float(n) for n in range(len(numbers))]
    assert len(numbers) == 2000 if compression == "none" else len(numbers) > 1000


def test_what_is_odd_ends_it_and_takes_no_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A header of 4 GB, a chunk that declares more than may be read, records of other kinds, a bag of nothing."""
    path = unindexed(written(tmp_path / "a.bag", compression="bz2"))
    content = path.read_bytes()
    with CutBagChunks(path) as chunks:
        second, third = chunks[1], chunks[2]
    path.write_bytes(content[:second] + b"\xff\xff\xff\xff" + content[second + 4 :])
    assert 0 < heard_of(path) < 20
    path.write_bytes(content[:third] + struct.pack("<I", 24) + b"\x04\x00\x00\x00op=\x09" + bytes(1000))
    assert 0 < heard_of(path) < 40
    path.write_bytes(content[:4117])
    with pytest.raises(RecordingUnreadable, match=r"a.bag is not complete: it ends too early$"):
        CutBag1(path)
    path.write_bytes(content)
    monkeypatch.setattr(rosbag1_truncated, "allowed_bytes", lambda most: 10)
    assert heard_of(path) == MESSAGES  # that limit is for a chunk that was never closed
    at = content.index(b"size=", second) + len(b"size=")
    path.write_bytes(content[:at] + b"\xff\xff\xff\xff" + content[at + 4 :])
    with pytest.raises(RecordingUnreadable, match=r"a.bag cannot be read: of a part of it, it would take more than"):
        CutBag1(path)


def test_damage_costs_what_it_hit_and_is_named(tmp_path: Path) -> None:
    """A chunk of zeros, as a power loss leaves it; a topic's name that is no text; zeros in the midst of a chunk."""
    path = unindexed(written(tmp_path / "a.bag", compression="bz2"))
    content = path.read_bytes()
    with CutBagChunks(path) as places:
        at = content.index(b"BZh9", places[2])
    path.write_bytes(content[: at + 4] + bytes(60) + content[at + 64 :])
    assert 300 < heard_of(path) < MESSAGES
    assert "a.bag is damaged: 1 piece of it is left out" in damage_of(path)
    path = unindexed(written(tmp_path / "b.bag", compression="none"))
    content = path.read_bytes()
    path.write_bytes(content.replace(b"topic=/speed", b"topic=/spe\xff\xff"))
    assert heard_of(path) == MESSAGES // 2
    assert "b.bag is damaged" in damage_of(path)
    with CutBagChunks(path) as places:
        hole = places[3] + 150
    path.write_bytes(content[:hole] + bytes(40) + content[hole + 40 :])
    assert 300 < heard_of(path) < MESSAGES
    assert "b.bag is damaged: 1 piece of it is left out" in damage_of(path)


def test_a_record_is_of_one_kind(tmp_path: Path) -> None:
    """What is marked as a connection and a message is not read as another message."""
    path = unindexed(written(tmp_path / "a.bag", compression="none"))
    content = path.read_bytes()
    twice = b"\x04\0\0\0op=\x07\x04\0\0\0op=\x02"
    assert fields_of(twice) == {b"op": b"\x07"}
    chunk = (struct.pack("<I", len(twice)) + twice + bytes(4)) * 1001
    with pytest.raises(IndexError):
        message_at(chunk + content, 0)


def test_a_header_that_lies_about_its_index_or_is_encrypted(tmp_path: Path) -> None:
    path = unindexed(written(tmp_path / "a.bag"))
    content = path.read_bytes()
    at = content.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(content[:at] + b"\xff" * 8 + content[at + 8 :])
    assert is_cut(path)
    assert heard_of(path) == MESSAGES
    path.write_bytes(content.replace(b"conn_count=", b"encryptor=x", 1))
    assert not is_cut(path)
    with pytest.raises(RecordingUnreadable, match=r"a\.bag"):
        open_recording([path])


def test_a_latched_topic_stays_latched(tmp_path: Path) -> None:
    rows = [(n / 10, topic, "std_msgs/msg/Float64", {"data": 1.0}) for n in range(9) for topic in ("/speed", "/map")]
    path = unindexed(write_ros1(tmp_path / "a.bag", Drive(messages=rows, latched={"/map"})))
    with open_recording([path]) as recording:
        assert {topic: one.is_latched for topic, one in recording.topics.items()} == {"/speed": False, "/map": True}


def heard_of(path: Path) -> int:
    bag = CutBag1(path)
    count = len(read(bag))
    bag.close()
    return count


def damage_of(path: Path) -> str:
    with open_recording([path]) as recording:
        assert sum(1 for _ in recording.messages())
        return "; ".join(recording.damage)


class CutBagChunks:
    """Where the chunks of a bag begin."""

    def __init__(self, path: Path) -> None:
        self.bag = CutBag1(path)

    def __enter__(self) -> list[int]:
        return sorted(self.bag._reader.chunks)

    def __exit__(self, *_: object) -> None:
        self.bag.close()

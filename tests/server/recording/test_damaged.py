"""What is no recording, or one no more: one clear sentence each, and never anything else."""

from __future__ import annotations

import contextlib
import os
import random
import re
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard

from server.recording.read.read import RecordingUnreadable, open_recording
from tests.server.recording.bags import BEGIN_S, Drive, write_ros1, write_ros2
from tests.server.recording.read.test_read import ROWS

LONG = Drive(messages=[(n * 0.01, "/text", "std_msgs/msg/String", {"data": f"{n:04d} " * 40}) for n in range(300)])
MAKERS: dict[str, Callable[[Path], Path]] = {
    "bag": lambda folder: write_ros1(folder / "a.bag", Drive(messages=LONG.messages, chunk_bytes=10_000)),
    "bag.bz2": lambda f: write_ros1(f / "a.bag", Drive(messages=LONG.messages, chunk_bytes=10_000, compression="bz2")),
    "bag.lz4": lambda f: write_ros1(f / "a.bag", Drive(messages=LONG.messages, chunk_bytes=10_000, compression="lz4")),
    "mcap": lambda folder: next(write_ros2(folder / "a", LONG).glob("*.mcap")),
    "mcap.zstd": lambda f: next(write_ros2(f / "a", Drive(messages=LONG.messages, compression="zstd")).glob("*.mcap")),
    "db3": lambda folder: next(write_ros2(folder / "a", LONG, storage="sqlite3").glob("*.db3")),
}


def why_unreadable(*paths: Path) -> str:
    with pytest.raises(RecordingUnreadable) as error, open_recording(list(paths)) as recording:
        list(recording.messages())
    sentence = str(error.value)
    assert "\n" not in sentence
    assert len(sentence) < 400
    return sentence


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "is empty: it has 0 bytes"),
        (b"\x89PNG\r\n\x1a\n" + bytes(50), "is a PNG picture"),
        (b"\xff\xd8\xff\xe0" + bytes(50), "is a JPEG picture"),
        (b"PK\x03\x04" + bytes(50), "is a ZIP archive: unpack it first"),
        (b"\x1f\x8b\x08" + bytes(50), "is packed with gzip: unpack it first"),
        (zstandard.ZstdCompressor().compress(b"#ROSBAG V2.0\n" + bytes(50)), "is packed with zstd: unpack it first"),
        (b"%PDF-1.7", "is a PDF document"),
        (b"hello,world\n1,2\n", "is a text file"),
        ("Größe\n".encode() * 100, "is a text file"),
        (b"#ROSBAG V1.2\n", "a ROS bag of an old format"),
        (b"#ROSRECORD V1.1\n", "a ROS bag of an old format"),
        (b"\0" * 1_000, "neither a ROS 1 bag nor an MCAP or db3 file"),
        (bytes(range(256)) * 4, "neither a ROS 1 bag nor an MCAP or db3 file"),
    ],
)
@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a.db3", "a"])
def test_foreign_files_are_called_by_their_name(tmp_path: Path, content: bytes, why: str, name: str) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    sentence = why_unreadable(file)
    assert why in sentence
    assert sentence.startswith(f"{file} is ")


def test_what_is_not_there_or_no_file(tmp_path: Path) -> None:
    assert why_unreadable(tmp_path / "a.bag") == f"{tmp_path}/a.bag does not exist"
    assert why_unreadable(tmp_path) == f"{tmp_path} is a directory without a recording in it"
    os.mkfifo(tmp_path / "pipe")
    assert why_unreadable(tmp_path / "pipe") == f"{tmp_path}/pipe is not a regular file"
    (tmp_path / "gone").symlink_to(tmp_path / "nothing")
    assert "does not exist" in why_unreadable(tmp_path / "gone")
    assert why_unreadable() == "no recording was given"
    assert "cannot be read" in why_unreadable(tmp_path / ("x" * 256))


def test_a_folder_with_several_recordings_needs_a_choice(tmp_path: Path) -> None:
    for name in ("a.bag", "b.bag"):
        write_ros1(tmp_path / name, LONG)
    assert why_unreadable(tmp_path).endswith("holds several recordings (a.bag, b.bag): name the one to read")


def test_a_file_that_may_not_be_read(tmp_path: Path) -> None:
    file = MAKERS["bag"](tmp_path)
    file.chmod(0)
    if os.access(file, os.R_OK):
        pytest.skip("this user may read everything")
    assert "permission denied" in why_unreadable(file)


@pytest.mark.parametrize("kind", ["bag", "bag.bz2", "mcap", "mcap.zstd", "db3"])
@pytest.mark.parametrize("part", [0.001, 0.1, 0.5, 0.9, 0.999])
def test_a_recording_cut_short(tmp_path: Path, kind: str, part: float) -> None:
    """What is whole of it is read, in order; nothing else is."""
    file = MAKERS[kind](tmp_path)
    content = file.read_bytes()
    file.write_bytes(content[: max(20, int(len(content) * part))])
    with contextlib.suppress(RecordingUnreadable), open_recording([file]) as recording:
        received = [(one.at_s - BEGIN_S, one.message) for one in recording.messages()]
        assert [message for _, message in received] == [message for *_, message in LONG.messages[: len(received)]]
        assert len(received) == len(LONG.messages) or kind.startswith("bag")  # which has several parts
        end_s = received[-1][0]
        (sentence,) = recording.damage
        assert sentence.startswith(f"{file.name} was never closed: it is read to its last whole part, ")
        assert float(sentence.split()[-2]) == pytest.approx(end_s, abs=0.051)
        return
    assert re.search(r"is damaged|not complete|ends too early|is no recording|no index", why_unreadable(file))


@pytest.mark.parametrize("kind", list(MAKERS))
def test_damage_anywhere_is_an_answer_or_one_sentence(tmp_path: Path, kind: str) -> None:
    """Whatever bytes are hurt: messages come, or are counted as rejected, or the file is reported as damaged."""
    file = MAKERS[kind](tmp_path)
    content = file.read_bytes()
    dice = random.Random(7)
    sentences: list[str] = []
    for _ in range(60):
        hurt = bytearray(content)
        at, size = dice.randrange(len(hurt)), dice.choice([1, 4, 100, 3_000])
        hurt[at : at + size] = dice.choice([bytes(size), dice.randbytes(size), b"\xff" * size])
        file.write_bytes(hurt)
        try:
            with open_recording([file]) as recording:
                count = sum(1 for _ in recording.messages())
            assert count <= 400
        except RecordingUnreadable as error:
            sentences.append(str(error))
    assert len(sentences) > 5
    assert all(file.name in one and "\n" not in one for one in sentences)


def test_metadata_that_is_no_metadata(tmp_path: Path) -> None:
    folder = write_ros2(tmp_path / "a", Drive(messages=ROWS))
    for content in ("", "{", "a: b", "rosbag2_bagfile_information: 5", "- 1\n- 2", "\0"):
        (folder / "metadata.yaml").write_text(content)
        assert "is damaged or not complete" in why_unreadable(folder)


def test_metadata_whose_file_is_gone(tmp_path: Path) -> None:
    folder = write_ros2(tmp_path / "a", Drive(messages=ROWS))
    next(folder.glob("*.mcap")).unlink()
    assert "missing" in why_unreadable(folder)


def test_a_database_of_something_else(tmp_path: Path) -> None:
    import apsw

    database = apsw.Connection(str(tmp_path / "contacts.db3"))
    database.execute("CREATE TABLE people (name TEXT)")
    database.close()
    assert "missing tables" in why_unreadable(tmp_path / "contacts.db3")

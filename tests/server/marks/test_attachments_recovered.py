"""Voice notes and photos in a file whose writer was killed: those that were flushed are in the recovered file."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from mcap.reader import make_reader

from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.recover import recover
from server.recording.verify import verify
from tests.server.marks.media_samples import PHOTO, VOICE

BEGAN_NS = 1_700_000_000_000_000_000


def left(tmp_path: Path) -> tuple[Path, list[int]]:
    """A file that was being written when its writer was killed, and its size after each flush."""
    file = PartFile(tmp_path / "car_1.mcap", profile="ros1", metadata={"vehicle": "car"})
    marks = file.channel("/catgraph/marks", own_schema("marks"))
    sizes = []
    for number, (name, type, data) in enumerate(
        (("mark-a.voice.webm", "audio/webm", VOICE), ("mark-b.photo.jpg", "image/jpeg", PHOTO))
    ):
        file.add(marks, BEGAN_NS + number, b'{"change":"mark"}')
        file.attach(name, type, BEGAN_NS + number, data)
        file.flush()
        sizes.append(file.size)
    file.abandon()
    return tmp_path / "car_1.mcap.writing", sizes


def attachments(path: Path) -> list[tuple[str, bytes]]:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        found = [(one.name, one.data) for one in reader.iter_attachments()]
        assert summary.statistics.attachment_count == len(found)
        return found


@pytest.mark.parametrize(
    ("cut", "count", "state"),
    [(0, 2, "intact"), (60, 2, "intact"), (400, 1, "intact"), (4000, 1, "intact")],
    ids=["whole", "in the last link", "in the photo's end", "in the photo"],
)
def test_what_was_flushed_is_there(tmp_path: Path, cut: int, count: int, state: str) -> None:
    path, sizes = left(tmp_path)
    os.truncate(path, sizes[-1] - cut)
    done = recover(path)
    assert done.path is not None, done.sentence
    both = [("mark-a.voice.webm", VOICE), ("mark-b.photo.jpg", PHOTO)]
    assert attachments(done.path) == both[:count]
    assert verify(done.path).state == state


def test_a_damaged_one_costs_only_itself(tmp_path: Path) -> None:
    path, _ = left(tmp_path)
    raw = bytearray(path.read_bytes())
    raw[raw.index(VOICE) + 100] ^= 1
    path.write_bytes(raw)
    done = recover(path)
    assert done.path is not None, done.sentence
    assert attachments(done.path) == [("mark-b.photo.jpg", PHOTO)]
    assert done.messages == 2
    assert "1 part is damaged and left out." in done.sentence
    assert done.aside is not None
    assert done.aside.exists()


def test_a_change_in_one_shows(tmp_path: Path) -> None:
    path, _ = left(tmp_path)
    done = recover(path)
    assert done.path is not None
    raw = bytearray(done.path.read_bytes())
    raw[raw.index(PHOTO) + 100] ^= 1
    done.path.write_bytes(raw)
    assert verify(done.path).state == "broken"

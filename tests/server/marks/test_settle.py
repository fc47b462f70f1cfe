"""To which recording a mark belongs that none of them has: to one, whichever is looked at first."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.marks.media import MediaName
from server.recording.marks.pending import PendingMedia
from server.recording.marks.recorded import read_marks, read_media
from server.recording.marks.settle import settle
from tests.server.marks.media_samples import VOICE
from tests.server.recording.made import record

T0_MS = 1_790_000_000_000


def recorded(folder: Path, began_ms: int, seconds: float) -> Path:
    stamp = datetime.fromtimestamp(began_ms / 1000, UTC).strftime("%Y%m%dT%H%M%SZ")
    return record(folder / "car" / f"car_{stamp}.mcap", began_ms=began_ms, seconds=seconds)


def mark(id: str, marked_ms: int) -> DriveMark:
    return {
        "mark": id, "marked_ms": marked_ms, "category": None, "words": "", "voice": False, "photo": False,
        "source": "page", "by": None,
    }  # fmt: skip


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2)], ids=str)
def test_each_belongs_to_one(tmp_path: Path, order: tuple[int, ...]) -> None:
    paths = [
        recorded(tmp_path, T0_MS, 20.0),
        recorded(tmp_path, T0_MS + 25_500, 10.0),
        recorded(tmp_path, T0_MS + 100_000, 5.0),
    ]
    moments = {
        "long before": -11_000, "before": -5_000, "in": 10_000, "after": 23_000, "in the second of the name": 25_200,
        "in the next": 30_000, "after both": 60_000, "long after": 80_000, "before the last": 95_000,
    }  # fmt: skip
    logged = {name: mark(name.replace(" ", "-"), T0_MS + at_ms) for name, at_ms in moments.items()}
    by_id = {row["mark"]: row for row in logged.values()}
    for number in order * 2:
        settle(paths[number], by_id, ())
    assert [[row["mark"] for row in read_marks(path)] for path in paths] == [
        ["before", "in", "after", "in-the-second-of-the-name"],
        ["in-the-next", "after-both"],
        ["before-the-last"],
    ]
    assert not settle(paths[0], by_id, ()), "nothing more is to be done"
    settle(paths[0], by_id, ["in"])
    assert [row["mark"] for row in read_marks(paths[0])] == ["before", "after", "in-the-second-of-the-name"]


def test_what_was_kept_beside_the_one_before_is_given_to_the_recording_that_began(tmp_path: Path) -> None:
    """A mark came just when a recording began, before its file was there."""
    pending = PendingMedia(tmp_path / "marks")
    first = recorded(tmp_path, T0_MS, 10.0)
    logged = {"m": mark("m", T0_MS + 15_020), "old": mark("old", T0_MS + 12_000)}
    for name in logged:
        pending.keep("car", MediaName(mark=name, kind="voice", ending="webm"), VOICE)
    settle(first, logged, (), pending=pending, vehicle="car")
    assert [row["mark"] for row in read_marks(first)] == ["old", "m"]
    second = recorded(tmp_path, T0_MS + 15_000, 5.0)
    assert settle(first, logged, (), pending=pending, vehicle="car")
    settle(second, logged, (), pending=pending, vehicle="car")
    assert [[row["mark"] for row in read_marks(path)] for path in (first, second)] == [["old"], ["m"]]
    assert [read_media(path, name, "voice") is not None for path in (first, second) for name in logged] == [
        *(False, True),
        *(True, False),
    ]
    assert pending.files("car") == {}
    assert not settle(first, logged, (), pending=pending, vehicle="car")
    assert [row["mark"] for row in read_marks(first)] == ["old"]
    first.write_bytes(first.read_bytes()[:-100])  # without its index nothing is known of when it was
    settle(first, logged, (), pending=pending, vehicle="car")
    assert [row["mark"] for row in annotation_store.read(first).marks] == ["old"]
    settle(second, {}, (), pending=pending, vehicle="car")  # the log knows nothing of it any more
    assert [row["mark"] for row in read_marks(second)] == ["m"]


def test_a_mark_before_a_recording_waits_for_the_one_before_to_be_complete(tmp_path: Path) -> None:
    first = recorded(tmp_path, T0_MS, 10.0)
    writing = first.rename(first.with_name(f"{first.name}.writing"))
    second = recorded(tmp_path, T0_MS + 15_000, 5.0)
    logged = {"m": mark("m", T0_MS + 9_500)}
    settle(second, logged, ())
    assert read_marks(second) == []
    writing.rename(first.with_name(f"{first.name}.damaged"))
    settle(second, logged, ())
    assert [row["mark"] for row in read_marks(second)] == ["m"]


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=str)
def test_parts_of_a_session_have_one_name_and_own_beginnings(tmp_path: Path, order: tuple[int, ...]) -> None:
    first = recorded(tmp_path, T0_MS, 2.0)
    second = record(first.with_name(first.name.replace(".mcap", "_p2.mcap")), began_ms=T0_MS + 2_500, seconds=5.0)
    marks = {name: mark(name, T0_MS + at_ms) for name, at_ms in (("gap", 2_300), ("in", 4_000), ("after", 9_000))}
    for number in order * 2:
        settle((first, second)[number], marks, ())
    assert [[row["mark"] for row in read_marks(path)] for path in (first, second)] == [["gap"], ["in", "after"]]

"""Beside a recording as much as may be there is read again, and what is too much costs nothing that was there."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.protocol.driving_state import InterventionDescription
from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import MAX_BYTES, MAX_MARKS, MAX_NOTE, Annotations
from server.recording.marks import described as descriptions

AT_MS = 1_790_000_000_000
LETTER = "\U0001f697"  # of four bytes


def mark(n: int, text: str) -> DriveMark:
    return {
        "mark": f"{n:040}", "marked_ms": -(2**53) + 1 + n, "category": LETTER * 40, "words": text, "voice": False,
        "photo": False, "source": "page", "by": LETTER * 200,
    }  # fmt: skip


def description(n: int, text: str) -> InterventionDescription:
    return {
        "intervention": f"{n:060}", "described_ms": AT_MS + n, "what": text, "category": LETTER * 60,
        "initiated_by": "operator", "by": LETTER * 120,
    }  # fmt: skip


@pytest.mark.parametrize("letter", [LETTER, '"', "\\"], ids=["car", "quote", "backslash"])
def test_all_that_may_be_written_is_read_again(tmp_path: Path, letter: str) -> None:
    path = tmp_path / "car_20260921T133320Z.mcap"
    annotation_store.write(path, Annotations(title="Lap", note=letter * MAX_NOTE, tags=("wet",)))
    annotation_store.write_described(path, [description(n, letter * 2000) for n in range(descriptions.MOST)])
    annotation_store.write_marks(
        path, [mark(n, letter * 2000) for n in range(MAX_MARKS)], [f"{n:040}" for n in range(MAX_MARKS)]
    )
    assert annotation_store.beside(path).stat().st_size <= MAX_BYTES
    there = annotation_store.read(path)
    assert (there.title, len(there.marks), len(there.described)) == ("Lap", MAX_MARKS, descriptions.MOST)
    annotation_store.write(path, Annotations(title="Second lap"))
    assert len(annotation_store.read(path).marks) == MAX_MARKS
    assert [one.name for one in tmp_path.iterdir()] == [f"{path.name}.json"]


def test_what_is_too_large_is_refused_and_what_was_there_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "car_20260921T133320Z.mcap"
    annotation_store.write(path, Annotations(title="Lap"))
    monkeypatch.setattr(annotation_store, "MAX_BYTES", 2000)
    with pytest.raises(OSError, match="more than the 2000 that are kept beside a recording"):
        annotation_store.write_marks(path, [mark(0, "x" * 2000)], [])
    assert annotation_store.read(path) == Annotations(title="Lap")


def test_no_file_of_somebody_else_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "car_20260921T133320Z.mcap"
    for other in ("first", "second", "third"):
        annotation_store.beside(path).write_text(other)
        annotation_store.write(path, Annotations(title="Lap"))
    assert [one.read_text() for one in sorted(tmp_path.glob("*.other*"))] == ["first", "second", "third"]


def test_the_oldest_are_left_out_and_that_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "car_20260921T133320Z.mcap"
    marks = [mark(n, "") for n in range(MAX_MARKS)]
    for _ in range(2):
        annotation_store.write_marks(path, [mark(MAX_MARKS, ""), *marks], [])
    rows = [description(n, "") for n in range(descriptions.MOST + 1)]
    annotation_store.write_described(path, rows[::-1])
    there = annotation_store.read(path)
    assert {row["mark"] for row in there.marks} == {f"{n:040}" for n in range(1, MAX_MARKS + 1)}
    assert {row["intervention"] for row in there.described} == {row["intervention"] for row in rows[1:]}
    assert f"2501 marks, of which the newest {MAX_MARKS} are kept" in caplog.text
    assert "1001 descriptions of interventions, of which the newest 1000 are kept" in caplog.text

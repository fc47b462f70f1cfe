"""What people call a recording: bounded, cleaned, kept whole beside it, and never at the cost of what was there."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import orjson
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import (
    MAX_NOTE,
    MAX_TAG,
    MAX_TAGS,
    MAX_TITLE,
    Annotations,
    BadAnnotation,
    changed,
)


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("Lot 3, wet", "Lot 3, wet"),
        ("  two\t words\n\nhere ", "two words here"),
        ("\u202egnp.exe", "gnp.exe"),
        ("a\u2066b\u2069\u200bc\ufeff", "abc"),
        ("a\x00b\x1b[31mc", "a b [31mc"),
        ("\ud800", ""),
        ("נסיעה ראשונה", "נסיעה ראשונה"),
        ("\u0645\u06cc\u200c\u0631\u0648\u062f", "\u0645\u06cc\u200c\u0631\u0648\u062f"),  # Persian needs its joiner
        ("👩‍🔧 checks", "👩‍🔧 checks"),
        ("<b>&amp;", "<b>&amp;"),
        ("", ""),
    ],
)
def test_a_title_is_one_line_of_letters_that_are_seen(given: str, kept: str) -> None:
    assert changed(Annotations(), title=given).title == kept


def test_a_note_keeps_its_lines() -> None:
    assert changed(Annotations(), note=" one \r\n\r\n two\u202e\x00 \n").note == "one\n\n two"


def test_each_tag_stands_once_and_empty_ones_not_at_all() -> None:
    assert changed(Annotations(), tags=["Wet", " ", "wet", "night ", "WET"]).tags == ("Wet", "night")
    assert changed(Annotations(tags=("a",)), tags=[]).tags == ()


@pytest.mark.parametrize(
    ("field", "given", "sentence"),
    [
        ("title", "x" * (MAX_TITLE + 1), "A title has at most 120 letters; this has 121."),
        ("title", "x" * 10_000, "A title has at most 120 letters; this has 10000."),
        ("note", "x" * (MAX_NOTE + 1), "A note has at most 4000 letters; this has 4001."),
        ("tags", ["x" * (MAX_TAG + 1)], "A tag has at most 40 letters; this has 41."),
        ("tags", [str(n) for n in range(MAX_TAGS + 1)], "A recording has at most 20 tags."),
    ],
)
def test_what_is_too_long_is_refused_not_cut(field: str, given: object, sentence: str) -> None:
    with pytest.raises(BadAnnotation, match=sentence) as caught:
        changed(Annotations(), **{field: given})  # type: ignore[arg-type]
    assert caught.value.field == field


def test_what_fits_exactly_is_taken() -> None:
    assert len(changed(Annotations(), title="x" * MAX_TITLE, note="y" * MAX_NOTE).note) == MAX_NOTE


LINES = st.text(max_size=60)


@example(title="", note="wet\x1b\rdark", tags=[])  # a letter that becomes a blank at the end of a line
@given(title=LINES, note=st.text(max_size=200), tags=st.lists(st.text(max_size=MAX_TAG), max_size=MAX_TAGS))
def test_any_annotation_comes_back_as_it_was_kept(
    tmp_path_factory: pytest.TempPathFactory, title: str, note: str, tags: list[str]
) -> None:
    found = changed(Annotations(), title=title, note=note, tags=tags)
    for letter in found.title + "".join(found.tags):
        assert unicodedata.category(letter) not in ("Cc", "Cs", "Zl", "Zp")
        assert unicodedata.bidirectional(letter) not in ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
    assert changed(found, title=found.title, note=found.note, tags=found.tags) == found
    path = tmp_path_factory.mktemp("found") / "car_1.mcap"
    annotation_store.write(path, found)
    assert annotation_store.read(path) == found


def test_empty_annotations_leave_no_file(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    annotation_store.write(path, Annotations(title="a"))
    annotation_store.write(path, Annotations())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[1]", b"null", b'{"title": 7, "note": [], "tags": "x"}', b"\xff\xfe", b'{"title":"' + b"x" * 300_000],
)
def test_a_file_of_another_program_is_not_read(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "car_1.mcap"
    annotation_store.beside(path).write_bytes(content)
    assert annotation_store.read(path) == Annotations()


def test_a_file_of_somebody_elses_is_not_lost(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    annotation_store.beside(path).write_bytes(b"not ours")
    annotation_store.write(path, Annotations(title="ours"))
    assert (tmp_path / "car_1.mcap.json.other").read_bytes() == b"not ours"
    assert annotation_store.read(path).title == "ours"


def test_hostile_remarks_in_a_file_that_was_copied_in_are_cleaned_and_cut(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    body = {"title": "\u202e" + "t" * 9000, "note": "n" * 9000, "tags": ["a" * 99, 7, *map(str, range(99))]}
    annotation_store.beside(path).write_bytes(orjson.dumps(body))
    found = annotation_store.read(path)
    assert found.title == "t" * MAX_TITLE
    assert len(found.note) == MAX_NOTE
    assert len(found.tags) == MAX_TAGS
    assert found.tags[0] == "a" * MAX_TAG


def test_a_disk_that_takes_nothing_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "car_1.mcap"
    annotation_store.write(path, Annotations(title="before"))

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        annotation_store.write(path, Annotations(title="after"))
    assert annotation_store.read(path).title == "before"
    assert [one.name for one in tmp_path.iterdir()] == ["car_1.mcap.json"]

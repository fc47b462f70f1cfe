"""Voice notes and photos that no recording will take do not wait for one."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from server.recording.folder import RecordingsFolder
from server.recording.marks import pending as pending_module
from server.recording.marks.keeper import MarkKeeper
from server.recording.marks.media import MediaName
from server.recording.marks.pending import NoRoom, PendingMedia
from server.recording.marks.recorded import read_marks, read_media
from tests.server.marks.media_samples import VOICE
from tests.server.recording.made import BEGAN_MS, record

NOW_MS = BEGAN_MS + 3_600_000
FILE = "car_20260921T133320Z.mcap"


def voice(mark: str) -> MediaName:
    return MediaName(mark=mark, kind="voice", ending="webm")


def event(n: int, mark: str, marked_ms: int, change: str = "mark") -> dict[str, Any]:
    return {
        "n": n, "change": change, "mark": mark, "marked_ms": marked_ms, "category": None, "words": "", "voice": True,
        "photo": False, "source": "page", "by": None,
    }  # fmt: skip


def keeper_of(tmp_path: Path, pending: PendingMedia, events: list[dict[str, Any]]) -> MarkKeeper:
    async def find_events(vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        since_ms = filters.get("since_ms", 0)
        found = [one for one in events if one["change"] == filters["change"] and one["marked_ms"] >= since_ms]
        return found[::-1]

    return MarkKeeper(
        RecordingsFolder(tmp_path / "recordings"),
        pending,
        vehicles=lambda: ("car",),
        find_events=find_events,
        on_changed=lambda _: None,
        wall_ms=lambda: NOW_MS,
    )


async def tidied(tmp_path: Path, pending: PendingMedia, events: list[dict[str, Any]]) -> None:
    keeper = keeper_of(tmp_path, pending, events)
    keeper.start()
    await keeper.settled()
    await keeper.stop()


async def test_what_was_taken_back_is_deleted_and_what_nothing_covers_is_put_aside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = record(tmp_path / "recordings" / "car" / FILE, seconds=5.0)
    pending = PendingMedia(tmp_path / "marks")
    events = []
    for n, (mark, marked_ms) in enumerate(
        {"in": BEGAN_MS + 1000, "back": BEGAN_MS + 2000, "alone": BEGAN_MS + 600_000, "new": NOW_MS - 1000}.items()
    ):
        pending.keep("car", voice(mark), VOICE + mark.encode())
        events.append(event(n, mark, marked_ms))
    events.append(event(9, "back", BEGAN_MS + 2000, "mark_removed"))
    await tidied(tmp_path, pending, events)
    assert set(pending.waiting("car")) == {voice("new")}
    assert set(pending.files("car")) == {voice("new"), voice("alone")}
    assert pending.read("car", "alone", "voice") == (voice("alone"), VOICE + b"alone")
    assert pending.read("car", "back", "voice") is None
    assert read_media(path, "in", "voice") == (voice("in"), VOICE + b"in")
    assert read_media(path, "back", "voice") is None
    monkeypatch.setattr(pending_module, "MOST_BYTES", 2 * len(VOICE) + 10)
    assert pending.keep("car", voice("more"), VOICE), "what was put aside leaves room"
    with pytest.raises(NoRoom):
        pending.keep("car", voice("too many"), VOICE)
    assert not pending.keep("car", voice("alone"), VOICE + b"alone"), "it is there"
    (tmp_path / "marks" / "car" / "more.voice.webm").unlink()
    assert pending.keep("car", voice("alone"), VOICE)
    assert pending.read("car", "alone", "voice") == (voice("alone"), VOICE)
    assert not list((tmp_path / "marks" / "car" / "kept").iterdir())


async def test_what_was_put_aside_is_deleted_and_taken_too(tmp_path: Path) -> None:
    pending = PendingMedia(tmp_path / "marks")
    events = [event(0, "found", BEGAN_MS + 1000), event(1, "back", BEGAN_MS + 2000)]
    for mark in ("found", "back"):
        pending.keep("car", voice(mark), VOICE)
    await tidied(tmp_path, pending, events)
    assert pending.waiting("car") == {}
    assert len(pending.files("car")) == 2
    path = record(tmp_path / "recordings" / "car" / FILE, seconds=5.0)  # recovered, say
    await tidied(tmp_path, pending, [*events, event(2, "back", BEGAN_MS + 2000, "mark_removed")])
    assert pending.files("car") == {}
    assert read_media(path, "found", "voice") == (voice("found"), VOICE)


async def test_while_one_is_being_written_that_may_take_it_it_waits(tmp_path: Path) -> None:
    pending = PendingMedia(tmp_path / "marks")
    pending.keep("car", voice("m"), VOICE)
    folder = tmp_path / "recordings" / "car"
    folder.mkdir(parents=True)
    (folder / f"{FILE}.writing").write_bytes(b"")
    await tidied(tmp_path, pending, [event(0, "m", BEGAN_MS + 1000)])
    assert set(pending.waiting("car")) == {voice("m")}


async def test_a_complete_recording_takes_what_the_one_before_had_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mark was logged just when its recording began, before its file was there; also where the disk failed once."""
    pending = PendingMedia(tmp_path / "marks")
    pending.keep("car", voice("m"), VOICE)
    folder = tmp_path / "recordings" / "car"
    first = record(folder / FILE, seconds=5.0)
    keeper = keeper_of(tmp_path, pending, [event(0, "m", BEGAN_MS + 9_020)])
    keeper.start()
    await keeper.settled()
    assert [row["mark"] for row in read_marks(first)] == ["m"]
    stamp = datetime.fromtimestamp((BEGAN_MS + 9_000) / 1000, UTC).strftime("%Y%m%dT%H%M%SZ")
    second = record(folder / f"car_{stamp}.mcap", began_ms=BEGAN_MS + 9_000, seconds=5.0)
    looks, refused = keeper._beside, []

    def beside(path: Path, vehicle: str) -> list[Path]:
        if not refused:
            refused.append(path)
            raise OSError("the disk does not answer")
        return looks(path, vehicle)

    monkeypatch.setattr(keeper, "_beside", beside)
    keeper.finished(second)
    await keeper.settled()
    assert refused == [second]
    keeper.late("car", BEGAN_MS)  # whatever comes next
    await keeper.settled()
    await keeper.stop()
    assert [[row["mark"] for row in read_marks(path)] for path in (first, second)] == [[], ["m"]]
    assert read_media(first, "m", "voice") is None
    assert read_media(second, "m", "voice") == (voice("m"), VOICE)

"""Voice notes and photos that wait for a recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from server.protocol.marks import DriveMark
from server.recording.marks.media import MediaName
from server.recording.marks.pending import PendingMedia, Taken
from server.recording.marks.recorded import read_media
from server.recording.marks.settle import settle
from tests.server.marks.media_samples import VOICE
from tests.server.recording.made import BEGAN_MS, record

VOICE_NAME = MediaName(mark="m", kind="voice", ending="webm")
OTHER_ENDING = MediaName(mark="m", kind="voice", ending="ogg")
NEWER = VOICE + b"newer"
ID = "car_20260921T133320Z"


class Interrupted(PendingMedia):
    """Something comes between the reading of a file and its removal."""

    def __init__(self, root: Path, between: Callable[[PendingMedia], object]) -> None:
        super().__init__(root)
        self._between = between

    def take(self, path: Path) -> Taken | None:
        taken = super().take(path)
        self._between(self)
        return taken


def row(at_ms: int = BEGAN_MS + 1000) -> DriveMark:
    return {
        "mark": "m", "marked_ms": at_ms, "category": None, "words": "", "voice": True, "photo": False,
        "source": "page", "by": None,
    }  # fmt: skip


@pytest.mark.parametrize("newer", [VOICE_NAME, OTHER_ENDING], ids=["same ending", "other ending"])
def test_one_that_comes_meanwhile_is_not_lost(tmp_path: Path, newer: MediaName) -> None:
    path = record(tmp_path / "car" / f"{ID}.mcap", seconds=5.0)
    pending = Interrupted(tmp_path / "marks", lambda it: it.keep("car", newer, NEWER))
    pending.keep("car", VOICE_NAME, VOICE)
    assert settle(path, {"m": row()}, (), pending=pending, vehicle="car")
    assert pending.read("car", "m", "voice") == (newer, NEWER)
    again = PendingMedia(tmp_path / "marks")
    assert settle(path, {"m": row()}, (), pending=again, vehicle="car")
    assert again.files("car") == {}
    assert read_media(path, "m", "voice") == (newer, NEWER)

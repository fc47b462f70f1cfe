"""A damaged voice note in a complete recording costs only itself."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.protocol.marks import DriveMark
from server.recording.marks.media import MediaName
from server.recording.marks.pending import PendingMedia
from server.recording.marks.recorded import all_media, in_file, read_media
from server.recording.marks.settle import settle
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from tests.server.marks.media_samples import PHOTO, VOICE

BEGAN_MS = 1_790_000_000_000
NAMES = ("a.voice.webm", "b.photo.jpg", "c.voice.webm")
VOICE_A = VOICE + b"a"


def complete(path: Path) -> Path:
    file = PartFile(path, profile="ros1", metadata={"vehicle": "car"})
    marks = file.channel("/catgraph/marks", own_schema("marks"))
    for number, (name, data) in enumerate(zip(NAMES, (VOICE_A, PHOTO, VOICE), strict=True)):
        file.add(marks, (BEGAN_MS + number) * 1_000_000, b'{"change":"mark"}')
        type = "image/jpeg" if "photo" in name else "audio/webm"
        file.attach(f"mark-{name}", type, BEGAN_MS * 1_000_000, data)
    file.close(ended="closed")
    return path


def damaged(path: Path, what: str) -> Path:
    """Damage in the first attachment, of mark a."""
    raw = bytearray(path.read_bytes())
    at = raw.index(VOICE_A)
    match what:
        case "data":
            raw[at + 100] ^= 1
        case "length of the data":
            raw[at - 8 : at] = (2**40).to_bytes(8, "little")
        case "length of the name":
            name_at = raw.index(b"mark-a.voice.webm")
            raw[name_at - 4 : name_at] = (2**31).to_bytes(4, "little")
        case "letters of the name":
            raw[raw.index(b"mark-a.voice.webm")] = 0xFF
        case "opcode":
            raw[raw.index(b"mark-a.voice.webm") - 4 - 16 - 9] = 0x05
    path.write_bytes(raw)
    return path


@pytest.mark.parametrize(
    "what", ["data", "length of the data", "length of the name", "letters of the name", "opcode"], ids=str
)
def test_the_others_are_read(tmp_path: Path, what: str) -> None:
    path = complete(tmp_path / "car" / "car_20260921T133320Z.mcap")
    assert sorted(name.file for name, _ in all_media(path)) == sorted(NAMES)
    damaged(path, what)
    assert {name.file: data for name, data in all_media(path)} == {"b.photo.jpg": PHOTO, "c.voice.webm": VOICE}
    assert read_media(path, "a", "voice") is None


def test_what_is_damaged_in_the_file_is_kept_beside_it(tmp_path: Path) -> None:
    path = damaged(complete(tmp_path / "car" / "car_20260921T133320Z.mcap"), "letters of the name")
    pending = PendingMedia(tmp_path / "marks")
    voice = MediaName(mark="a", kind="voice", ending="webm")
    pending.keep("car", voice, VOICE_A)
    row: DriveMark = {
        "mark": "a", "marked_ms": round(in_file(path).start_ms), "category": None, "words": "", "voice": True,
        "photo": False, "source": "page", "by": None,
    }  # fmt: skip
    assert settle(path, {"a": row}, (), pending=pending, vehicle="car")
    assert read_media(path, "a", "voice") == (voice, VOICE_A)

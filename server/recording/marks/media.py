"""Voice notes and photos of marks: which kinds are taken, how large, and what their files are called."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

Kind = Literal["voice", "photo"]
KINDS: tuple[Kind, ...] = get_args(Kind)

MAX_BYTES: dict[Kind, int] = {"voice": 1024 * 1024, "photo": 8 * 1024 * 1024}
TYPES: dict[Kind, dict[str, str]] = {  # media type → ending
    "voice": {"audio/webm": "webm", "audio/ogg": "ogg", "audio/mp4": "m4a"},
    "photo": {"image/jpeg": "jpg", "image/png": "png", "image/webp": "webp"},
}
_FILE = re.compile(r"([A-Za-z0-9-]{1,40})\.(voice|photo)\.([a-z0-9]{3,4})")
_PREFIX = "mark-"  # of an attachment's name


class BadMedia(ValueError):
    """What was sent is not taken; `str()` is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MediaName:
    """The name of a voice note or a photo."""

    mark: str
    kind: Kind
    ending: str

    @property
    def file(self) -> str:
        """Of a file."""
        return f"{self.mark}.{self.kind}.{self.ending}"

    @property
    def attachment(self) -> str:
        """Of an attachment in a recording."""
        return f"{_PREFIX}{self.file}"

    @property
    def media_type(self) -> str:
        return next(type for type, ending in TYPES[self.kind].items() if ending == self.ending)


def name_of(file: str) -> MediaName | None:
    """The name of a file, or of an attachment; None: it is none of a mark."""
    found = _FILE.fullmatch(file.removeprefix(_PREFIX) if file.startswith(_PREFIX) else file)
    if found is None:
        return None
    kind: Kind = "voice" if found[2] == "voice" else "photo"
    return MediaName(mark=found[1], kind=kind, ending=found[3]) if found[3] in TYPES[kind].values() else None


def named(mark: str, kind: Kind, content_type: str) -> MediaName:
    """By the media type that the sender gives. Raises BadMedia."""
    ending = TYPES[kind].get(content_type.partition(";")[0].strip().lower())
    if ending is None:
        raise BadMedia(f"A {_WHAT[kind]} is sent as one of {', '.join(TYPES[kind])}.")
    return MediaName(mark=mark, kind=kind, ending=ending)


def check(name: MediaName, data: bytes) -> None:
    """Check that the bytes are of the kind in the name, by their first ones. Raises BadMedia."""
    if not data:
        raise BadMedia(f"The {_WHAT[name.kind]} is empty.")
    if not _begins_as(name.media_type, data[:16]):
        raise BadMedia(f"This is no {name.media_type}: its first bytes are those of something else.")


def too_large(kind: Kind) -> str:
    """Why one that is larger is refused."""
    return f"A {_WHAT[kind]} of a mark has at most {MAX_BYTES[kind] // (1024 * 1024)} MB: this one is larger."


def find(folder: Path, mark: str, kind: Kind) -> Path | None:
    """The file of a mark in a folder; None: there is none."""
    names = (MediaName(mark=mark, kind=kind, ending=ending).file for ending in TYPES[kind].values())
    return next((folder / name for name in names if (folder / name).is_file()), None)


_WHAT: dict[Kind, str] = {"voice": "voice note", "photo": "photo"}


def _begins_as(media_type: str, head: bytes) -> bool:
    match media_type:
        case "audio/webm":
            return head.startswith(b"\x1a\x45\xdf\xa3")
        case "audio/ogg":
            return head.startswith(b"OggS")
        case "audio/mp4":
            return head[4:8] == b"ftyp"
        case "image/jpeg":
            return head.startswith(b"\xff\xd8\xff")
        case "image/png":
            return head.startswith(b"\x89PNG\r\n\x1a\n")
        case _:
            return head.startswith(b"RIFF") and head[8:12] == b"WEBP"

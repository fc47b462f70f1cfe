"""Title, note and tags of a recording, in a small file beside it, so that they survive the loss of the database."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import orjson

from server.storage import durable_file

MAX_TITLE = 120  # letters
MAX_NOTE = 4000
MAX_TAG = 40
MAX_TAGS = 20
MAX_BYTES = 256 * 1024  # of the file: a larger one is not ours
# Letters that turn the direction of what follows, that hide, or that end a line in one program and not in another.
_UNSEEN = frozenset("\u200b\u200e\u200f\u061c\ufeff\u2028\u2029\u00ad")
_TURNING = range(0x202A, 0x202F), range(0x2066, 0x206A)


class BadAnnotation(ValueError):
    """What was said cannot be kept; the text is one sentence for a person, `field` is what it is about."""

    def __init__(self, field: str, sentence: str) -> None:
        super().__init__(sentence)
        self.field = field


@dataclass(frozen=True, slots=True, kw_only=True)
class Annotations:
    """Of one recording; without any it is called by its time."""

    title: str = ""
    note: str = ""
    tags: tuple[str, ...] = ()


NONE = Annotations()


def beside(recording: Path) -> Path:
    """The file of a recording's annotations: copied with it, they go with it."""
    return recording.with_name(recording.name + ".json")


def read(recording: Path) -> Annotations:
    """Those beside a recording; none where there is no such file, or one that is not ours. Bounded and cleaned."""
    try:
        with beside(recording).open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
        body = orjson.loads(raw) if len(raw) <= MAX_BYTES else None
    except (OSError, orjson.JSONDecodeError):
        body = None
    if not isinstance(body, dict):
        return NONE
    tags = body.get("tags")
    return Annotations(
        title=line(body.get("title"))[:MAX_TITLE].strip(),
        note=text(body.get("note"))[:MAX_NOTE].strip(),
        tags=_unique([line(tag)[:MAX_TAG].strip() for tag in tags] if isinstance(tags, list) else [])[:MAX_TAGS],
    )


def write(recording: Path, annotations: Annotations) -> None:
    """Write them atomically; without any the file is deleted. Raises OSError."""
    path = beside(recording)
    if annotations == NONE:
        path.unlink(missing_ok=True)
        return
    if path.exists() and not _is_ours(path):  # somebody else's: it is not lost
        path.rename(path.with_name(f"{path.name}.other"))
    body = orjson.dumps(asdict(annotations), option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)
    durable_file.write(path, body, mode=0o644)


def changed(
    old: Annotations, *, title: str | None = None, note: str | None = None, tags: Sequence[str] | None = None
) -> Annotations:
    """With what is given in place of the old; None leaves it. Raises BadAnnotation."""
    return Annotations(
        title=old.title if title is None else _fitting("title", "A title", line(title), MAX_TITLE),
        note=old.note if note is None else _fitting("note", "A note", text(note), MAX_NOTE),
        tags=old.tags if tags is None else _tags(tags),
    )


def _tags(tags: Sequence[str]) -> tuple[str, ...]:
    found = _unique([_fitting("tags", "A tag", line(tag), MAX_TAG) for tag in tags])
    if len(found) > MAX_TAGS:
        raise BadAnnotation("tags", f"A recording has at most {MAX_TAGS} tags.")
    return found


def _fitting(field: str, what: str, words: str, most: int) -> str:
    if len(words) > most:
        raise BadAnnotation(field, f"{what} has at most {most} letters; this has {len(words)}.")
    return words


def _unique(tags: Sequence[str]) -> tuple[str, ...]:
    """Without empty ones, and each once, however its letters are written."""
    found: dict[str, str] = {}
    for tag in tags:
        if tag:
            found.setdefault(tag.casefold(), tag)
    return tuple(found.values())


def line(words: Any) -> str:
    """One line of printable characters, because a title must not change the text beside it."""
    return " ".join("".join(map(_seen, words)).split()) if isinstance(words, str) else ""


def text(words: Any) -> str:
    """In lines, else the same."""
    if not isinstance(words, str):
        return ""
    lines = words.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return "\n".join("".join(map(_seen, line_)).rstrip() for line_ in lines).strip()


def _seen(letter: str) -> str:
    if letter in _UNSEEN or any(ord(letter) in turning for turning in _TURNING):
        return ""
    return " " if unicodedata.category(letter) in ("Cc", "Cs", "Co", "Zl", "Zp") else letter


def _is_ours(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return isinstance(orjson.loads(file.read(MAX_BYTES)), dict)
    except (OSError, orjson.JSONDecodeError):
        return False

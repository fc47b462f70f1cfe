"""Title, weather, note and tags of a recording, and marks that came too late for it, in a small file beside it: they
survive the loss of the database. Voice notes and photos that came too late are in a folder beside it."""

from __future__ import annotations

import errno
import logging
import threading
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import orjson

from server.protocol.driving_state import InterventionDescription
from server.protocol.marks import DriveMark
from server.recording.marks import described as descriptions
from server.recording.marks import rows
from server.recording.marks.rows import MARK_ID, row_of
from server.storage import durable_file

MAX_TITLE = 120  # letters
MAX_WEATHER = 120
MAX_NOTE = 4000
MAX_TAG = 40
MAX_TAGS = 20
MAX_MARKS = 2500  # of people and of the car in one drive
_LETTER = 4  # bytes of UTF-8; what JSON writes longer is cleaned away
_ROW = 512  # bytes of a mark or a description besides its texts: names, numbers, ids, blanks
# Of the file: all that may be written fits, and a larger one is not ours.
MAX_BYTES = (
    _LETTER * (MAX_TITLE + MAX_WEATHER + MAX_NOTE + MAX_TAGS * (MAX_TAG + 4) + 100)
    + MAX_MARKS * (2 * _ROW + _LETTER * (rows.MOST_WORDS + rows.MOST_CATEGORY + rows.MOST_NAME))
    + descriptions.MOST
    * (_ROW + _LETTER * (descriptions.MOST_WORDS + descriptions.MOST_CATEGORY + descriptions.MOST_NAME))
)
CHANGING = threading.RLock()  # marks and descriptions come from different threads
# Letters that turn the direction of what follows, that hide, or that end a line in one program and not in another.
_UNSEEN = frozenset("\u200b\u200e\u200f\u061c\ufeff\u2028\u2029\u00ad")
_TURNING = range(0x202A, 0x202F), range(0x2066, 0x206A)

log = logging.getLogger("catgraph.recording")


class BadAnnotation(ValueError):
    """An annotation that cannot be kept; the text is one sentence for a person, `field` names the field."""

    def __init__(self, field: str, sentence: str) -> None:
        super().__init__(sentence)
        self.field = field


@dataclass(frozen=True, slots=True, kw_only=True)
class Annotations:
    """Of one recording; without any it is called by its time."""

    title: str = ""
    note: str = ""
    tags: tuple[str, ...] = ()
    weather: str = ""
    marks: tuple[DriveMark, ...] = ()  # that the recording does not have, or has otherwise
    removed: tuple[str, ...] = ()  # ids of marks that the recording has, and that were taken back
    described: tuple[InterventionDescription, ...] = ()  # of interventions, what the recording does not say


T = TypeVar("T")
NONE = Annotations()
LATE = ("marks", "removed", "described")  # came after the recording was complete


def joined(several: Sequence[Annotations]) -> Annotations:
    """Title, note, weather and tags of the parts of a drive, each text once."""
    return Annotations(
        title=next((one.title for one in several if one.title), ""),
        note="\n".join(dict.fromkeys(one.note for one in several if one.note)),
        weather="; ".join(dict.fromkeys(one.weather for one in several if one.weather)),
        tags=tuple(dict.fromkeys(tag for one in several for tag in one.tags)),
    )


def beside(recording: Path) -> Path:
    """The file of a recording's annotations: copied with it, they go with it."""
    return recording.with_name(recording.name + ".json")


def media_beside(recording: Path) -> Path:
    """The folder of voice notes and photos that the recording does not have."""
    return recording.with_name(recording.name + ".marks")


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
    tags, marks, removed = (body.get(name) for name in ("tags", "marks", "removed"))
    return Annotations(
        title=line(body.get("title"))[:MAX_TITLE].strip(),
        note=text(body.get("note"))[:MAX_NOTE].strip(),
        tags=_unique([line(tag)[:MAX_TAG].strip() for tag in tags] if isinstance(tags, list) else [])[:MAX_TAGS],
        weather=line(body.get("weather"))[:MAX_WEATHER].strip(),
        marks=marks_of(marks),
        removed=ids_of(removed),
        described=descriptions.listed(body.get("described")),
    )


def marks_of(listed: object) -> tuple[DriveMark, ...]:
    """The marks in a value of a file; what is none is left out."""
    found = [row_of(one) for one in listed[:MAX_MARKS] if isinstance(one, dict)] if isinstance(listed, list) else []
    return tuple(row for row in found if row is not None)


def ids_of(listed: object) -> tuple[str, ...]:
    """The ids of marks in a value of a file."""
    named = listed[:MAX_MARKS] if isinstance(listed, list) else []
    return tuple(one for one in named if isinstance(one, str) and MARK_ID.fullmatch(one))


def write(recording: Path, annotations: Annotations) -> Annotations:
    """Write title, note and tags atomically, and return them with the late entries that are there; without any the
    file is deleted. Raises OSError."""
    with CHANGING:
        there = read(recording)
        new = replace(annotations, marks=there.marks, removed=there.removed, described=there.described)
        _write(recording, new)
    return new


def write_marks(recording: Path, marks: Sequence[DriveMark], removed: Sequence[str]) -> bool:
    """As `write`, of the marks; False: they are there already. Raises OSError."""
    kept = _newest(recording, marks, MAX_MARKS, "marks", lambda row: row["marked_ms"])
    return _change(recording, marks=kept, removed=_newest(recording, removed, MAX_MARKS, "marks taken back"))


def write_described(recording: Path, described: Sequence[InterventionDescription]) -> bool:
    """As `write_marks`, of descriptions of interventions. Raises OSError."""
    what = "descriptions of interventions"
    kept = _newest(recording, described, descriptions.MOST, what, lambda row: row["described_ms"])
    return _change(recording, described=kept)


def _newest(
    recording: Path, entries: Sequence[T], most: int, what: str, at_ms: Callable[[T], int] | None = None
) -> tuple[T, ...]:
    """As many as are kept, in their order; without a moment the last ones."""
    if len(entries) <= most:
        return tuple(entries)
    log.warning("beside %s: %d %s, of which the newest %d are kept", recording.name, len(entries), what, most)
    kept = range(len(entries)) if at_ms is None else sorted(range(len(entries)), key=lambda n: at_ms(entries[n]))
    return tuple(entries[n] for n in sorted(kept[-most:]))


def _change(recording: Path, **late: Any) -> bool:
    with CHANGING:
        there = read(recording)
        new = replace(there, **late)
        if new == there:
            return False
        _write(recording, new)
    return True


def _write(recording: Path, annotations: Annotations) -> None:
    path = beside(recording)
    if annotations == NONE:
        path.unlink(missing_ok=True)
        return
    fields = {name: value for name, value in asdict(annotations).items() if value or name not in LATE}
    body = orjson.dumps(fields, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)
    if len(body) > MAX_BYTES:
        sentence = f"{len(body)} bytes of annotations are more than the {MAX_BYTES} that are kept beside a recording"
        raise OSError(errno.EFBIG, sentence, str(path))
    if path.exists() and not _is_ours(path):  # somebody else's: it is not lost
        path.rename(next(name for name in _others(path) if not name.exists()))
    durable_file.write(path, body, mode=0o644)


def _others(path: Path) -> Iterator[Path]:
    yield path.with_name(f"{path.name}.other")
    yield from (path.with_name(f"{path.name}.other-{number}") for number in count(2))


def changed(
    old: Annotations,
    *,
    title: str | None = None,
    note: str | None = None,
    tags: Sequence[str] | None = None,
    weather: str | None = None,
) -> Annotations:
    """With what is given in place of the old; None leaves it. Raises BadAnnotation."""
    return replace(
        old,
        title=old.title if title is None else _fitting("title", "A title", line(title), MAX_TITLE),
        note=old.note if note is None else _fitting("note", "A note", text(note), MAX_NOTE),
        tags=old.tags if tags is None else _tags(tags),
        weather=old.weather if weather is None else _fitting("weather", "The weather", line(weather), MAX_WEATHER),
    )


def _tags(tags: Sequence[str]) -> tuple[str, ...]:
    found = _unique([_fitting("tags", "A tag", line(tag), MAX_TAG) for tag in tags])
    if len(found) > MAX_TAGS:
        raise BadAnnotation("tags", f"A recording has at most {MAX_TAGS} tags.")
    return found


def _fitting(field: str, what: str, value: str, most: int) -> str:
    if len(value) > most:
        raise BadAnnotation(field, f"{what} has at most {most} letters; this has {len(value)}.")
    return value


def _unique(tags: Sequence[str]) -> tuple[str, ...]:
    """Without empty ones, and each once in any case of its letters."""
    found: dict[str, str] = {}
    for tag in tags:
        if tag:
            found.setdefault(tag.casefold(), tag)
    return tuple(found.values())


def line(value: Any) -> str:
    """One line of printable characters, because a title must not change the text beside it."""
    return " ".join("".join(map(_seen, value)).split()) if isinstance(value, str) else ""


def text(value: Any) -> str:
    """In lines, else the same."""
    if not isinstance(value, str):
        return ""
    lines = value.replace("\r\n", "\n").replace("\r", "\n").split("\n")
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

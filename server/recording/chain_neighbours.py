"""The chain from one recording to the next: each names the newest record of the one before it in its first record."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Metadata

from server.recording.folder import DAMAGED, FINISHED, WRITING, first_part, id_of, is_id, part_id, part_number
from server.recording.mcap.chain import CHAIN_OPCODE, RECORD_BYTES, Head, parsed, read_head
from server.recording.mcap.chunks import HEAD_BYTES, MAGIC
from server.recording.own import METADATA
from server.recording.verify import clock

MOST_WITHOUT = 20  # newer recordings that have no chain, before the search for one that has it is given up
MOST_NAMED = 20  # missing parts, in a sentence
MOST_PARTS = 10_000
MOST_NEIGHBOURS = 5_000  # files of a folder that are compared
_LONGEST_TEXT = 4 << 20  # bytes of a metadata record


def as_metadata(before: Head | None) -> dict[str, str]:
    """How a recording names the one before it."""
    if before is None:
        return {}
    return {"previous": before.id, "previous_record": str(before.number), "previous_head": before.digest}


def named(metadata: Mapping[str, str]) -> Head | None:
    """The recording that a recording's metadata names as the one before it; None: none, or not readable."""
    id, number, digest = (metadata.get(key, "") for key in ("previous", "previous_record", "previous_head"))
    if not is_id(id) or not number.isdecimal() or len(number) > 18:
        return None
    return Head(id=id, number=int(number), digest=digest)


def newest_head(path: Path) -> Head | None:
    """The newest record of the recording before the one that is to be written to `path`; None: there is none, or the
    disk does not say. Recording never waits for it."""
    id = id_of(path)
    start = re.match(r"(.*?)_\d", id)
    vehicle = start[0][:-1] if start is not None else ""
    try:
        ids = {id_of(each): each for each in _recordings(path.parent) if each.name.startswith(vehicle)}
    except OSError:
        return None
    older = sorted((each for each in ids if is_id(each) and _order(each) < _order(id)), key=_order, reverse=True)
    for each in older[:MOST_WITHOUT]:
        if (head := read_head(ids[each], each)) is not None:
            return head
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """A recording that is not there, and parts before it that are not there either."""

    id: str
    records: int  # of its chain, as the one behind it names them
    others: tuple[str, ...] = ()
    from_ns: int = 0  # the end of the newest one before them; 0: not known
    to_ns: int = 0  # the beginning of the one behind them; 0: not known

    is_damaged: bool = False  # its file is there, and nothing of it can be read

    @property
    def sentence(self) -> str:
        one = f"the recording before it, {self.id} ({self.records} records)"
        if self.is_damaged:
            return f"T{one[1:]}, cannot be read.{self.rest}"
        return f"Not in this folder: {', '.join([one, *self._listed])}{self._time}."

    @property
    def rest(self) -> str:
        """When what nothing can be read of was recorded, and which others are not there; begins with a space."""
        others = f" Not in this folder: {', '.join(self._listed)}." if self._listed else ""
        return f"{others}{f' R{self._time[3:-1]}.' if self._time else ''}"

    @property
    def _listed(self) -> list[str]:
        left = len(self.others) - MOST_NAMED
        return [*self.others[:MOST_NAMED], *([f"and {left} more"] if left > 0 else [])]

    @property
    def _time(self) -> str:
        """Within which all of them were recorded; begins with a space."""
        since, until = clock(self.from_ns), clock(self.to_ns)
        if since and until:
            return f" (recorded between {since} and {until} UTC)"
        return f" (recorded {f'after {since}' if since else f'before {until}'} UTC)" if since or until else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbours:
    """What the recordings beside a file say of it. Sentences; empty: nothing to object, or nothing to compare."""

    problems: tuple[str, ...] = ()
    missing: Missing | None = None  # the recording before it, where it is not there


class Beside:
    """The recordings in a folder, and `others`: where each is, and which one it names as the one before it."""

    def __init__(self, folder: Path, others: Iterable[Path] = ()) -> None:
        self.files = {id_of(each): each for each in [*others, *_siblings(folder)]}
        self.naming: dict[str, list[tuple[str, Head]]] = {}  # a recording → those that name it
        for id, each in self.files.items():
            if (head := named(read_first_metadata(each))) is not None:
                self.naming.setdefault(head.id, []).append((id, head))


def compare(path: Path, beside: Beside) -> Neighbours:
    """Compares a recording with the one that it names, and with those that name it."""
    problems, missing, own = [], None, id_of(path)
    before = named(read_first_metadata(path))
    if before is not None and before.id != own:
        place = beside.files.get(before.id)
        if place is None:
            missing = _missing(path, before, beside)
        elif _digest(place, before.number) != before.digest:
            problems.append(
                f"{before.id}, which it names as the recording before it, is not as it was when this one began."
            )
    for id, head in beside.naming.get(own, ()):
        if id != own and _digest(path, head.number) != head.digest:
            problems.append(f"It is not as it was when {id} began, which names it as the recording before it.")
    return Neighbours(problems=tuple(problems), missing=missing)


def _missing(path: Path, before: Head, beside: Beside) -> Missing:
    """What is known of the recording before a file that is not there."""
    older = sorted((id for id in beside.files if _order(id) < _order(before.id)), key=_order)
    heads = (read_head(beside.files[id], id) for id in reversed(older[-MOST_WITHOUT:]))
    newest = next((head for head in heads if head is not None), None)
    first = first_part(before.id)
    there = {part_number(id) for id in older if first_part(id) == first}
    others = [part_id(first, n) for n in range(1, min(part_number(before.id), MOST_PARTS)) if n not in there]
    begun = read_first_metadata(path).get("started_ms", "")
    return Missing(
        id=before.id,
        records=before.number,
        others=tuple(others),
        is_damaged=_is_there(path.absolute().with_name(before.id + DAMAGED)),
        from_ns=newest.at_ns if newest is not None else 0,
        to_ns=int(begun[:15]) * 1_000_000 if begun.isdecimal() else 0,
    )


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:
        return False


def destroyed(path: Path, beside: Beside) -> Neighbours:
    """What those that name a file say of it, where nothing of it can be read."""
    naming = [(id, head) for id, head in beside.naming.get(id_of(path), ()) if id != id_of(path)]
    return Neighbours(
        problems=tuple(
            f"{id} names it as the recording before it ({head.number} records): it is destroyed."
            f"{_missing(beside.files[id], head, beside).rest}"
            for id, head in naming
        )
    )


def next_behind(folder: Path, first: str) -> Path | None:
    """The first recording in a folder that began behind the session whose first part this is; None: there is none."""
    behind = {id_of(each): each for each in _siblings(folder)}
    later = [id for id in behind if _order(id) > _order(first) and first_part(id) != first]
    return behind[min(later, key=_order)] if later else None


def read_first_metadata(path: Path) -> dict[str, str]:
    """Our first metadata record, which is near the beginning. Empty: there is none, or it cannot be read."""
    try:
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                return {}
            for _ in range(3):  # the header, and this
                head = file.read(HEAD_BYTES)
                length = int.from_bytes(head[1:], "little")
                if len(head) < HEAD_BYTES or length > _LONGEST_TEXT:
                    return {}
                body = file.read(length)
                if head[0] == Opcode.METADATA:
                    note = Metadata.read(ReadDataStream(BytesIO(body)))
                    return dict(note.metadata) if note.name == METADATA else {}
    except Exception:  # damage makes the readers fail in every way there is
        return {}
    return {}


def _digest(path: Path, number: int) -> str | None:
    """The hash of a record of a file [hex]; None: the file has no such record."""
    head = read_head(path, "")
    if head is not None and head.number == number:
        return head.digest
    try:
        with path.open("rb") as file:
            return _find(file, number)
    except OSError:
        return None


def _find(file: IO[bytes], number: int) -> str | None:
    file.seek(len(MAGIC))
    while len(head := file.read(HEAD_BYTES)) == HEAD_BYTES:
        length = int.from_bytes(head[1:], "little")
        if head[0] == CHAIN_OPCODE and HEAD_BYTES + length == RECORD_BYTES:
            record = parsed(head + file.read(length))
            if record is not None and record.number == number:
                return record.digest.hex()
            continue
        if length >= 1 << 62:  # no file is so long, and no file can be read there
            return None
        file.seek(length, 1)
    return None


def _siblings(folder: Path) -> list[Path]:
    try:
        return sorted(_recordings(folder), reverse=True)[:MOST_NEIGHBOURS]
    except OSError:
        return []


def _recordings(folder: Path) -> Iterable[Path]:
    return (each for each in folder.iterdir() if each.name.endswith((FINISHED, WRITING)))


def _order(id: str) -> tuple[tuple[int, int | str], ...]:
    """By numbers as numbers: part 10 is behind part 9."""
    pieces = re.split(r"(\d+)", id)
    return tuple((1, int(piece)) if piece.isdecimal() else (0, piece) for piece in pieces)

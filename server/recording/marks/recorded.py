"""Reads the marks of a finished recording, its voice notes and photos, with what came after it was complete."""

from __future__ import annotations

import contextlib
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex

from server.protocol.driving_state import InterventionDescription
from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.marks import media
from server.recording.marks.media import Kind, MediaName
from server.recording.marks.rows import folded, merged
from server.recording.mcap.mcap_file import attachments_of, finished, own_entries
from server.recording.own import PREFIX
from server.recording.read.read import Recording

TOPIC = f"{PREFIX}marks"
MOST = 20_000  # entries; a file that holds more is not of our making
_HEAD_BYTES = 1 + 8  # of a record
_CRC_BYTES = 4
_MOST_AROUND = 4096  # bytes of an attachment's record besides its data: head, times, name, type and checksum


@dataclass(frozen=True, slots=True, kw_only=True)
class InFile:
    """What the file itself holds, of marks."""

    start_ms: float
    end_ms: float
    marks: Mapping[str, DriveMark]
    removed: frozenset[str]
    media: Mapping[MediaName, int]  # name → its size


NOTHING = InFile(start_ms=0.0, end_ms=0.0, marks={}, removed=frozenset(), media={})


def in_file(path: Path) -> InFile:
    """Of one file; nothing where it was never closed, or is none of ours. Raises OSError."""
    if path.is_dir():
        return NOTHING
    try:
        with contextlib.closing(finished(path)) as source, path.open("rb") as file:
            marks, removed = folded(islice(own_entries(source, TOPIC), MOST))
            named = ((media.name_of(index.name), index.data_size) for index in attachments_of(file))
            return InFile(
                start_ms=source.start_ns / 1e6,
                end_ms=source.end_ns / 1e6,
                marks=marks,
                removed=frozenset(removed),
                media={name: size for name, size in named if name is not None},
            )
    except OSError:
        raise
    except Exception:  # damage makes the readers fail in every way there is
        return NOTHING


def read_marks(path: Path, within: InFile | None = None) -> list[DriveMark]:
    """The marks of a recording, oldest first, each with its moment since the beginning. Raises OSError.

    `within`: what the file holds, where that was read already.
    """
    found = in_file(path) if within is None else within
    return with_late(found.marks.values(), [path], found.start_ms)


def with_late(rows: Iterable[DriveMark], paths: Iterable[Path], start_ms: float) -> list[DriveMark]:
    """Marks that files hold, with those that came after they were complete; oldest first, each with its moment since
    the beginning of the recording."""
    beside = [annotation_store.read(path) for path in paths]
    late, removed = [row for one in beside for row in one.marks], [id for one in beside for id in one.removed]
    return [
        {**row, "at_s": max(0.0, round((row["marked_ms"] - start_ms) / 1000, 3)), "late": row.get("late", False)}
        for row in merged(rows, late, removed)
    ]


def read_media(path: Path, mark: str, kind: Kind) -> tuple[MediaName, bytes] | None:
    """The voice note or the photo of a mark: that beside the recording, else the newest in it. Raises OSError."""
    late = media.find(annotation_store.media_beside(path), mark, kind)
    if late is not None and (name := media.name_of(late.name)) is not None:
        return name, late.read_bytes()
    return next(((name, data) for name, data in attached(path) if (name.mark, name.kind) == (mark, kind)), None)


def attached(path: Path) -> Iterator[tuple[MediaName, bytes]]:
    """The voice notes and photos in a file, the newest first, without damaged ones. Raises OSError."""
    if path.is_dir():
        return
    with path.open("rb") as file:
        try:
            indexes = attachments_of(file)
        except OSError:
            raise
        except Exception:  # damage makes the readers fail in every way there is
            return
        for index in reversed(indexes):
            name = media.name_of(index.name)
            if name is None or index.data_size > media.MAX_BYTES[name.kind]:
                continue
            data = _attachment(file, index)
            if data is not None:
                yield name, data


def _attachment(file: IO[bytes], index: AttachmentIndex) -> bytes | None:
    """The data of one attachment; None: it does not match its index. Raises OSError."""
    if not 0 <= index.length - index.data_size <= _MOST_AROUND:
        return None
    try:
        file.seek(index.offset)
        record = file.read(index.length)
        content = record[_HEAD_BYTES:]
        length = int.from_bytes(record[1:_HEAD_BYTES], "little")
        if record[:1] != bytes([Opcode.ATTACHMENT]) or length != len(content):
            return None
        crc = int.from_bytes(content[-_CRC_BYTES:], "little")
        if crc and zlib.crc32(content[:-_CRC_BYTES]) != crc:  # 0: its writer gave none
            return None
        found = Attachment.read(ReadDataStream(BytesIO(content)))
    except OSError:
        raise
    except Exception:
        return None
    return found.data if found.name == index.name and len(found.data) == index.data_size else None


def all_media(path: Path) -> Iterator[tuple[MediaName, bytes]]:
    """Each voice note and photo of a recording once: those beside it, and those in it. Raises OSError."""
    seen: set[tuple[str, Kind]] = set()
    for file in late_media(path):
        if (name := media.name_of(file.name)) is not None:
            seen.add((name.mark, name.kind))
            if file.stat().st_size <= media.MAX_BYTES[name.kind]:
                yield name, file.read_bytes()
    for name, data in attached(path):
        if (name.mark, name.kind) not in seen:
            seen.add((name.mark, name.kind))
            yield name, data


def late_media(path: Path) -> list[Path]:
    """The voice notes and photos beside a recording. Raises OSError."""
    folder = annotation_store.media_beside(path)
    found = sorted(folder.iterdir()) if folder.is_dir() else []
    return [file for file in found if media.name_of(file.name) is not None]


def marks_of(recording: Recording) -> list[DriveMark]:
    """Oldest first, late ones among them."""
    return with_late(in_recording(recording), files_of(recording), recording.start_s * 1000)


def in_recording(recording: Recording) -> list[DriveMark]:
    """Those that the recording itself holds. Raises RecordingUnreadable."""
    marks, _ = folded(row for _, row in islice(recording.own(TOPIC), MOST))
    return list(marks.values())


def media_of(recording: Recording) -> Iterator[tuple[MediaName, bytes]]:
    """The voice notes and photos of those marks."""
    marks = {row["mark"] for row in marks_of(recording)}
    for path in files_of(recording):
        with contextlib.suppress(OSError):
            yield from ((name, data) for name, data in all_media(path) if name.mark in marks)


def described_late(recording: Recording) -> list[InterventionDescription]:
    """The descriptions of its interventions after it was complete, oldest first."""
    rows = [row for path in files_of(recording) for row in annotation_store.read(path).described]
    return sorted(rows, key=lambda row: row["described_ms"])


def files_of(recording: Recording) -> Sequence[Path]:
    """Those of which it is, and before them the folder of a split bag: marks and descriptions can be beside each."""
    folders = [folder for path in recording.paths if path.is_dir() and (folder := path.absolute()).name]
    return [*folders, *(file.path for file in recording.files)]


def title_of(mark: DriveMark) -> str:
    """A short text for a map or a table."""
    return mark["category"] or (mark["words"][:60] if mark["words"] else "Mark")

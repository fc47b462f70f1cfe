"""Finds the files of a recording, recognizes each by its first bytes, and opens all that can be read; a sentence
describes each other one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import IO, Literal

import zstandard

from server.recording.mcap.mcap_file import McapFile
from server.recording.own import PREFIX
from server.recording.read import rosbag1_truncated
from server.recording.read.bag2_database import Bag2Database
from server.recording.read.bag2_metadata import NAME as METADATA
from server.recording.read.bag2_metadata import BagMetadata, is_latched, read_metadata
from server.recording.read.errors import NoRoom, RecordingUnreadable
from server.recording.read.rosbag1 import Bag1
from server.recording.read.source import FileSource
from server.recording.read.temporary_copy import TemporaryCopy
from server.recording.read.unpack import PACKED as _ZSTD
from server.recording.read.unpack import PartTooLarge

Kind = Literal["bag", "mcap", "db3"]
PACKED_SUFFIX = ".zstd"  # behind the ending of a file that is packed as a whole
_SUFFIXES = (".mcap", ".db3", ".bag")
_PART = re.compile(r"_\d+$")  # ends the name of each file of a split bag

_RECORDINGS: dict[bytes, Kind] = {b"#ROSBAG V2.": "bag", b"\x89MCAP0\r\n": "mcap", b"SQLite format 3\0": "db3"}
_OTHERS = {
    b"#ROSBAG V": "a ROS bag of an old format: convert it with `rosbag fix` first",
    b"#ROSRECORD": "a ROS bag of an old format: convert it with `rosbag fix` first",
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"GIF8": "a GIF picture",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a ZIP archive: unpack it first",
    b"PK\x05\x06": "an empty ZIP archive",
    b"\x1f\x8b": "packed with gzip: unpack it first",
    b"BZh": "packed with bzip2: unpack it first",
    b"\x28\xb5\x2f\xfd": "packed with zstd: unpack it first",
    b"\x04\x22\x4d\x18": "packed with lz4: unpack it first",
    b"\xfd7zXZ": "packed with xz: unpack it first",
    b"7z\xbc\xaf": "a 7z archive: unpack it first",
    b"Rar!": "a RAR archive: unpack it first",
    b"\x7fELF": "a program",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """One file of a recording."""

    path: Path
    kind: Kind
    is_packed: bool = False  # as a whole, with zstd, as rosbag2 does it once it is complete
    bag: BagMetadata | None = None  # of the bag in whose folder it is


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundRecording:
    """The files of one recording."""

    files: list[Found]
    lacking: list[str] = field(default_factory=list)  # parts that are missing or not readable, in sentences


def recognise(path: Path) -> FoundRecording:
    """The files of a path: itself, or those of a directory, which is one recording.

    Raises RecordingUnreadable where there are none.
    """
    try:
        if not path.exists():
            raise RecordingUnreadable(f"{path} does not exist")
        if not path.is_dir():
            return FoundRecording(files=[_found(path)])
        if (path / METADATA).exists():
            return _of_bag(path)
        inside = _files_in(path)
    except PermissionError:
        raise RecordingUnreadable(f"{path} may not be read by this user: permission denied") from None
    except OSError as error:
        raise RecordingUnreadable(f"{path} cannot be read: {error.strerror or error}") from None
    if not inside:
        raise RecordingUnreadable(f"{path} is a directory without a recording in it")
    kinds = {_plain(file.name).suffix for file in inside}
    if len(kinds) > 1 or (len(inside) > 1 and kinds == {".bag"}):
        names = ", ".join(file.name for file in inside[:4])
        raise RecordingUnreadable(f"{path} holds several recordings ({names}): name the one to read")
    return _parts(inside)


def _of_bag(folder: Path) -> FoundRecording:
    """The files that a bag's metadata name, and the parts that a recorder wrote after them without naming them."""
    bag = read_metadata(folder)
    there = {_plain(file.name): file for file in _files_in(folder)}
    named = {_plain(name) for name in bag.files}
    series = {_PART.sub("", plain.stem) for plain in named if _PART.search(plain.stem)}
    files = {plain: file for plain, file in there.items() if plain in named or _PART.sub("", plain.stem) in series}
    files.update({_plain(name): folder / name for name in bag.files if name and (folder / name).is_file()})
    missing = tuple(name for name in bag.files if _plain(name) not in files)
    if not files:
        raise RecordingUnreadable(
            f"{folder} is not complete: {', '.join(missing[:4]) or 'every file'} of its {METADATA} is missing"
        )
    found = _parts([file for _, file in sorted(files.items())])
    lacking = [_missing(missing, found.files[0].path.name)] if missing else []
    return FoundRecording(files=[replace(one, bag=bag) for one in found.files], lacking=[*found.lacking, *lacking])


def _parts(files: Sequence[Path]) -> FoundRecording:
    """Those that are recordings: a recorder that was killed can leave an empty one. Raises RecordingUnreadable where
    none is one."""
    found: list[Found] = []
    lacking: list[str] = []
    for file in files:
        try:
            found.append(_found(file))
        except RecordingUnreadable as why:
            if len(files) == 1:
                raise
            lacking.append(by_name(why, file))
    if not found:
        raise RecordingUnreadable(f"{files[0].parent} has no file that can be read: {lacking[0]}")
    return FoundRecording(files=found, lacking=lacking)


def by_name(why: Exception, file: Path) -> str:
    """A sentence on a file with its name in place of its path."""
    return str(why).replace(str(file), file.name)


def _missing(names: Sequence[str], beside: str) -> str:
    which = "is" if len(names) == 1 else "are" if len(names) <= 4 else f"and {len(names) - 4} more are"
    them = "it" if len(names) == 1 else "them"
    return f"{', '.join(names[:4])} {which} missing beside {beside}: {METADATA} names {them}"


def _files_in(folder: Path) -> list[Path]:
    """The recorded files in a folder; of one that is there packed and unpacked, the unpacked one."""
    inside = sorted(file for file in folder.iterdir() if _plain(file.name).suffix in _SUFFIXES)
    names = {file.name for file in inside}
    return [file for file in inside if not (file.suffix == PACKED_SUFFIX and file.stem in names)]


def _plain(name: str) -> PurePath:
    """A file's name without the ending of a packed one."""
    return PurePath(name.removesuffix(PACKED_SUFFIX))


def _found(path: Path) -> Found:
    if not path.is_file():  # a pipe would make us wait for ever
        raise RecordingUnreadable(f"{path} is not a regular file")
    try:
        with path.open("rb") as file:
            start = file.read(512)
            if start.startswith(_ZSTD):
                file.seek(0)
                kind = _kind(_first_unpacked(file))
                if kind in ("mcap", "db3"):  # rosbag packs no whole files
                    return Found(path=path, kind=kind, is_packed=True)
    except PermissionError:
        raise RecordingUnreadable(f"{path} may not be read by this user: permission denied") from None
    except OSError as error:
        raise RecordingUnreadable(f"{path} cannot be read: {error.strerror or error}") from None
    if not start:
        raise RecordingUnreadable(f"{path} is empty: it has 0 bytes")
    kind = _kind(start)
    if kind is None:
        raise RecordingUnreadable(f"{path} is not a recording: it is {_as_text(start)}")
    return Found(path=path, kind=kind)


def _kind(start: bytes) -> Kind | None:
    return next((kind for magic, kind in _RECORDINGS.items() if start.startswith(magic)), None)


def _first_unpacked(file: IO[bytes]) -> bytes:
    """The first bytes of what is packed; none where it is damaged."""
    try:
        return bytes(zstandard.ZstdDecompressor().stream_reader(file).read(16))
    except zstandard.ZstdError:
        return b""


def _as_text(start: bytes) -> str:
    for magic, text in _OTHERS.items():
        if start.startswith(magic):
            return text
    try:
        text = start.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(start) - 4:  # not merely a letter cut in two
            return "neither a ROS 1 bag nor an MCAP or db3 file"
        text = start[: error.start].decode("utf-8")
    if all(letter.isprintable() or letter.isspace() for letter in text):
        return "a text file"
    return "neither a ROS 1 bag nor an MCAP or db3 file"


def open_file(found: Found) -> FileSource:
    """The open file. Raises RecordingUnreadable, MemoryError, and whatever damage makes the readers raise."""
    path = found.path
    if found.kind == "bag":
        return rosbag1_truncated.CutBag1(path) if rosbag1_truncated.is_cut(path) else Bag1(path)
    copy = TemporaryCopy() if found.is_packed else None
    try:
        content, is_whole = copy.unpack(path) if copy is not None else (path, True)
        source: McapFile | Bag2Database
        if found.kind == "mcap":
            source = McapFile(path, content=content, copy=copy)
        elif is_whole:
            source = Bag2Database(path, content=content, copy=copy)
        else:
            raise RecordingUnreadable(f"{path} is not complete: it ends too early")
    except BaseException:
        if copy is not None:
            copy.close()
        raise
    if found.bag is not None:
        latched = {topic for topic, offered in found.bag.qos.items() if is_latched(offered)}
        source.is_listed = True
        source.distro = source.distro or found.bag.distro
        source.channels = [
            replace(channel, is_latched=True) if channel.topic in latched else channel for channel in source.channels
        ]
    return source


def of_car(source: FileSource) -> bool:
    """Whether it has messages beside catgraph's own."""
    return any(channel.count and not channel.topic.startswith(PREFIX) for channel in source.channels)


def open_with(named: Path, paths: Sequence[Path], sources: list[FileSource], lacking: list[str]) -> None:
    """As `open_parts` of each path, but of the files that can be read with `named`: the others are named in `lacking`.
    Raises RecordingUnreadable where none can be read."""
    opened: dict[Path, list[FileSource]] = {}
    whys: list[RecordingUnreadable] = []
    for path in paths:
        own: list[FileSource] = []
        try:
            open_parts(recognise(path), own, lacking)
        except NoRoom:
            raise
        except RecordingUnreadable as why:
            whys.append(why)
            lacking.append(by_name(why, path))
        finally:
            sources += own  # closed where this fails
        opened[path] = own
    if not sources:
        raise whys[0]
    versions = [one.ros_version for path in (named, *paths) for one in opened[path] if of_car(one)]
    for path, own in opened.items():
        if any(of_car(one) and one.ros_version != versions[0] for one in own):
            lacking.append(f"{path.name} is of another version of ROS and cannot be read with {named.name}")
            for one in own:
                one.close()
                sources.remove(one)


def open_parts(found: FoundRecording, sources: list[FileSource], lacking: list[str]) -> None:
    """Adds the files that can be opened, and sentences on the others. Raises RecordingUnreadable where none can."""
    opened: list[FileSource] = []
    why_not: list[str] = []
    for file in found.files:
        try:
            opened.append(_open(file))
            sources.append(opened[-1])
        except NoRoom:  # nothing is known of the file
            raise
        except RecordingUnreadable as why:
            if len(found.files) == 1 and not found.lacking:
                raise
            why_not.append(by_name(why, file.path))
    lacking += [*why_not, *found.lacking]
    if not opened:
        folder = found.files[0].path.parent
        raise RecordingUnreadable(f"{folder} has no file that can be read: {why_not[0]}")


def _open(found: Found) -> FileSource:
    try:
        return open_file(found)
    except (RecordingUnreadable, MemoryError):  # what is too large is not damaged
        raise
    except Exception as error:  # a damaged file makes the readers fail in every way there is
        raise RecordingUnreadable(what_is_wrong(found.path, error)) from None


# Messages of other readers for a missing end of a file, and thus a missing index.
_ENDS_EARLY = (
    "File end magic is invalid",
    "Header could not be read from file",
    "Truncated record",
    "Invalid MCAP footer",
)


def what_is_wrong(path: Path, error: Exception) -> str:
    if isinstance(error, PermissionError) or isinstance(error.__cause__, PermissionError):
        return f"{path} may not be read by this user: permission denied"
    reason = " ".join(str(error).split()).rstrip(".")
    if isinstance(error, PartTooLarge):
        return f"{path} cannot be read: of a part of it, {reason}"
    if any(text in reason for text in _ENDS_EARLY):
        return f"{path} is not complete: it ends too early"
    if not reason or len(reason) > 200 or isinstance(error, KeyError | AssertionError | TypeError | IndexError):
        return f"{path} is damaged or not complete"
    return f"{path} is damaged or not complete: {reason}"

"""Recognizes a file by its first bytes, and describes it if it is not a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from server.recording.read.errors import RecordingUnreadable

Kind = Literal["bag", "mcap", "db3", "directory"]

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


def recognise(path: Path) -> list[tuple[Path, Kind]]:
    """The recordings of a path: itself, or the content of a directory without metadata.

    Raises RecordingUnreadable where there are none.
    """
    try:
        if not path.exists():
            raise RecordingUnreadable(f"{path} does not exist")
        if not path.is_dir():
            return [(path, _kind(path))]
        if (path / "metadata.yaml").exists():
            return [(path, "directory")]
        inside = sorted(file for file in path.iterdir() if file.suffix in (".mcap", ".db3", ".bag"))
    except PermissionError:
        raise RecordingUnreadable(f"{path} may not be read by this user: permission denied") from None
    except OSError as error:
        raise RecordingUnreadable(f"{path} cannot be read: {error.strerror or error}") from None
    if not inside:
        raise RecordingUnreadable(f"{path} is a directory without a recording in it")
    found = [(file, _kind(file)) for file in inside]
    if len({file.suffix for file in inside}) > 1 or (len(inside) > 1 and inside[0].suffix == ".bag"):
        names = ", ".join(file.name for file in inside[:4])
        raise RecordingUnreadable(f"{path} holds several recordings ({names}): name the one to read")
    return found


def _kind(path: Path) -> Kind:
    if not path.is_file():  # a pipe would make us wait for ever
        raise RecordingUnreadable(f"{path} is not a regular file")
    try:
        with path.open("rb") as file:
            start = file.read(512)
    except PermissionError:
        raise RecordingUnreadable(f"{path} may not be read by this user: permission denied") from None
    except OSError as error:
        raise RecordingUnreadable(f"{path} cannot be read: {error.strerror or error}") from None
    if not start:
        raise RecordingUnreadable(f"{path} is empty: it has 0 bytes")
    for magic, kind in _RECORDINGS.items():
        if start.startswith(magic):
            return kind
    raise RecordingUnreadable(f"{path} is not a recording: it is {_in_words(start)}")


def _in_words(start: bytes) -> str:
    for magic, words in _OTHERS.items():
        if start.startswith(magic):
            return words
    try:
        text = start.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(start) - 4:  # not merely a letter cut in two
            return "neither a ROS 1 bag nor an MCAP or db3 file"
        text = start[: error.start].decode("utf-8")
    if all(letter.isprintable() or letter.isspace() for letter in text):
        return "a text file"
    return "neither a ROS 1 bag nor an MCAP or db3 file"

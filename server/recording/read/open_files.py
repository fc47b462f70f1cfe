"""Opens the files of a recording: all that can be read, and a sentence on each other one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from server.recording.own import PREFIX
from server.recording.read.errors import NoRoom, RecordingUnreadable
from server.recording.read.recognise import Found, FoundRecording, by_name, open_file, recognise
from server.recording.read.source import FileSource
from server.recording.read.unpack import PartTooLarge


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
    except Exception as error:  # as above
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

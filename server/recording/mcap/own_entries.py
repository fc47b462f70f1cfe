"""What catgraph itself wrote in one finished file, whichever tool wrote the file: entries of a channel, attachments."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import orjson
from mcap.reader import make_reader
from mcap.records import AttachmentIndex

from server.recording.mcap.mcap_file import McapFile, is_cut
from server.recording.mcap.scan import scan


def own_entries(source: McapFile, topic: str) -> Iterator[dict[str, Any]]:
    """The JSON objects of a channel in the order of time. Raises OSError."""
    numbers = {channel.number for channel in source.channels if channel.topic == topic}
    for _, _, raw in source.messages(numbers, 0) if numbers else ():
        with contextlib.suppress(orjson.JSONDecodeError):
            entry = orjson.loads(raw)
            if isinstance(entry, dict):
                yield entry


def finished(path: Path) -> McapFile:
    """The file, open. Raises ValueError where it was never closed, OSError, and whatever damage makes of it."""
    with path.open("rb") as file:
        if is_cut(file):  # before its index is made, for which all of it is unpacked
            raise ValueError(f"{path.name} was never closed")
    return McapFile(path)


def attachments_of(file: IO[bytes]) -> list[AttachmentIndex]:
    """Where each attachment of a file is. Raises OSError, and whatever damage makes the library raise."""
    summary = make_reader(file).get_summary()
    if summary is not None and summary.statistics is not None:
        if len(summary.attachment_indexes) == summary.statistics.attachment_count:
            return list(summary.attachment_indexes)
    return scan(file, with_messages=False).attachments

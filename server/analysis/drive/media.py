"""Voice notes and photos of a drive's marks, as data: URIs for a page that needs no other file."""

from __future__ import annotations

import base64
import contextlib
from collections.abc import Iterable
from pathlib import Path

from server.recording.marks.media import MediaName
from server.recording.marks.recorded import all_media

MOST_BYTES = 24_000_000  # of all together: a page of more is not sent by mail, nor opened by a phone


class Media:
    """Of one drive; what does not fit is counted in `left_out`."""

    def __init__(self) -> None:
        self.left_out = 0
        self._bytes = 0
        self._found: dict[tuple[str, str], str] = {}

    def get(self, mark: str, kind: str) -> str | None:
        """The data: URI of a mark's `voice` or `photo`."""
        return self._found.get((mark, kind))

    def add(self, name: MediaName, data: bytes) -> None:
        """The first of a mark counts."""
        if (name.mark, name.kind) in self._found:
            return
        if self._bytes + len(data) > MOST_BYTES:
            self.left_out += 1
            return
        self._bytes += len(data)
        self._found[name.mark, name.kind] = f"data:{name.media_type};base64,{base64.b64encode(data).decode()}"


def media_of(files: Iterable[Path]) -> Media:
    """The attachments of recordings and the files beside them; what cannot be read has none."""
    found = Media()
    for path in files:
        with contextlib.suppress(OSError):
            for name, data in all_media(path):
                found.add(name, data)
    return found

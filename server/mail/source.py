"""Where the recordings come from that are mailed: the catalog and the exports, as the mailer needs them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from server.recording.export.worker import Made


class Source(Protocol):
    """What the rest of the server gives to the mailer."""

    def path_of(self, recording: str) -> Path | None:
        """The finished recording of that name; None where there is none. May be called from any thread."""

    async def export(self, path: Path, format: str, into: Path, progress: Callable[[float], None]) -> Made:
        """Writes a recording in another format into the folder `into`. Progress is 0 to 1.

        Raises OSError, ValueError or RuntimeError with a sentence.
        """

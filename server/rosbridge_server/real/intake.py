"""The real bridge's reading of frames: what is no JSON stays in a buffer, and can leave the connection deaf."""

from __future__ import annotations

import json
from typing import Any

MOST_TRIES = 20_000  # pairs of brackets; the real bridge has no limit and tries for minutes


class ReaderEnded(Exception):
    """The real bridge's reading thread has ended: this connection does nothing more."""


class Intake:
    """One connection's buffer."""

    def __init__(self) -> None:
        self._buffer = ""
        self._before = ""

    def add(self, text: str) -> None:
        self._buffer += text

    def next(self) -> dict[str, Any] | None:
        """The operation in the buffer, empty if it is JSON without an op. Raises ReaderEnded."""
        try:
            found = json.loads(self._buffer)
            self._buffer = ""
        except (ValueError, RecursionError):
            found = self._search()
        if found is None or isinstance(found, dict):
            return found
        if isinstance(found, list | str) and "id" not in found and "op" not in found:
            return {}
        raise ReaderEnded(f"a {type(found).__name__} is no operation")

    def has_more(self) -> bool:
        """Whether data is left after an operation."""
        if not self._buffer or self._before == self._buffer:
            return False
        self._before = self._buffer
        return True

    def _search(self) -> Any:
        """The first object with an op, from any opening to any closing bracket; data before it is dropped."""
        closings = [at for at, letter in enumerate(self._buffer) if letter == "}"]
        tries = 0
        found: Any = None
        for start, letter in enumerate(self._buffer):
            if letter != "{":
                continue
            for end in closings:
                tries += 1
                if tries > MOST_TRIES:
                    return None
                try:
                    found = json.loads(self._buffer[start : end + 1])
                except (ValueError, RecursionError):
                    continue
                if isinstance(found, dict) and found.get("op") is not None:
                    self._buffer = self._buffer[end + 1 :]
                    break
            if found is not None:
                return found
        return None

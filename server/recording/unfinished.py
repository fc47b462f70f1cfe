"""Parts that a full disk left cut: they are made whole when there is room again."""

from __future__ import annotations

from pathlib import Path

from server.recording import recover

TRY_AGAIN_S = 10.0  # what could not be completed on a full disk is tried again so often


class UnfinishedParts:
    """Those of one recorder. Times are of a monotonic clock in seconds."""

    def __init__(self) -> None:
        self._due_s: dict[Path, float] = {}  # when each is tried next

    @property
    def wait_s(self) -> float | None:
        """How long to wait before `complete` is called; None: there is nothing to complete."""
        return TRY_AGAIN_S if self._due_s else None

    def add(self, path: Path, now_s: float) -> None:
        self._due_s[path] = now_s + TRY_AGAIN_S

    def complete(self, now_s: float) -> list[Path]:
        """Tries those that are due; returns the parts that are finished now."""
        finished: list[Path] = []
        for path, due_s in list(self._due_s.items()):
            if now_s >= due_s:
                done = recover.recover(path)
                if done.is_settled:
                    del self._due_s[path]
                    if done.path is not None:
                        finished.append(done.path)
                else:
                    self._due_s[path] = now_s + TRY_AGAIN_S
        return finished

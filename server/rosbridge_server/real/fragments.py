"""Puts together what clients send in fragments, as the real bridge does: in the order of their arrival."""

from __future__ import annotations

from typing import Any

MOST_MESSAGES = 64  # unfinished, for all clients together


class RealFragments:
    """The unfinished messages of all clients."""

    def __init__(self) -> None:
        self._unfinished: dict[object, dict[object, str]] = {}
        self._totals: dict[object, Any] = {}

    def add(self, operation: dict[str, Any]) -> str | None:
        """The whole text when this fragment was its last one. Fragments that do not fit are left out."""
        id, number, total = operation.get("id"), operation.get("num"), operation.get("total")
        data = operation.get("data")
        if id is None or number is None or total is None or data is None:
            return None
        if id not in self._unfinished:
            while len(self._unfinished) >= MOST_MESSAGES:
                self._forget(next(iter(self._unfinished)))
            self._unfinished[id], self._totals[id] = {}, total
        parts = self._unfinished[id]
        if number in parts or number > self._totals[id] or total != self._totals[id]:
            return None
        parts[number] = data
        if len(parts) != total or not all(at in parts for at in range(total)):
            return None
        self._forget(id)
        return "".join(parts.values())

    def _forget(self, id: object) -> None:
        del self._unfinished[id], self._totals[id]

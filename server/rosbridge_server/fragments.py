"""Puts together what a client sends in fragments, within bounds."""

from __future__ import annotations

from typing import Any

from server.rosbridge_server import fields
from server.rosbridge_server.fields import Refused

MOST_MESSAGES = 8  # incomplete, for one client
MOST_FRAGMENTS = 10_000


class Fragments:
    """The unfinished messages of one client. The oldest gives way when a ninth begins."""

    def __init__(self, *, limit_bytes: int) -> None:
        self._limit_bytes = limit_bytes
        self._unfinished: dict[object, dict[int, str]] = {}
        self._totals: dict[object, int] = {}
        self._sizes: dict[object, int] = {}

    def add(self, operation: dict[str, Any]) -> bytes | None:
        """The whole message when this fragment was its last one, else None. Raises Refused."""
        key = fields.id_of(operation)
        if key is None:
            raise Refused("a fragment needs an id")
        data = fields.text(operation, "data")
        number, total = fields.whole_number(operation, "num"), fields.whole_number(operation, "total")
        if not 1 <= total <= MOST_FRAGMENTS or number >= total:
            raise Refused(f"fragment {number} of {total} is invalid")
        if key not in self._unfinished:
            while len(self._unfinished) >= MOST_MESSAGES:
                self._forget(next(iter(self._unfinished)))
            self._unfinished[key], self._totals[key], self._sizes[key] = {}, total, 0
        parts = self._unfinished[key]
        if total != self._totals[key] or number in parts:
            self._forget(key)
            raise Refused(f"fragment {number} of {total} does not fit those before it")
        parts[number] = data
        self._sizes[key] += len(data)
        if sum(self._sizes.values()) > self._limit_bytes:
            self._forget(key)
            raise Refused(f"fragments of more than {self._limit_bytes} bytes are not kept")
        if len(parts) < total:
            return None
        self._forget(key)
        return "".join(parts[at] for at in range(total)).encode("utf-8", "replace")

    def _forget(self, key: object) -> None:
        for table in (self._unfinished, self._totals, self._sizes):
            table.pop(key, None)

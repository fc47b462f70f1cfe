"""Reads a client's operation: its fields, and fragments put together, within bounds; errors are one sentence."""

from __future__ import annotations

import json
from typing import Any

import orjson

LONGEST_ID = 1_000  # letters; an id is echoed in every answer, and the longest real ones have 60

MOST_MESSAGES = 8  # incomplete, for one client
MOST_FRAGMENTS = 10_000


class Refused(Exception):
    """The operation cannot be done. The text is one sentence for the client."""

    def __init__(self, text: str) -> None:
        super().__init__(text if len(text) <= 400 else text[:400] + "…")


def parse(raw: str | bytes) -> dict[str, Any]:
    """The JSON object of one frame or of reassembled fragments."""
    try:
        value = _loads(raw)
    except (ValueError, RecursionError) as error:
        raise Refused(f"this is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise Refused(f"expected a JSON object with an op, got {_kind(value)}")
    return value


def _loads(raw: str | bytes) -> Any:
    try:
        return orjson.loads(raw)
    except orjson.JSONDecodeError:
        return json.loads(raw)  # rosbridge reads with Python, which takes NaN, Infinity, 1e999 and lone surrogates


def id_of(operation: dict[str, Any]) -> str | int | float | None:
    """The client's id for this operation: text or number; anything else could not be echoed safely."""
    value = operation.get("id")
    if isinstance(value, bool) or not isinstance(value, str | int | float | None):
        raise Refused(f"the id must be text or a number, got {_kind(value)}")
    if isinstance(value, int) and abs(value) >= 2**63:
        raise Refused("the id must be text or a number of 64 bits")
    if isinstance(value, str) and len(value) > LONGEST_ID:
        raise Refused(f"the id has {len(value)} characters, at most {LONGEST_ID} are allowed")
    return value


def text(operation: dict[str, Any], name: str, default: str | None = None) -> str:
    """A field that must be text; without a default it must be there."""
    value = operation.get(name, default)
    if not isinstance(value, str):
        raise Refused(_complaint(operation, name, "text"))
    return value


def optional_text(operation: dict[str, Any], name: str) -> str | None:
    return None if operation.get(name) is None else text(operation, name)


def whole_number(operation: dict[str, Any], name: str, default: int | None = None) -> int:
    """A field that must be a number ≥ 0 (fractions are cut off); without a default it must be there."""
    value = operation.get(name, default)
    if value is None and default is not None:
        return default
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 2**53:
        raise Refused(_complaint(operation, name, "a number, 0 or more"))
    return int(value)


def _complaint(operation: dict[str, Any], name: str, expected: str) -> str:
    if name not in operation:
        return f"expected a field {name}, but there is none"
    return f"the field {name} must be {expected}, got {_kind(operation[name])}"


def _kind(value: Any) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case str():
            return "text"
        case int() | float():
            return f"the number {value}" if abs(value) < 1e15 else "a huge number"
        case list():
            return "a list"
        case _:
            return "an object"


class Fragments:
    """The unfinished messages of one client. The oldest gives way when a ninth begins."""

    def __init__(self, *, limit_bytes: int) -> None:
        self._limit_bytes = limit_bytes
        self._unfinished: dict[object, dict[int, str]] = {}
        self._totals: dict[object, int] = {}
        self._sizes: dict[object, int] = {}

    def add(self, operation: dict[str, Any]) -> bytes | None:
        """The whole message when this fragment was its last one, else None. Raises Refused."""
        key = id_of(operation)
        if key is None:
            raise Refused("a fragment needs an id")
        data = text(operation, "data")
        number, total = whole_number(operation, "num"), whole_number(operation, "total")
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

"""How much a message definition from outside may hold, found out before it is parsed and before code is made of it.

A short definition could take half a minute of a processor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rosbags.interfaces import Nodetype

from server.recording.read.errors import Undecodable

MAX_LINES = 3000  # that are neither blank nor comments; the longest of real cars have some hundreds
MAX_LINE = 4096  # letters
MAX_FIELDS = 10_000  # with those of all messages in it, as often as they stand in it
MAX_LETTERS = 256 * 1024


def bounded(text: str) -> str:
    """The definition without blank lines and lines of comment. Raises Undecodable where it holds too much."""
    if len(text) > 4 * MAX_LETTERS:
        raise Undecodable("its definition is too long")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) > MAX_LINES or any(len(line) > MAX_LINE for line in lines) or sum(map(len, lines)) > MAX_LETTERS:
        raise Undecodable("its definition is too long")
    return "\n".join(lines) + "\n"


def demand_few_fields(type: str, definitions: Mapping[str, Any]) -> None:
    """Raises Undecodable for a type whose messages, written out, have too many fields."""
    known: dict[str, int] = {}

    def count(name: str, depth: int) -> int:
        if name not in known:
            known[name] = 1  # recursion is reported by the code generator
            fields = definitions[name][1] if name in definitions and depth < 100 else ()
            known[name] = 1 + sum(count(inner, depth + 1) if (inner := _inner(what)) else 1 for _, what in fields)
        return known[name]

    if count(type, 0) > MAX_FIELDS:
        raise Undecodable("its definition has too many fields")


def _inner(what: Any) -> str | None:
    """The type of a field's messages; None: it has none."""
    kind, value = what
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        kind, value = value[0]
    return str(value) if kind == Nodetype.NAME else None

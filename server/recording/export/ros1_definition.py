"""The md5sum of a ROS 1 message type, computed from its definition as genmsg does.

Sources: genmsg's gentools (the text that is hashed: constants first, as written; then fields, nested types by their own
sum) and the form of full definitions, "gendeps --cat" (each nested type behind a line of = and one of `MSG: pkg/Type`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from server.recording.read.errors import Undecodable

_BUILTIN = frozenset(
    "bool byte char float32 float64 string time duration int8 int16 int32 int64 uint8 uint16 uint32 uint64".split()
)
_HEADER = "std_msgs/Header"
_DEEPEST = 32


def md5sum(type: str, definition: str) -> str:
    """Of "pkg/Type" with its full definition. Raises Undecodable where a nested type's definition is missing."""
    texts = _parts(type, definition)
    return _sum_of(type, texts, {}, 0)


def _parts(type: str, definition: str) -> dict[str, str]:
    """Type → its own text."""
    texts: dict[str, str] = {}
    name, lines = type, list[str]()
    for line in definition.splitlines():
        if line.startswith("=====") and not line.strip("= \t"):
            texts.setdefault(name, "\n".join(lines))
            name, lines = "", []
        elif not name and line.startswith("MSG:"):
            name = line[4:].strip()
        else:
            lines.append(line)
    texts.setdefault(name, "\n".join(lines))
    return texts


def _sum_of(type: str, texts: Mapping[str, str], known: dict[str, str], depth: int) -> str:
    found = known.get(type)
    if found is not None:
        return found
    if depth > _DEEPEST:
        raise Undecodable(f"the definition of {type} contains itself")
    if type not in texts:
        raise Undecodable(f"the definition of {type} is missing")
    constants: list[str] = []
    fields: list[str] = []
    for line in texts[type].splitlines():
        kind, _, rest = line.split("#", 1)[0].strip().partition(" ")
        rest = rest.strip()
        if not kind or not rest:
            continue
        if "=" in rest:
            constants.append(_constant(kind, line if kind == "string" else rest))
            continue
        base = kind.partition("[")[0]
        if base in _BUILTIN:
            fields.append(f"{kind} {rest}")
        else:
            fields.append(f"{_sum_of(_full(base, type, texts), texts, known, depth + 1)} {rest}")
    known[type] = hashlib.md5("\n".join((*constants, *fields)).strip().encode(), usedforsecurity=False).hexdigest()
    return known[type]


def _constant(kind: str, text: str) -> str:
    """A string constant is all that follows the sign, a # included."""
    name, _, value = text.partition("=")
    return f"{kind} {name.strip().removeprefix(f'{kind} ').strip()}={value.strip()}"


def _full(base: str, inside: str, texts: Mapping[str, str]) -> str:
    """The full name of a nested type in a field."""
    if "/" in base:
        return base
    if base == "Header":
        return _HEADER
    beside = f"{inside.partition('/')[0]}/{base}"
    if beside in texts:
        return beside
    return next((name for name in texts if name.endswith(f"/{base}")), beside)

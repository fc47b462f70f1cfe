"""TOML from outside, refused before it is parsed where parsing it could take long.

A small text can hold `tomllib` for minutes. Within the bounds below, the slowest text that is known takes 30 ms
(tests/server/security/test_toml.py), and the bounds themselves are counted in one pass.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

MAX_BYTES = 64 * 1024
MAX_LINE = 4096  # characters
MAX_PARTS = 8  # of a dotted key or heading; ours have three
MAX_NESTING = 8  # of arrays and inline tables in each other
MAX_ENTRIES = 2000  # keys, headings and elements; all settings together are some hundreds

# Possessive tokens, so that no text causes backtracking. A character that fits none is a token of its own.
# On what `tomllib` accepts it must agree with it about where a text ends, else a text could hide a name.
_TOKEN = re.compile(
    r'(?P<text>"""(?:[^"\\]|\\[\s\S]|"(?!""))*+(?:"{3,5}+|\Z)'  # two more quotes at its end belong to it
    r"|'''(?:[^']|'(?!''))*+(?:'{3,5}+|\Z)"
    r'|"(?:[^"\\\n]|\\.)*+"?|' + r"'[^'\n]*+'?)"
    r"|(?P<comment>\#[^\n]*+)|(?P<space>[ \t\r]++)|(?P<bare>[A-Za-z0-9_+:-]++)|(?P<line>\n++)|(?P<other>[\s\S])"
)


class BadToml(ValueError):
    """It is not TOML, or not within the bounds; `str()` is one sentence."""


def loads(text: str | bytes, *, max_bytes: int = MAX_BYTES, max_line: int = MAX_LINE) -> dict[str, Any]:
    """The table in a TOML text. Raises BadToml, and nothing else."""
    if isinstance(text, bytes):
        try:
            text = text[: max_bytes + 4].decode("utf-8", "strict" if len(text) <= max_bytes else "replace")
        except UnicodeDecodeError:
            raise BadToml("This is not UTF-8 text.") from None
    if len(text) > max_bytes or len(text.encode(errors="replace")) > max_bytes:
        raise BadToml(f"A TOML file has at most {max_bytes // 1024} kB.")
    if any(len(line) > max_line for line in text.split("\n")):
        raise BadToml(f"A line of TOML has at most {max_line} characters.")
    _demand_flat(text)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a ValueError too: a number of more than 4300 digits
        first = (str(error).splitlines() or [""])[0][:120]
        shown = "".join(letter if letter.isprintable() else "?" for letter in first)
        raise BadToml(f"This is not TOML: {shown}.") from None


def _demand_flat(text: str) -> None:
    """Count parts of dotted keys, nesting and entries. Raises BadToml."""
    parts = 1
    nesting = entries = 0
    for token in _TOKEN.finditer(text):
        match token.lastgroup:
            case "space" | "bare" | "text" | "comment":
                continue
        match token.group():
            case ".":
                parts += 1
                if parts > MAX_PARTS:
                    raise BadToml(f"A name in TOML has at most {MAX_PARTS} parts.")
                continue
            case "[" | "{":
                nesting += 1
                if nesting > MAX_NESTING:
                    raise BadToml(f"TOML arrays and tables nest at most {MAX_NESTING} deep.")
                entries += 1
            case "]" | "}":
                nesting = max(0, nesting - 1)
            case "=" | ",":
                entries += 1
        parts = 1
        if entries > MAX_ENTRIES:
            raise BadToml(f"A TOML file has at most {MAX_ENTRIES} entries.")

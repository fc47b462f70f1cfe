"""What is made from the declarations: docs/alarms.md, the tables of docs/protocol.md and the types of the page.

python -m server.protocol.reference --write  brings all of them up to date; without --write it names what is not.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from server.protocol import alarm_reference, tables, typescript
from server.protocol.shapes import definitions

TYPES = "static/js/core/protocol-types.d.ts"
HEAD = "// Made from server/protocol by `python -m server.protocol.reference --write`.\n\n"
ROOT = Path(__file__).resolve().parent.parent.parent


def _types(_: str) -> str:
    return HEAD + "\n".join(typescript.declarations(definitions()))


# Each file, and how it is made from what it holds now.
FILES: dict[str, Callable[[str], str]] = {
    "docs/alarms.md": lambda _: alarm_reference.text(),
    "docs/protocol.md": tables.filled,
    TYPES: _types,
}


def out_of_date(root: Path = ROOT) -> dict[Path, str]:
    """What each file would have to hold that does not hold it."""
    found: dict[Path, str] = {}
    for name, made in FILES.items():
        path = root / name
        now = path.read_text(encoding="utf-8") if path.exists() else ""
        if (text := made(now)) != now:
            found[path] = text
    return found


def main(arguments: list[str]) -> int:
    """Writes or names what is out of date."""
    stale = out_of_date()
    for path, text in stale.items():
        if "--write" in arguments:
            path.write_text(text, encoding="utf-8")
        print(path.relative_to(ROOT))
    return 1 if stale and "--write" not in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

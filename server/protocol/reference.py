"""What is made from the declarations: docs/alarms.md, the tables of docs/protocol.md and the types of the page.

`python -m server.protocol.reference` lists those that are out of date; with --write it writes them.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from textwrap import indent
from typing import Any

from server.protocol import alarm_reference, tables
from server.protocol.tables import definitions

Schema = Mapping[str, Any]
_PLAIN = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}
_GENERIC = re.compile(r"(\w+?)_(\w+)_")  # SignalState_SpeedValue_ is SignalState<SpeedValue>

TYPES = "static/js/core/protocol-types.d.ts"
HEAD = "// Made from server/protocol by `python -m server.protocol.reference --write`.\n\n"
ROOT = Path(__file__).resolve().parent.parent.parent


def declarations(definitions: Mapping[str, Schema]) -> Iterator[str]:
    """One exported declaration for each definition, by name; one for all uses of a generic type."""
    generics = {found[1]: found for found in map(_GENERIC.fullmatch, definitions) if found is not None}
    for name, schema in sorted(definitions.items()):
        if (generic := generics.get(name)) is not None:
            declared = _declaration(f"{name}<Value>", definitions[generic[0]])
            yield declared.replace(generic[2], "Value")
        elif not _GENERIC.fullmatch(name):
            yield _declaration(name, schema)


def _declaration(name: str, schema: Schema) -> str:
    comment = _comment(schema.get("description"))
    if "properties" not in schema:
        return f"{comment}export type {name} = {_type(schema)};\n"
    required = schema.get("required", ())
    fields = "".join(
        f"{_comment(field.get('description'))}{name}{'' if name in required else '?'}: {_type(field)};\n"
        for name, field in schema["properties"].items()
    )
    return f"{comment}export interface {name} {{\n{indent(fields, '  ')}}}\n"


def _comment(text: str | None) -> str:
    return f"/** {' '.join(text.split())} */\n" if text else ""


def _type(schema: Schema) -> str:
    """The TypeScript type of a schema."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return _GENERIC.sub(r"\1<\2>", name)
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(one) for one in schema["enum"])
    if any_of := schema.get("anyOf") or schema.get("oneOf"):
        return " | ".join(dict.fromkeys(_type(one) for one in any_of))
    match schema.get("type"):
        case "array" if "prefixItems" in schema:
            return f"[{', '.join(_type(one) for one in schema['prefixItems'])}]"
        case "array":
            return f"Array<{_type(schema['items'])}>"
        case "object":
            values = schema.get("additionalProperties")
            return f"Record<string, {_type(values) if isinstance(values, Mapping) else 'any'}>"
        case None:
            return "any"
        case kind:
            return _PLAIN[kind]


def _types(_: str) -> str:
    return HEAD + "\n".join(declarations(definitions()))


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

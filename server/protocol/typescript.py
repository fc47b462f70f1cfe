"""Types of the protocol as TypeScript declarations, made from their JSON schemas."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from textwrap import indent
from typing import Any

Schema = Mapping[str, Any]
_PLAIN = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}
_GENERIC = re.compile(r"(\w+?)_(\w+)_")  # SignalState_SpeedValue_ is SignalState<SpeedValue>


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

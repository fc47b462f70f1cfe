"""The named types of the protocol as JSON schema, and the tables of docs/protocol.md made from them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any, Literal, get_args

import orjson
from pydantic import TypeAdapter

from monitor.signals import SIGNALS
from server.protocol import commands
from server.protocol.answers import Answers
from server.protocol.command_base import OF_PAGE, Prompt
from server.protocol.commands import BY_KIND
from server.protocol.messages import Message
from server.protocol.page_messages import PageMessage, ReplayOrder
from server.protocol.signal_state import SignalState

COMMAND = "Command"  # ends the names of commands here: `Record` and `Set` have another meaning in TypeScript

_BLOCK = re.compile(r"(<!-- (types|signals|commands|replay): ([^>]*?)-->\n).*?(<!-- end -->)", re.DOTALL)


@cache
def definitions() -> Mapping[str, Any]:
    """The JSON schema of each named type, by its name."""
    return {
        **_named("SignalState", SignalState, "serialization"),
        **_named("Message", Message, "serialization"),
        **_named("PageMessage", PageMessage, "validation"),
        **_named("Answers", Answers, "serialization"),
    }


def command_name(command: type[commands.Command]) -> str:
    return f"{command.__name__}{COMMAND}"


def _named(name: str, shape: Any, mode: Literal["serialization", "validation"]) -> dict[str, Any]:
    """A type and all that it is made of."""
    schema = TypeAdapter(shape).json_schema(mode=mode)
    parts: dict[str, Any] = schema.pop("$defs", {})
    # Only what a page sends names commands: a type of what the server sends may be called as one of them.
    ordered = {one.__name__ for one in commands.BY_KIND.values()} & parts.keys() if shape is PageMessage else set()
    found = {name: schema, **{f"{part}{COMMAND}" if part in ordered else part: of for part, of in parts.items()}}
    if not ordered:
        return found
    text = re.sub(rf'"#/\$defs/({"|".join(ordered)})"', rf'"#/$defs/\1{COMMAND}"', orjson.dumps(found).decode())
    renamed: dict[str, Any] = orjson.loads(text)
    return renamed


def filled(page: str) -> str:
    """The page with each of its blocks generated again."""
    made: dict[str, Callable[[list[str]], Iterator[str]]] = {
        "types": _types,
        "signals": _signals,
        "commands": _commands,
        "replay": _replay,
    }

    def block(found: re.Match[str]) -> str:
        return "\n".join([found[1].rstrip(), *made[found[2]](found[3].split()), "", found[4]])

    return _BLOCK.sub(block, page)


def _types(names: list[str]) -> Iterator[str]:
    for name in names:
        schema = definitions()[name]
        yield ""
        yield f"**{name}**{': ' + _line(schema['description']) if 'description' in schema else ''}"
        yield ""
        yield "| field | type | |"
        yield "|---|---|---|"
        required = schema.get("required", ())
        for field, of in schema["properties"].items():
            left_out = "" if field in required else " (may be left out)"
            yield f"| {field} | {_type(of)}{left_out} | {_line(of.get('description', ''))} |"


def _signals(_: list[str]) -> Iterator[str]:
    """The fields of each signal's value."""
    yield ""
    yield "| signal | headline | field of `value` | type | |"
    yield "|---|---|---|---|---|"
    for signal, state in definitions()["Signals"]["properties"].items():
        value = definitions()[_name(state)]["properties"]["value"]["anyOf"][0]
        first = f"{signal} | {SIGNALS[signal].headline or '–'}"
        for field, of in definitions()[_name(value)]["properties"].items():
            yield f"| {first} | {field} | {_type(of)} | {_line(of.get('description', ''))} |"
            first = " | "


def _commands(_: list[str]) -> Iterator[str]:
    """What may be ordered, by whom, where over HTTP, and how long it may have been on its way."""
    yield ""
    yield "| kind | fields | who may | over HTTP | in time | |"
    yield "|---|---|---|---|---|---|"
    for kind, command in BY_KIND.items():
        schema = definitions()[command_name(command)]
        who = "who is in control" if command.needs == "control" else "any operator"
        http = f"`POST {command.path or f'/api/{kind}'}`" if command.http else ""
        in_s = f"{command.acts_within_s:g} s" if issubclass(command, Prompt) else ""
        yield f"| {kind} | {_fields(schema)} | {who} | {http} | {in_s} | {_line(schema['description'])} |"


def _replay(_: list[str]) -> Iterator[str]:
    """What may be ordered of the page's replay."""
    yield ""
    yield "| do | fields | |"
    yield "|---|---|---|"
    for order in get_args(ReplayOrder):
        schema = definitions()[order.__name__]
        yield f"| {schema['properties']['do']['const']} | {_fields(schema)} | {_line(schema['description'])} |"


def _fields(schema: Mapping[str, Any]) -> str:
    """The fields of an order, but for those of every order and of every one that must come in time."""
    fields = []
    for name, of in schema["properties"].items():
        if name in (*OF_PAGE, "id", "kind", "do") and not (name == "do" and "enum" in of):
            continue
        most = f" ≤ {of['maximum']:g}" if of.get("maximum", math.inf) < 1000 else ""
        left_out = "" if name in schema.get("required", ()) else ", may be left out"
        about = f": {of['description']}" if "description" in of else ""
        fields.append(_line(f"**{name}** ({_type(of)}{most}{left_out}){about}"))
    return "; ".join(fields)


def _name(schema: Mapping[str, Any]) -> str:
    name: str = schema["$ref"].rpartition("/")[2]
    return name


def _line(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _type(schema: Mapping[str, Any]) -> str:
    """A type as a person reads it; the names of small types are replaced by what they are."""
    if "$ref" in schema:
        name = _name(schema)
        return name.partition("_")[0] if "properties" in definitions()[name] else _type(definitions()[name])
    if "const" in schema or "enum" in schema:
        return " · ".join(f"`{one}`" for one in schema.get("enum", [schema.get("const")]))
    if any_of := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(dict.fromkeys(_type(one) for one in any_of))
    match schema.get("type"):
        case "array" if "prefixItems" in schema:
            return f"[{', '.join(_type(one) for one in schema['prefixItems'])}]"
        case "array":
            return f"list of {_type(schema['items'])}"
        case "object":
            values = schema.get("additionalProperties")
            return f"name → {_type(values) if isinstance(values, Mapping) else 'any'}"
        case None:
            return "any"
        case kind:
            return "number" if kind == "integer" else str(kind)

"""Every named type of the protocol as JSON schema: the page's types and the tables of docs/protocol.md follow."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import Any, Literal

import orjson
from pydantic import TypeAdapter

from server.protocol import commands
from server.protocol.answers import Answers
from server.protocol.messages import Message
from server.protocol.page_messages import PageMessage
from server.protocol.signal_state import SignalState

COMMAND = "Command"  # ends the names of commands here: `Record` and `Set` have another meaning in TypeScript


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

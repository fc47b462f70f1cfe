"""catgraph's own channels in a recording: alarms, commands, settings and orders, as JSON."""

from __future__ import annotations

from typing import Any, Literal

import orjson

from server.recording.read.schemas import Schema

PREFIX = "/catgraph/"
LIBRARY = "catgraph"  # prefix of the library name in the header of our files
METADATA = "catgraph"  # the name of the metadata record with vehicle and recording

Own = Literal["alarms", "phone", "operator", "settings", "link", "commands", "delay"]

_TEXT: dict[str, Any] = {"type": "string"}
_MAYBE_TEXT: dict[str, Any] = {"type": ["string", "null"]}
_WHOLE: dict[str, Any] = {"type": "integer"}

# channel → (what it is, fields); each has time_ms besides, and may have more fields than these
_CHANNELS: dict[Own, tuple[str, dict[str, Any]]] = {
    "alarms": (
        "Every numbered event of the log: alarms, and events of the monitoring itself.",
        {"n": _WHOLE, "at_ms": _WHOLE, "alarm": _MAYBE_TEXT, "change": _TEXT, "text": _MAYBE_TEXT, "by": _MAYBE_TEXT},
    ),
    "phone": (
        "The position reported by an operator's phone (WGS84), or the reason for none.",
        {"phone": _TEXT, "by": _MAYBE_TEXT, "handheld": {"type": "boolean"}, "why": _MAYBE_TEXT, "fix": {}},
    ),
    "operator": (
        "A command of an operator, and its result.",
        {"kind": _TEXT, "by": _MAYBE_TEXT, "ok": {"type": "boolean"}, "reason": _MAYBE_TEXT},
    ),
    "settings": (
        "All settings in force: as the TOML of Settings, and each threshold in SI.",
        {"version": _WHOLE, "profile": _TEXT, "toml": _TEXT, "in_force": {"type": "object"}},
    ),
    "link": (
        "The link to the car whenever it changed, and what is recorded of its topics.",
        {"phase": _TEXT, "address": _MAYBE_TEXT, "problem": _MAYBE_TEXT, "ros_version": {"type": ["integer", "null"]}},
    ),
    "delay": (
        "The delay of the link where it changed: of each topic's newest message, in seconds, and of the link.",
        {"late_s": {"type": ["number", "null"]}, "delays": {"type": "object"}},
    ),
    "commands": (
        "Frames sent to the car, unchanged.",
        {"topic": _TEXT, "type": _MAYBE_TEXT, "message": {"type": "object"}, "by": _MAYBE_TEXT},
    ),
}


def own_schema(channel: Own) -> Schema:
    what, fields = _CHANNELS[channel]
    described = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"catgraph.{channel}",
        "description": what,
        "type": "object",
        "properties": {"time_ms": {"type": "number", "description": "time of day, ms since 1970"}} | fields,
        "required": ["time_ms"],
    }
    return Schema(
        name=f"catgraph.{channel}",
        encoding="jsonschema",
        data=orjson.dumps(described),
        message_encoding="json",
        encode=None,
    )

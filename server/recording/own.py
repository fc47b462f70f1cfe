"""catgraph's own channels in a recording: alarms, commands, settings, orders and marks, as JSON."""

from __future__ import annotations

from typing import Any, Literal

import orjson

from server.recording.read.schemas import Schema

PREFIX = "/catgraph/"
LIBRARY = "catgraph"  # prefix of the library name in the header of our files
METADATA = "catgraph"  # the name of the metadata record with vehicle and recording

Own = Literal["alarms", "phone", "operator", "settings", "link", "commands", "delay", "marks"]

_TEXT: dict[str, Any] = {"type": "string"}
_MAYBE_TEXT: dict[str, Any] = {"type": ["string", "null"]}
_WHOLE: dict[str, Any] = {"type": "integer"}
_YES_NO: dict[str, Any] = {"type": "boolean"}
_TIME: dict[str, Any] = {"type": "object", "title": "time", "properties": {"sec": _WHOLE, "nsec": _WHOLE}}
_NAMES: dict[Own, str] = {"marks": "foxglove.Log"}  # which viewers show as lines of a log; the others are ours

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
    "marks": (
        "A moment that somebody marked, whole again at each change; the newest of an id holds.",
        {"timestamp": _TIME, "level": _WHOLE, "message": _TEXT, "name": _TEXT, "file": _TEXT, "line": _WHOLE}
        | {"change": _TEXT, "mark": _TEXT, "marked_ms": _WHOLE, "category": _MAYBE_TEXT, "words": _TEXT}
        | {"voice": _YES_NO, "photo": _YES_NO, "source": _TEXT, "by": _MAYBE_TEXT},
    ),
}


def own_schema(channel: Own) -> Schema:
    what, fields = _CHANNELS[channel]
    name = _NAMES.get(channel, f"catgraph.{channel}")
    described = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": name,
        "description": what,
        "type": "object",
        "properties": {"time_ms": {"type": "number", "description": "time of day, ms since 1970"}} | fields,
        "required": ["time_ms"],
    }
    return Schema(
        name=name,
        encoding="jsonschema",
        data=orjson.dumps(described),
        message_encoding="json",
        encode=None,
    )

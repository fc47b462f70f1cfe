"""The car's own diagnostics."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from typing import Any

from monitor.values import Component, Diagnostics
from server.judge.message_fields import Rejected, text
from server.judge.topic import Topic

MAX_COMPONENTS = 500


def diagnostics(message: Any) -> Diagnostics:
    rows = message.get("status") if isinstance(message, Mapping) else None
    if not isinstance(rows, (list, tuple)):
        raise Rejected("status is not a list")
    if len(rows) > MAX_COMPONENTS:
        raise Rejected(f"more than {MAX_COMPONENTS} components")
    return Diagnostics(
        components=tuple(
            Component(name=text(row, "name", default="unnamed"), level=_level(row), message=text(row, "message"))
            for row in rows
        )
    )


def _level(row: Any) -> int:
    """0 OK, 1 WARN, 2 ERROR, 3 STALE; a `byte` comes as an integer, as base64 or as a character, by version."""
    value = row.get("level") if isinstance(row, Mapping) else None
    if isinstance(value, str):
        if len(value) == 4:
            try:
                raw = base64.b64decode(value, validate=True)
            except (binascii.Error, ValueError):
                raw = b""
            value = raw[0] if len(raw) == 1 else None
        elif len(value) == 1:
            value = int(value) if value in "0123" else ord(value)
    elif isinstance(value, (bytes, bytearray)) and len(value) == 1:
        value = value[0]
    elif isinstance(value, (list, tuple)) and len(value) == 1:
        value = value[0]
    if type(value) is not int or value not in (0, 1, 2, 3):
        raise Rejected("level is not one of OK, WARN, ERROR, STALE")
    return value


TOPICS = (
    Topic(
        signal="diagnostics",
        names=("/diagnostics",),
        types={"diagnostic_msgs/DiagnosticArray": diagnostics},
        by_type=("diagnostic_msgs/DiagnosticArray",),
    ),
)

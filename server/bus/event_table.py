"""Events of the alarm log as rows of a table, for people and their spreadsheets."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import orjson

from server.system.clean_text import clean

COLUMNS = (
    *("n", "time", "change", "alarm", "occurrence", "title", "priority", "state", "text", "by"),
    *("measured", "limit", "unit", "causes", "settings_version", "details"),
)
_NOT_DETAILS = frozenset((*COLUMNS, "at_ms", "place", "sound", "announces"))  # the rest is in `details`, as JSON
# A spreadsheet runs a cell that begins so; some take the wide letters for the same.
_FORMULA = ("=", "+", "-", "@", "|", "\uff1d", "\uff0b", "\uff0d", "\uff20")


def event_row(event: Mapping[str, Any]) -> list[Any]:
    """The columns of one event: its values as numbers, everything else as JSON."""
    measured, limit = event.get("measured") or {}, event.get("limit") or {}
    details = {name: value for name, value in event.items() if name not in _NOT_DETAILS and value not in (None, [])}
    row = {
        **event,
        "time": datetime.fromtimestamp(event["at_ms"] / 1000, UTC).isoformat(timespec="milliseconds"),
        "measured": measured.get("value"),
        "limit": limit.get("value"),
        "unit": measured.get("unit") or limit.get("unit"),
        "causes": "; ".join(event.get("causes") or ()),
        "details": orjson.dumps(details).decode() if details else None,
    }
    return [safe_cell(row.get(column)) for column in COLUMNS]


def safe_cell(value: Any) -> Any:
    """A text that no spreadsheet takes for a formula; numbers as they are."""
    if not isinstance(value, str):
        return value
    seen = clean(value, 1 << 20)  # an older version may have logged it as it came
    return f"'{seen}" if seen.lstrip().startswith(_FORMULA) else seen

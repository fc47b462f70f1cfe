"""Spans of time as text."""

from __future__ import annotations

_UNITS = ((31_557_600, "year", "years"), (86_400, "day", "days"), (3600, "h", "h"), (60, "min", "min"), (1, "s", "s"))


def span(seconds: float) -> str:
    """A span of time in the unit a person would name it in, as "230 days" or "2.5 min"."""
    size, one, many = next((unit for unit in _UNITS if seconds >= 2 * unit[0]), _UNITS[-1])
    count = f"{seconds / size:.1f}".removesuffix(".0")
    return f"{count} {one if count == '1' else many}"

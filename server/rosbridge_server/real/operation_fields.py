"""Which fields an operation must and may have at a real bridge, and of which types."""

from __future__ import annotations

from typing import Any

TOPIC = (True, "topic", str)
SUBSCRIBE = (
    TOPIC, (False, "type", str), (False, "throttle_rate", int), (False, "fragment_size", int),
    (False, "queue_length", int), (False, "compression", str),
)  # fmt: skip
ADVERTISE = (TOPIC, (True, "type", str))
CALL = ((True, "service", str), (False, "fragment_size", (int, type(None))), (False, "compression", str))


class Wrong(Exception):
    """An operation that the real bridge refuses in its own log."""


def check(operation: dict[str, Any], wanted: tuple[tuple[bool, str, Any], ...]) -> None:
    """Raises Wrong where a field is missing or of another type."""
    for is_needed, name, kinds in wanted:
        if name not in operation:
            if is_needed:
                raise Wrong(f"Expected a {name} field but none was found.")
        elif not isinstance(operation[name], kinds):
            raise Wrong(f"Expected field {name} to be one of {kinds}. Invalid value: {operation[name]}")

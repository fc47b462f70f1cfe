"""A row of the table of subscriptions, and the operations that follow from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Subscription:
    """One row of the subscription table; `type` None leaves it to the bridge to know."""

    topic: str
    type: str | None
    compression: str = "none"  # or "cbor"
    throttle_ms: int = 0
    queue_length: int = 0

    def is_like(self, other: Subscription) -> bool:
        """The same but for how often: the bridge takes that over without an end and a beginning."""
        return (self.topic, self.type, self.compression) == (other.topic, other.type, other.compression)


def operation_of(operation: str, row: Subscription) -> dict[str, Any]:
    # The same id at both ends: unsubscribing names the subscription.
    message: dict[str, Any] = {"op": operation, "id": f"subscribe:{row.topic}", "topic": row.topic}
    if operation == "subscribe":
        if row.type is not None:
            message["type"] = row.type
        message |= {
            "compression": row.compression,
            # Never zero with a queue: ROS 2's rosbridge could take no connection any more once we have gone.
            "throttle_rate": max(row.throttle_ms, 1 if row.queue_length else 0),
            "queue_length": row.queue_length,
        }
    return message

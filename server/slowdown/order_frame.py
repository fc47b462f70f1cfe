"""The order of a state frame's `decelerate` (docs/protocol.md)."""

from __future__ import annotations

from typing import Any

from server.protocol import serialize
from server.slowdown.order import Order


def order_frame(
    order: Order, now_s: float, wall_ms: int, *, is_response_missing: bool, longest_s: float
) -> dict[str, Any]:
    """`wall_ms`: the time of day at `now_s`, by which moments of the session's clock are told to pages."""

    def at_ms(moment_s: float | None) -> int | None:
        return None if moment_s is None else round(wall_ms - (now_s - moment_s) * 1000)

    return {
        "number": order.number,
        "by": order.by,
        "why": order.why,
        "for_s": serialize.plain(now_s - order.ordered_s, 1),
        "from_mps": serialize.plain(order.from_mps, 2),
        "ordered_mps": serialize.plain(order.last.speed_mps, 2) if order.last else None,
        "deceleration_mps2": serialize.plain(order.deceleration_mps2, 2),
        "sending": order.sending_s is not None,
        "confirmed": False if is_response_missing else True if order.slows_s is not None else None,
        "stands": order.stands,
        "steps": {
            "pressed_ms": at_ms(order.pressed_s),
            "server_ms": at_ms(order.ordered_s),
            "bridge_ms": at_ms(order.first_sent_s),
            "slows_ms": at_ms(order.slows_s),
        },
        "longest_s": serialize.plain(longest_s, 0),
    }

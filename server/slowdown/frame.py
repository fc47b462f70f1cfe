"""The `decelerate` of a state frame (docs/protocol.md), and what the checks know of a slow-down."""

from __future__ import annotations

from monitor.checks.slow_down import SlowDownLimits
from monitor.shell_facts import SlowingFacts
from server.protocol import serialize
from server.protocol.slow_down_state import SlowDownOrder, SlowDownSummary
from server.slowdown.command_target import CommandTarget
from server.slowdown.order import Order, SlowDown


def slow_down_frame(
    life: SlowDown,
    target: CommandTarget,
    limits: SlowDownLimits,
    competing_publishers: tuple[str, ...] | None,
    *,
    is_response_missing: bool,
    now_s: float,
    wall_ms: int,
) -> SlowDownSummary:
    """Without the countdown and the guard. `wall_ms`: the time of day at `now_s`, a moment of the session's clock."""
    order = life.order
    return {
        "state": life.state(target, now_s),
        "why": target.problem if order is None else None,
        "topic": target.topic or None,
        "type": target.type,
        "rivals": None if competing_publishers is None else list(competing_publishers),
        "armed_by": life.armed_by,
        "deceleration_mps2": round(limits.deceleration_mps2, 2),
        "order": None
        if order is None
        else _order(order, now_s, wall_ms, is_response_missing=is_response_missing, longest_s=limits.longest_s),
    }


def facts(life: SlowDown, target: CommandTarget, competing_publishers: tuple[str, ...] | None) -> SlowingFacts:
    """What the checks know of the slow-down."""
    order = life.order
    return SlowingFacts(
        is_armed=life.armed_by is not None,
        topic=target.topic,
        rivals=competing_publishers or (),
        ordered_s=order.ordered_s if order else None,
        sending_s=order.sending_s if order else None,
        deceleration_mps2=order.deceleration_mps2 if order else 0.0,
        commanded_mps=order.last.speed_mps if order and order.last else None,
        ended_at_longest_s=life.ended_at_longest_s,
    )


def _order(order: Order, now_s: float, wall_ms: int, *, is_response_missing: bool, longest_s: float) -> SlowDownOrder:
    def at_ms(moment_s: float | None) -> int | None:
        return None if moment_s is None else round(wall_ms - (now_s - moment_s) * 1000)

    return {
        "number": order.number,
        "by": order.by,
        "why": order.why,
        "for_s": round(now_s - order.ordered_s, 1),
        "from_mps": serialize.plain(order.from_mps, 2),
        "ordered_mps": serialize.plain(order.last.speed_mps, 2) if order.last else None,
        "deceleration_mps2": round(order.deceleration_mps2, 2),
        "sending": order.sending_s is not None,
        "confirmed": False if is_response_missing else True if order.slows_s is not None else None,
        "stands": order.stands,
        "steps": {
            "pressed_ms": at_ms(order.pressed_s),
            "server_ms": at_ms(order.ordered_s),
            "bridge_ms": at_ms(order.first_sent_s),
            "slows_ms": at_ms(order.slows_s),
        },
        "longest_s": round(longest_s, 0),
    }

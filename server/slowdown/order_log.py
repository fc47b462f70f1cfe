"""Writes each step of an order to the event log."""

from __future__ import annotations

from collections.abc import Callable

from server.protocol import serialize
from server.protocol.alarm_state import Note
from server.slowdown.command_target import CommandTarget
from server.slowdown.order import Order


class OrderLog:
    """`target`: where commands go now."""

    def __init__(self, note: Note, target: Callable[[], CommandTarget]) -> None:
        self._note = note
        self._target = target

    def write(self, order: Order, step: str, text: str, *, by: str | None = None) -> None:
        """An event with what was commanded last; `by`: who ordered this step."""
        last = order.last
        self._note(
            "slow_down",
            text,
            by=by,
            step=step,
            order=order.number,
            why=order.why,
            ordered_by=order.by,
            commanded_mps=serialize.plain(last.speed_mps, 2) if last else None,
            topic=self._target().topic,
            stands=order.stands,
            tyre_rad=serialize.plain(last.tyre_rad, 4) if last else None,
        )


def commanded(order: Order) -> str:
    """The newest command in words."""
    last = order.last
    return "nothing yet" if last is None else f"{last.speed_mps:.2f} m/s, tyres at {last.tyre_rad:+.3f} rad"

"""Faults of the topic that says who drives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from server.judge.message import Message
from server.simulator.effects import Effect
from server.simulator.fields import with_fields

HALF_PERIOD_S = 0.2


class FlickeringMode(Effect):
    """The mode is published as it is and as the other one by turns, each for 0.2 s."""

    def __init__(self) -> None:
        super().__init__()
        self._began_s: float | None = None

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        if signal != "mode":
            return (message,)
        if self._began_s is None:
            self._began_s = message.at_s
        turn = int(max(0.0, message.at_s - self._began_s + 1e-6) / HALF_PERIOD_S)
        if turn % 2:
            return (message,)
        return (with_fields(message, {**message.message, "data": _other(message.message.get("data"))}),)


def _other(value: Any) -> Any:
    if isinstance(value, str):
        return "autonomous" if value == "manual" else "manual"
    return not value if isinstance(value, bool) else 1 - value if value in (0, 1) else value

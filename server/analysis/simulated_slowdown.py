"""When the car would have been slowed by itself, had slow-down been armed and nobody vetoed: the live rules."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from monitor.alarm import Alarm
from monitor.checks.slow_down import SlowDownLimits
from monitor.triggers import COUNTDOWN_S, Due, Triggers, is_any_on


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedOrder:
    """One order that would have been given. Times are seconds since the beginning of the recording."""

    trigger: str
    title: str
    text: str  # text of the check when the count-down began
    countdown_s: float
    at_s: float


class SimulatedSlowDown:
    """Follows the rules over one drive. A recorded car drives on as it did, so a rule whose order was given once is not
    due again until its fault has gone."""

    def __init__(self, limits: SlowDownLimits) -> None:
        self._limits = limits
        self._is_on = is_any_on(limits)
        self._triggers = Triggers()
        self._counting: tuple[Due, float] | None = None
        self.orders: list[SimulatedOrder] = []

    def judged(self, alarms: Mapping[str, Alarm], now_s: float) -> None:
        """Call with each tick, after the alarms were judged."""
        if not self._is_on:
            return
        counts = None if self._counting is None else self._counting[0].trigger.id
        due = self._triggers.look(alarms, self._limits, now_s, counting=counts)
        if self._counting is None:
            self._counting = (due, now_s) if due is not None else None
            return
        counting, began_s = self._counting
        if due is None or due.trigger.id != counting.trigger.id:
            self._counting = None
        elif now_s - began_s >= COUNTDOWN_S:
            self._counting = None
            self._triggers.veto(counting.trigger.id)
            self.orders.append(
                SimulatedOrder(
                    trigger=counting.trigger.id,
                    title=counting.trigger.title,
                    text=counting.text,
                    countdown_s=began_s,
                    at_s=began_s + COUNTDOWN_S,
                )
            )

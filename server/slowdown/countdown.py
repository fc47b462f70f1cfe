"""The automatic slow-down rules: each has a countdown in which any operator can veto."""

from __future__ import annotations

from collections.abc import Mapping

from monitor.alarm import Alarm, Refused
from monitor.checks.slow_down import SlowDownLimits
from monitor.triggers import COUNTDOWN_S, Due, Triggers
from server.protocol.alarm_state import Note
from server.protocol.slow_down_state import Countdown as CountdownState


class Countdown:
    """At most one runs. Time is an argument."""

    def __init__(self, note: Note) -> None:
        self._note = note
        self._triggers = Triggers()
        self._running: tuple[Due, float] | None = None  # and since when

    def look(self, alarms: Mapping[str, Alarm], limits: SlowDownLimits, now_s: float, *, can_begin: bool) -> Due | None:
        """The rule whose count-down is over: the car is to be slowed now. `can_begin`: slow-down is armed, and nothing
        is ordered."""
        counts = None if self._running is None else self._running[0].trigger.id
        due = self._triggers.look(alarms, limits, now_s, counting=counts)
        if not can_begin:
            self._running = None
            return None
        if self._running is None:
            if due is not None:
                self._running = (due, now_s)
                text = (
                    f"The car is slowed in {COUNTDOWN_S:.0f} s unless somebody vetoes: {due.trigger.title}. {due.text}"
                )
                self._note("slow_down", text, step="countdown", trigger=due.trigger.id)
            return None
        counting, began_s = self._running
        if due is None or due.trigger.id != counting.trigger.id:
            self._running = None
            self._note("slow_down", f"Countdown ended: {counting.trigger.title} is over.", step="over")
            return None
        return counting if now_s - began_s >= COUNTDOWN_S else None

    def veto(self, trigger: str, *, by: str) -> None:
        """Not this time: the rule is not due again before its fault has gone. Raises Refused."""
        if self._running is None or self._running[0].trigger.id != trigger:
            raise Refused("This countdown is no longer running.")
        due, _ = self._running
        self._running = None
        self._triggers.veto(trigger)
        self._note("slow_down", f"Vetoed: {due.trigger.title}.", by=by, step="vetoed", trigger=trigger)

    def stop(self) -> None:
        """What counts down is of no interest any more."""
        self._running = None

    def forget(self) -> None:
        """Another car."""
        self._running = None
        self._triggers.forget()

    def frame(self, now_s: float) -> CountdownState | None:
        """The `countdown` of `decelerate`."""
        if self._running is None:
            return None
        due, began_s = self._running
        return {
            "trigger": due.trigger.id,
            "title": due.trigger.title,
            "text": due.text,
            "left_s": round(max(0.0, COUNTDOWN_S - (now_s - began_s)), 1),
        }

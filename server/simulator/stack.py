"""What stands between whoever commands the car and its motion: the obstacle stopper, as the real car has it.

Without the stopper the vehicle does what the real one's simulator does: in silence it keeps the last commanded speed.
"""

from __future__ import annotations

import math

from server.simulator.vehicle import MotionCommand

STANDOFF_M = 5.0  # at or within it the stopper lets no speed through
DEAD_MAN_S = 0.2  # a command older than this counts no more; the distance has no such limit
STANDING = MotionCommand(speed_mps=0.0, tyre_rad=0.0)


class Stack:
    """The last command on the command topic, whoever sent it, and what of it reaches the wheels."""

    def __init__(self, *, has_stopper: bool = True) -> None:
        self.has_stopper = has_stopper
        self._command = STANDING
        self._heard_s = -math.inf
        self._distance_m = math.inf
        self.hand: MotionCommand | None = None  # of a person at wheel and brake, before whom everything gives way

    @property
    def tyre_rad(self) -> float:
        """The tyre angle of the last command: what a message without one leaves as it is."""
        return self._command.tyre_rad

    def hear(self, command: MotionCommand, now_s: float) -> None:
        """A message on the command topic: the last one wins, and nobody is asked who he is."""
        self._command, self._heard_s = command, now_s

    def see(self, distance_m: float) -> None:
        """What the distance estimator reports of the nearest object ahead. Until then the way is free."""
        self._distance_m = distance_m

    def passed(self, now_s: float) -> MotionCommand:
        """What the vehicle receives now: the command, or zero speed with its tyre angle where the stopper steps in."""
        if self.hand is not None:
            return self.hand
        is_silent = now_s - self._heard_s > DEAD_MAN_S
        if self.has_stopper and (is_silent or self._distance_m <= STANDOFF_M):
            return MotionCommand(speed_mps=0.0, tyre_rad=self._command.tyre_rad)
        return self._command

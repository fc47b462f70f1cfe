"""What the guard decides, without ROS: which command reaches the car, and when it slows the car by itself.

Three may command, in this order: the guard's own ramp, the operator, the controllers. Once the operator or the guard
has begun to slow the car, no controller passes until the hold is released by its number; the ramp never rises
meanwhile.
Speeds are m/s along the car, angles the tyre angle in rad, times seconds of one monotonic clock.
"""

from __future__ import annotations

import math

HEARTBEAT_S = 1.0  # without a heartbeat for longer, the guard slows the car (the heartbeat comes 5 times a second)
OPERATOR_S = 0.3  # an operator's command older than this has stopped: the guard goes on with the ramp
SPEED_S = 0.5  # a measured speed older than this is not known
DECELERATION_MPS2 = 1.5
LARGEST_DECELERATION_MPS2 = 4.6
FAREWELL = 0  # the heartbeat of an operator who stops monitoring on purpose

UNGUARDED = "unguarded"  # no operator: controllers pass, and the loss of a link slows nothing
GUARDED = "guarded"  # the operator's heart beats: controllers pass
OPERATOR = "operator"  # the operator's command passes
SLOWING = "slowing"  # the guard's own ramp
HOLDING = "holding"  # at zero, until released


class Command:
    """A speed [m/s] and a tyre angle [rad, counter-clockwise]."""

    __slots__ = ("angle_rad", "speed_mps")

    def __init__(self, speed_mps: float, angle_rad: float) -> None:
        self.speed_mps = speed_mps
        self.angle_rad = angle_rad

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Command) and (self.speed_mps, self.angle_rad) == (other.speed_mps, other.angle_rad)

    def __hash__(self) -> int:
        return hash((self.speed_mps, self.angle_rad))

    def __repr__(self) -> str:
        return f"Command({self.speed_mps:g} m/s, {self.angle_rad:g} rad)"


class Guard:
    """One guard. Every call that answers a Command or None: what is to be published now, or nothing."""

    def __init__(self, deceleration_mps2: float = DECELERATION_MPS2, heartbeat_s: float = HEARTBEAT_S) -> None:
        """Raises ValueError for a deceleration or a time that makes no guard."""
        if not 0.1 <= deceleration_mps2 <= LARGEST_DECELERATION_MPS2:
            raise ValueError(f"The deceleration lies between 0.1 and {LARGEST_DECELERATION_MPS2} m/s2.")
        if not 0.4 <= heartbeat_s <= 10.0:
            raise ValueError("The time without a heartbeat lies between 0.4 and 10 s.")
        self.deceleration_mps2 = deceleration_mps2
        self.heartbeat_s = heartbeat_s
        self.hold = 0  # the number of the newest hold; it grows, and is what a release must name
        self.why = ""  # why the car is held, or was last
        self._is_held = False
        self._beat = None  # type: int | None
        self._beat_s = -math.inf
        self._is_watched = False  # an operator's heartbeat has come, and no farewell since
        self._last = Command(0.0, 0.0)  # what was published last
        self._speed_mps = 0.0
        self._speed_s = -math.inf
        self._operator = Command(0.0, 0.0)
        self._operator_s = -math.inf
        self._controller_s = -math.inf
        self._ramp_mps = 0.0  # of the magnitude; where the ramp stands
        self._ramp_s = 0.0
        self._sign = 1.0

    # -- received ----------------------------------------------------------------------------------------------------

    def controller(self, now_s: float, speed_mps: float, angle_rad: float) -> Command | None:
        """A controller commands: it passes at once, or is swallowed while the car is held."""
        if not math.isfinite(speed_mps):
            return None
        self._controller_s = now_s
        self._look(now_s)
        if self._is_held:
            return None
        self._last = Command(speed_mps, self._angle(angle_rad))
        return self._last

    def operator(self, now_s: float, speed_mps: float, angle_rad: float) -> Command | None:
        """The operator slows the car: it passes at once, never faster than the ramp, and holds from now on."""
        if not math.isfinite(speed_mps):
            return None
        self._operator_s = now_s
        if not self._is_held:
            self._begin(now_s, "the operator slows the car")
        self._operator = Command(speed_mps, self._angle(angle_rad))
        return self._held(now_s)

    def heartbeat(self, now_s: float, count: int) -> None:
        """The operator's heart beats; a count that does not change is a recording of a heart."""
        if count == FAREWELL:
            if not self._is_held:
                self._is_watched, self._beat = False, None
            return
        if count != self._beat:
            self._beat, self._beat_s, self._is_watched = count, now_s, True

    def speed(self, now_s: float, speed_mps: float) -> None:
        """The car's measured speed."""
        if math.isfinite(speed_mps):
            self._speed_mps, self._speed_s = speed_mps, now_s

    def release(self, now_s: float, hold: int) -> bool:
        """The operator lets the controllers drive again; answers whether that is so now.

        Refused without a heartbeat, or for another hold than the one that stands: a release that comes late must not
        undo what was ordered since.
        """
        self._look(now_s)
        if not self._is_held or hold != self.hold or not self._beats(now_s):
            return False
        self._is_held = False
        self._operator_s = -math.inf
        return True

    def tick(self, now_s: float) -> Command | None:
        """Time has passed, 20 times a second: the command for a held car."""
        self._look(now_s)
        return self._held(now_s) if self._is_held else None

    # -- what is published ---------------------------------------------------------------------------------------------

    def state(self, now_s: float) -> str:
        """One of the five states above."""
        if not self._is_held:
            return GUARDED if self._is_watched else UNGUARDED
        if now_s - self._operator_s <= OPERATOR_S:
            return OPERATOR
        return HOLDING if self._ramp_mps == 0.0 else SLOWING

    def report(self, now_s: float) -> dict[str, object]:
        """What goes out on ocu_guard/state, as JSON. Ages in seconds, null for never."""
        return {
            "state": self.state(now_s),
            "hold": self.hold,
            "why": self.why if self._is_held else "",
            "heartbeat_age_s": _age(now_s, self._beat_s),
            "controller_age_s": _age(now_s, self._controller_s),
            "speed_age_s": _age(now_s, self._speed_s),
            "commanded_mps": round(self._last.speed_mps, 3),
            "deceleration_mps2": self.deceleration_mps2,
            "heartbeat_s": self.heartbeat_s,
        }

    # -- within ------------------------------------------------------------------------------------------------------

    def _beats(self, now_s: float) -> bool:
        return now_s - self._beat_s <= self.heartbeat_s

    def _look(self, now_s: float) -> None:
        if self._is_watched and not self._is_held and not self._beats(now_s):
            self._begin(now_s, "the operator's heartbeat stopped")

    def _begin(self, now_s: float, why: str) -> None:
        """Holds the car from now on, beginning at the speed it has; where that is not known, at what was commanded."""
        self.hold += 1
        self.why = why
        self._is_held = True
        is_known = now_s - self._speed_s <= SPEED_S
        speed_mps = self._speed_mps if is_known else self._last.speed_mps
        self._ramp_mps, self._ramp_s = abs(speed_mps), now_s
        self._sign = -1.0 if speed_mps < 0 else 1.0

    def _held(self, now_s: float) -> Command:
        """One step down the ramp; the operator's command where it is fresh and slower still."""
        passed_s = max(0.0, now_s - self._ramp_s)
        self._ramp_mps = max(0.0, self._ramp_mps - self.deceleration_mps2 * passed_s)
        self._ramp_s = max(self._ramp_s, now_s)
        angle_rad = self._last.angle_rad
        if now_s - self._operator_s <= OPERATOR_S:
            self._ramp_mps = min(self._ramp_mps, abs(self._operator.speed_mps))
            angle_rad = self._operator.angle_rad
        self._last = Command(self._sign * self._ramp_mps if self._ramp_mps else 0.0, angle_rad)
        return self._last

    def _angle(self, angle_rad: float) -> float:
        """The angle; the last one where it is none: zero would straighten the wheels."""
        return angle_rad if math.isfinite(angle_rad) else self._last.angle_rad


def _age(now_s: float, then_s: float) -> float | None:
    return round(max(0.0, now_s - then_s), 3) if math.isfinite(then_s) else None

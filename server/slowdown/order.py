"""The states of a slow-down order: armed, ordered, held, released. Pure: time is an argument.

The car's motion is unknown during an interruption, so an interrupted ramp restarts at the measured speed. Nothing is
sent later: a command is built when it is sent. `slow_down_frame` is its part of a state frame (docs/protocol.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from monitor.alarm import Refused
from monitor.checks.slow_down import SlowDownLimits
from monitor.shell_facts import SlowingFacts
from server.protocol import serialize
from server.protocol.slow_down_state import SlowDownOrder, SlowDownPhase, SlowDownSummary
from server.slowdown.command_target import CommandTarget

CAP_MPS2 = 4.6  # as hard as the car brakes

DESERTED_S = 10.0  # after the last operator's page has gone, slow-down is not armed any more
BY_HAND = "by hand"
Ended = Literal["released", "longest", "disconnected"]
Stands = Literal["before", "unproven"]  # it stood when it was ordered; what stopped it is not shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """The ramp down: from a speed to zero with a constant deceleration, the wheels held as they are.

    `from_mps` may be negative: a car that rolls backwards is slowed too.
    """

    from_mps: float
    tyre_rad: float  # held all the way: zero would straighten the wheels
    deceleration_mps2: float
    began_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.from_mps) and math.isfinite(self.tyre_rad)):
            raise ValueError("A ramp needs a start speed and a tyre angle.")
        if not 0.0 < self.deceleration_mps2 <= CAP_MPS2:
            raise ValueError(f"A deceleration is above 0 and at most {CAP_MPS2} m/s².")

    def speed_mps(self, now_s: float) -> float:
        """What is ordered at a moment; zero for ever once it is reached."""
        left_mps = abs(self.from_mps) - self.deceleration_mps2 * max(0.0, now_s - self.began_s)
        return math.copysign(left_mps, self.from_mps) if left_mps > 0.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A command to the car: speed [m/s, forward], tyre angle [rad]."""

    speed_mps: float
    tyre_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """What is measured now; None: not known."""

    speed_mps: float | None
    tyre_rad: float | None


@dataclass(slots=True, kw_only=True)
class Order:
    """One order. Moments are on the session's monotonic clock."""

    number: int  # never given twice
    by: str
    why: str
    ordered_s: float
    pressed_s: float | None  # when the finger was lifted, as exactly as known
    deceleration_mps2: float
    ramp: Ramp | None = None  # None: no command has gone out since it began, or since the link came back
    from_mps: float | None = None  # where the first ramp began
    first_sent_s: float | None = None
    sending_s: float | None = None  # since when commands go out without a gap
    slows_s: float | None = None  # when the car's own speed showed it
    stands: Stands | None = None  # the car stands, and its speed does not prove that the order stopped it
    last: Command | None = None


class SlowDown:
    """Of one vehicle. Callers are authorized already."""

    def __init__(self, number: int = 0) -> None:
        """`number`: no order up to this one is given again."""
        self._number = number
        self.armed_by: str | None = None
        self.order: Order | None = None
        self.ended_at_longest_s: float | None = None
        self._operators_s: float | None = None  # last contact of an operator's page; None: none since it was armed

    def state(self, target: CommandTarget, now_s: float) -> SlowDownPhase:
        if self.order is not None:
            at_zero = self.order.last is not None and self.order.last.speed_mps == 0.0
            return "holding" if at_zero and self.order.ramp is not None else "ordered"
        if target.problem is not None:
            return "not_available"
        return "not_armed" if self.armed_by is None else "armed"

    def arm(self, target: CommandTarget, by: str) -> bool:
        """Whether it was not armed before. Raises Refused."""
        if target.problem is not None:
            raise Refused(f"Slow-down is not available: {target.problem}")
        was = self.armed_by
        self.armed_by = was or by
        return was is None

    def is_deserted(self, heard_s: float | None, now_s: float, *, keeps: bool) -> bool:
        """Whether it is armed without an order after the last operator's page has gone. `heard_s`: last contact of such
        a page; None: no page. `keeps`: stay armed all the same. Armed by a program without a page, it stays armed."""
        if self.armed_by is None:
            self._operators_s = None
            return False
        if heard_s is not None:
            self._operators_s = max(heard_s, self._operators_s or heard_s)
        gone_s = self._operators_s
        return gone_s is not None and self.order is None and not keeps and now_s - gone_s >= DESERTED_S

    def disarm(self) -> bool:
        """Whether it was armed. Raises Refused while the car is being slowed."""
        if self.order is not None:
            raise Refused("The car is being slowed: release it first.")
        was, self.armed_by = self.armed_by, None
        return was is not None

    def begin(
        self,
        target: CommandTarget,
        *,
        by: str,
        why: str,
        deceleration_mps2: float,
        now_s: float,
        pressed_s: float | None,
    ) -> Order | None:
        """Start an order; None: one is already active and continues. Raises Refused."""
        if self.order is not None:
            return None
        if self.armed_by is None:
            raise Refused("Slow-down is not armed.")
        if target.problem is not None:
            raise Refused(f"Slow-down is not available: {target.problem}")
        self._number += 1
        self.ended_at_longest_s = None
        self.order = Order(
            number=self._number,
            by=by,
            why=why,
            ordered_s=now_s,
            pressed_s=pressed_s,
            deceleration_mps2=deceleration_mps2,
        )
        return self.order

    def next(self, car: Car, now_s: float) -> Command | None:
        """The command to send now; None: no order, or no known tyre angle to hold (0 would turn the tyres). Without a
        known speed the ramp starts at the last command, or at zero: the car itself limits its braking."""
        order = self.order
        if order is None:
            return None
        if order.ramp is None:
            last = order.last
            known = car.speed_mps if car.speed_mps is not None else (last.speed_mps if last is not None else 0.0)
            tyre_rad = car.tyre_rad if car.tyre_rad is not None else (last.tyre_rad if last is not None else None)
            if tyre_rad is None:
                return None
            order.ramp = Ramp(
                from_mps=known, tyre_rad=tyre_rad, deceleration_mps2=order.deceleration_mps2, began_s=now_s
            )
            if order.from_mps is None:
                order.from_mps = known
        return Command(speed_mps=order.ramp.speed_mps(now_s), tyre_rad=order.ramp.tyre_rad)

    def sent(self, command: Command, now_s: float) -> bool:
        """The command has gone out to the bridge; whether it is the first of the order."""
        order = self.order
        assert order is not None
        order.last = command
        if order.sending_s is None:
            order.sending_s = now_s
        if order.first_sent_s is None:
            order.first_sent_s = now_s
            return True
        return False

    def cut(self) -> bool:
        """Commands do not go out any more; whether they did."""
        order = self.order
        if order is None or order.sending_s is None:
            if order is not None:
                order.ramp = None
            return False
        order.ramp, order.sending_s = None, None
        return True

    def confirm(self, now_s: float) -> bool:
        """The car's own speed shows that it slows; whether that is new."""
        if self.order is None or self.order.slows_s is not None:
            return False
        self.order.slows_s = now_s
        return True

    def is_too_long(self, longest_s: float, now_s: float) -> bool:
        return self.order is not None and now_s - self.order.ordered_s >= longest_s

    def release(self, number: int) -> Order:
        """Ends the very order that is named. Raises Refused."""
        order = self.order
        if order is None:
            raise Refused("The car is not being slowed.")
        if order.number != number:
            raise Refused("A newer slow-down order was given meanwhile: check again.")
        self.order = None
        return order

    def end(self, why: Ended, now_s: float) -> Order | None:
        """End the active order; disarm if the car is another one."""
        order, self.order = self.order, None
        if why == "longest":
            self.ended_at_longest_s = now_s
        if why == "disconnected":
            self.armed_by, self.ended_at_longest_s = None, None
        return order


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
    """The `decelerate` of a state, without the countdown and the guard.

    `wall_ms`: the time of day at `now_s`, a moment of the session's clock.
    """
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


def slowing_facts(life: SlowDown, target: CommandTarget, competing_publishers: tuple[str, ...] | None) -> SlowingFacts:
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

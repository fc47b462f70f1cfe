"""Slows one vehicle: arms, accepts orders of operators and rules, has them sent, and follows their result."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from monitor.alarm import Alarm, Refused
from monitor.checks.slow_down import SlowDownLimits
from monitor.shell_facts import SlowingFacts
from monitor.state import Snapshot
from server.protocol import drive_commands
from server.protocol.alarm_state import Note
from server.protocol.slow_down_state import SlowDownState
from server.rosbridge.live_source import CommandChannel
from server.slowdown.command_target import CommandTarget
from server.slowdown.countdown import Countdown
from server.slowdown.guard_client import GuardClient
from server.slowdown.order import BY_HAND, DESERTED_S, SlowDown, slow_down_frame, slowing_facts
from server.slowdown.order_log import OrderLog, Response, commanded, never_raising, recording_safely
from server.slowdown.sender import MeasuredCar, Sender

log = logging.getLogger("catgraph.slowing")

STEERING_NOT_KNOWN = (
    "The steering of this kind of car is not known, and a command would turn its wheels: choose the kind of car, or "
    "set the tyre angle per unit of steering, in Settings."
)
NO_STEERING = "No steering has come from the car: a command would turn its wheels."


class SlowDownController:
    """Of one vehicle. `now` is the session's clock in seconds, `wall_ms` the time of day; `snapshot` what is known of
    the car now; `record` keeps what was sent. Everything runs on one loop."""

    def __init__(
        self,
        note: Note,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        snapshot: Callable[[], Snapshot],
        record: Callable[[Mapping[str, Any]], None],
        number: int,
    ) -> None:
        """`number`: no order up to this one is given again, restarts included."""
        self._note = note = never_raising(note)
        self._now = now
        self._wall_ms = wall_ms
        self._snapshot = snapshot
        self._life = life = SlowDown(number)
        self._order_log = order_log = OrderLog(note, lambda: self.sender.target)
        self.car = MeasuredCar(snapshot)
        self.sender = Sender(life, order_log, self.car, now=now, wall_ms=wall_ms, record=recording_safely(record))
        self._response = Response(life, order_log)
        self._countdown = Countdown(note)
        self._guard = GuardClient(self.sender.publisher)
        self._is_steering_old = False
        self.limits = SlowDownLimits()
        self.competing_publishers: tuple[str, ...] | None = None  # on the command topic; None: not known

    # -- the link ----------------------------------------------------------------------------------------------------

    def link_opened(self, link: CommandChannel) -> None:
        """Resume an active order."""
        self.car.opened_s = self._now()
        self.sender.attach(link)

    def link_closed(self) -> None:
        """An active order is paused until the link returns."""
        self.sender.link_closed()

    def ended(self, why: str = "monitoring ended") -> bool:
        """End at the end of monitoring; return whether the guard was informed."""
        order = self._life.end("disconnected", self._now())
        if order is not None:
            self._order_log.write(order, "ended", f"The slow-down ended: {why}. Nothing holds the car.")
        has_released_guard = self._guard.end()
        if not has_released_guard:
            self.sender.publisher.unadvertise_all()
        self.sender.detach()
        self.competing_publishers = None
        self.car.tyre_rad = None
        self._countdown.forget()
        return has_released_guard

    def resume(self, order: Mapping[str, Any]) -> None:
        """Resume the order that was active when the server ended, because the same car is dialled again."""
        life = self._life
        life.armed_by = str(order.get("by") or "before the restart")
        tyre_rad = order.get("tyre_rad")  # held then, and until one is measured
        self.car.tyre_rad = float(tyre_rad) if isinstance(tyre_rad, int | float) else None
        life.begin(
            CommandTarget(),
            by=life.armed_by,
            why=str(order.get("why") or BY_HAND),
            deceleration_mps2=self.limits.deceleration_mps2,
            now_s=self._now(),
            pressed_s=None,
        )
        assert life.order is not None
        text = "The car was being slowed when the server ended: the order is resumed under a new number."
        self.sender.begin()
        self._order_log.write(life.order, "resumed", text)

    def receive(self, topic: str, message: Any) -> bool:
        """A message that may be the guard's own; whether it was."""
        return self._guard.receive(topic, message, self._now())

    # -- time --------------------------------------------------------------------------------------------------------

    def tick(
        self, target: CommandTarget, alarms: Mapping[str, Alarm], *, ros_version: int | None, is_paused: bool
    ) -> SlowingFacts:
        """With each tick: where commands go, the rules, the proof. Returns what the checks are to know."""
        now_s = self._now()
        self.sender.ros_version = ros_version or self.sender.ros_version
        self._watch_steering()
        self._watch_target(self._with_steering(target))
        self._watch_rules(alarms, now_s, is_paused)
        order = self._life.order
        if order is not None:
            if self._life.is_too_long(self.limits.longest_s, now_s):
                self._life.end("longest", now_s)
                text = f"The slow-down ended after {self.limits.longest_s:.0f} s: nothing holds the car."
                self._order_log.write(order, "ended", text)
            else:
                self._response.judge(order, self._snapshot(), self._facts(), self.limits, now_s=now_s)
        self._guard.tick(target.has_guard, now_s)
        return self._facts()

    async def heartbeat_loop(self) -> None:
        """The operator's heartbeat for the guard, 5 times a second, as long as this server is itself healthy."""
        while True:
            await asyncio.sleep(self._guard.PERIOD_S)
            try:
                self._guard.send_heartbeat(self._now())
            except Exception:
                log.exception("guard heartbeat failed")

    def watch_operators(self, heard_s: float | None) -> None:
        """`heard_s`: last contact of an operator's page; None: none. Arming ends with the last of them, unless an order
        is active or a rule slows the car when nobody can hear alarms."""
        if self._life.is_deserted(heard_s, self._now(), keeps=bool(self.limits.on_reach)):
            self._disarm(f"the last operator's page has been gone for {DESERTED_S:.0f} s.")
            self.sender.publisher.unadvertise_all()

    def _watch_steering(self) -> None:
        """Keeps the last known tyre angle, and notes during an order when it is not measured any more."""
        is_measured = self.car.update()
        order, was_old = self._life.order, self._is_steering_old
        self._is_steering_old = order is not None and not is_measured
        if order is not None and self._is_steering_old and not was_old:
            held = "no angle is known" if order.last is None else f"the last known angle is held ({commanded(order)})"
            self._order_log.write(order, "steering", f"The steering is no longer measured: {held}.")

    def _with_steering(self, target: CommandTarget) -> CommandTarget:
        """The same, or why nothing can be ordered: a command carries a tyre angle, and 0 would turn the wheels."""
        if target.problem is not None:
            return target
        if not self.car.is_steering_known:
            return replace(target, problem=STEERING_NOT_KNOWN)
        return replace(target, problem=NO_STEERING) if self.car.tyre_rad is None else target

    def _watch_target(self, target: CommandTarget) -> None:
        """Disarm if topic or type changed, because they are not confirmed. An active order continues."""
        before = self.sender.target
        is_ordered = self._life.order is not None
        if is_ordered and target.problem is not None:
            return  # the order resumes on its former topic as soon as there is a link
        self.sender.target = target
        if self._life.armed_by is None or is_ordered:
            return
        if target.problem is not None or (target.topic, target.kind) != (before.topic, before.kind):
            self._disarm(target.problem or f"commands go to {target.topic} now.")
        else:
            self.sender.announce()

    def _watch_rules(self, alarms: Mapping[str, Alarm], now_s: float, is_paused: bool) -> None:
        has_problem = self.sender.target.problem is not None
        can_begin = self._life.order is None and self._life.armed_by is not None and not has_problem
        over = self._countdown.look(alarms, self.limits, now_s, can_begin=can_begin and not is_paused)
        if over is not None and self.sender.is_linked:  # else once the link is back
            self._begin("catgraph", over.trigger.title, now_s, pressed_s=None)

    def _disarm(self, why: str) -> None:
        self._life.disarm()
        self._countdown.stop()
        self._note("disarmed", f"Slow-down disarmed: {why}")

    # -- orders ------------------------------------------------------------------------------------------------------

    def execute(self, command: drive_commands.SlowingCommand, *, by: str) -> None:
        """Execute an operator's command. Raises Refused; the refusal of a slow-down is logged."""
        match command:
            case drive_commands.Arm():
                if self._life.arm(self.sender.target, by):
                    self.sender.announce()
                    text = (
                        f"Slow-down armed on {self.sender.target.topic}.{_competitors_text(self.competing_publishers)}"
                    )
                    self._note("armed", text, by=by)
            case drive_commands.Disarm():
                if self._life.disarm():
                    self._countdown.stop()
                    self.sender.publisher.unadvertise_all()
                    self._note("disarmed", "Slow-down disarmed.", by=by)
            case drive_commands.Decelerate():
                self._order_by_hand(command, by)
            case drive_commands.Release():
                self._release(command.number, by)
            case drive_commands.Veto():
                self._countdown.veto(command.trigger, by=by)

    def _order_by_hand(self, command: drive_commands.Decelerate, by: str) -> None:
        now_s = self._now()
        late_s = command.late_s(self._wall_ms())
        try:
            if self._life.order is None and not self.sender.is_linked:
                raise Refused("Not ordered: there is no link to the car. Use the physical stop.")
            self._begin(by, BY_HAND, now_s, pressed_s=now_s - late_s)
        except Refused as why:
            self._note("slow_down", f"Slow-down refused: {why.reason}", by=by, step="refused")
            raise

    def _begin(self, by: str, why: str, now_s: float, *, pressed_s: float | None) -> None:
        order = self._life.begin(
            self.sender.target,
            by=by,
            why=why,
            deceleration_mps2=self.limits.deceleration_mps2,
            now_s=now_s,
            pressed_s=pressed_s,
        )
        self._countdown.stop()
        if order is None:
            return  # one is already active
        self._response.begin()
        self.sender.begin()
        self.sender.send_at_once()  # first to the car, then to the log
        text = f"Slow down with {order.deceleration_mps2:g} m/s², {why}."
        self._order_log.write(order, "ordered", text, by=by)
        if order.first_sent_s is not None:
            self._order_log.write(order, "sent", f"The first command is on the bridge: {commanded(order)}.")

    def _release(self, number: int, by: str) -> None:
        """End the order, or without one the hold of the guard."""
        if self._life.order is None and self._guard.holds:
            self._guard.release(number)
            self._note(
                "slow_down", "The guard on the car was ordered to release it.", by=by, step="released", hold=number
            )
            return
        order = self._life.release(number)
        self._guard.release()
        self._order_log.write(
            order, "released", "The car is released: its driver or controller commands it again.", by=by
        )

    # -- what others see ---------------------------------------------------------------------------------------------

    def _facts(self) -> SlowingFacts:
        return slowing_facts(self._life, self.sender.target, self.competing_publishers)

    def frame(self) -> SlowDownState:
        """The `decelerate` of a state frame."""
        now_s = self._now()
        shown = slow_down_frame(
            self._life,
            self.sender.target,
            self.limits,
            self.competing_publishers,
            is_response_missing=self._response.is_missing,
            now_s=now_s,
            wall_ms=self._wall_ms(),
        )
        return {**shown, "countdown": self._countdown.frame(now_s), "guard": self._guard.frame(now_s)}


def _competitors_text(names: tuple[str, ...] | None) -> str:
    """Who else publishes on the command topic; None: not known."""
    if names is None:
        return " Who else publishes there is not known."
    return f" {', '.join(names)} also publish{'es' if len(names) == 1 else ''} there." if names else ""

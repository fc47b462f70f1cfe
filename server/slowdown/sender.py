"""Slows one vehicle: keeps the order, speaks it to the car 20 times a second, and tells what came of it.

What is spoken is made at the moment it goes out, and only while the bridge answers. A ping goes behind every command:
with two unanswered nothing more is said, and where nothing is heard for 0.3 s the socket is aborted, so that what the
system still holds dies with it (RFC 9293, RST) instead of arriving late.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from monitor.alarm import Alarm, Refused
from monitor.check import Verdict
from monitor.checks.slow_down import STANDS_ALREADY, STANDS_UNPROVEN, SlowDownLimits, obeys, proof_of
from monitor.slowing import SlowingFacts
from monitor.state import Reading, Snapshot
from server.protocol import commands, serialize
from server.rosbridge.link import LinkDown, RosLink
from server.rosbridge.outgoing import NotAllowed
from server.slowdown.command_target import Way
from server.slowdown.countdown import Countdown
from server.slowdown.guard_client import GuardWatch
from server.slowdown.note import Note, never_raising, recording_safely
from server.slowdown.order import BY_HAND, DESERTED_S, LATE_S, Car, Order, SlowDown, Stands
from server.slowdown.publisher import Mouth
from server.slowdown.twist import message

log = logging.getLogger("catgraph.slowing")

TIMER_S = 0.001  # timers of the event loop know whole milliseconds
PERIOD_S = 0.05  # the obstacle stopper lets a command count for 0.2 s
DOUBT_S = 0.3
FIRST_SPEED_S = 0.5
UNDER_WAY = 2  # commands of which the bridge has not yet shown that it read them; where it freezes, no more come late
STEERING_NOT_KNOWN = (
    "The steering of this kind of car is not known, and a command would turn its wheels: choose the kind of car, or "
    "set the tyre angle per unit of steering, in Settings."
)
NO_STEERING = "No steering has come from the car: a command would turn its wheels."
STALL_S = 0.1  # a turn so late was our own fault: what the bridge said meanwhile is still unread


class Slowing:
    """One vehicle's. `now` is the session's clock, `wall_ms` the time of day; `snapshot` what is known of the car now;
    `record` keeps what was sent. Everything runs on one loop."""

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
        self._record = recording_safely(record)
        self._life = SlowDown(number)
        self._mouth = Mouth()
        self._countdown = Countdown(note)
        self._guard = GuardWatch(self._mouth)
        self._link: RosLink | None = None
        self._way = Way(problem="No car is connected.")
        self._ros_version = 1
        self._ordered = asyncio.Event()
        self._turned_s = 0.0
        self._due_s = 0.0  # the next command
        self._opened_s = 0.0  # the newest opening of the link
        self._sent_s = 0.0  # the newest command
        self._told_unconfirmed = False
        self._tyre_rad: float | None = None  # the last known
        self._is_steering_old = False
        self.is_steering_known = False  # whether an angle of the tyres follows from the steering signal
        self.limits = SlowDownLimits()
        self.rivals: tuple[str, ...] | None = None  # who else publishes on the topic; None: not known

    # -- the link ----------------------------------------------------------------------------------------------------

    def link_opened(self, link: RosLink) -> None:
        self._link = link
        self._opened_s = self._now()
        self._mouth.attach(link)
        if self._life.order is not None:
            self._speak_at_once()

    def link_closed(self) -> None:
        self._mouth.attach(None)
        self._cut("the link to the car was lost")

    def ended(self, why: str = "monitoring ended") -> bool:
        """The car is not monitored any more; whether the guard on it was told so just now."""
        order = self._life.end("disconnected", self._now())
        if order is not None:
            self._tell(order, "ended", f"The slow-down ended: {why}. Nothing holds the car.")
        said_farewell = self._guard.farewell()
        if not said_farewell:
            self._mouth.unadvertise_all()
        self._mouth.attach(None)
        self._link, self.rivals = None, None
        self._tyre_rad = None
        self._countdown.forget()
        self._way = Way(problem="No car is connected.")
        return said_farewell

    def resume(self, order: Mapping[str, Any]) -> None:
        """An order stood when the server ended, and the same car is dialled again: it stands until it is released."""
        life = self._life
        life.armed_by = str(order.get("by") or "before the restart")
        tyre_rad = order.get("tyre_rad")  # held then, and until one is measured
        self._tyre_rad = float(tyre_rad) if isinstance(tyre_rad, int | float) else None
        life.begin(
            Way(),
            by=life.armed_by,
            why=str(order.get("why") or BY_HAND),
            deceleration_mps2=self.limits.deceleration_mps2,
            now_s=self._now(),
            pressed_s=None,
        )
        assert life.order is not None
        text = "The car was being slowed when the server ended: the order stands again, under a new number."
        self._ordered.set()
        self._tell(life.order, "resumed", text)

    def heard(self, topic: str, said: Any) -> bool:
        """A message that may be the guard's own; whether it was."""
        return self._guard.heard(topic, said, self._now())

    # -- time --------------------------------------------------------------------------------------------------------

    def tick(self, way: Way, alarms: Mapping[str, Alarm], *, ros_version: int | None, is_paused: bool) -> SlowingFacts:
        """With each tick: the way to the car, the rules, the proof. What the checks are to know."""
        now_s = self._now()
        self._ros_version = ros_version or self._ros_version
        self._watch_steering()
        self._watch_way(self._steered(way))
        self._watch_rules(alarms, now_s, is_paused)
        order = self._life.order
        if order is not None:
            if self._life.is_too_long(self.limits.longest_s, now_s):
                self._life.end("longest", now_s)
                self._tell(
                    order, "ended", f"The slow-down ended after {self.limits.longest_s:.0f} s: nothing holds the car."
                )
            else:
                self._prove(order, now_s)
        self._guard.tick(way.has_guard, now_s)
        return self._facts()

    def _watch_steering(self) -> None:
        """Keeps the last known tyre angle, and notes during an order when it is not measured any more."""
        measured_rad = self._car().tyre_rad
        if measured_rad is not None:
            self._tyre_rad = measured_rad
        order, was_old = self._life.order, self._is_steering_old
        self._is_steering_old = order is not None and measured_rad is None
        if order is not None and self._is_steering_old and not was_old:
            held = "no angle is known" if order.last is None else f"the last known angle is held ({_said(order)})"
            self._tell(order, "steering", f"The steering is not measured any more: {held}.")

    def _steered(self, way: Way) -> Way:
        """The same, or why nothing can be ordered: a command carries a tyre angle, and 0 would turn the wheels."""
        if way.problem is not None:
            return way
        if not self.is_steering_known:
            return replace(way, problem=STEERING_NOT_KNOWN)
        return replace(way, problem=NO_STEERING) if self._tyre_rad is None else way

    async def speak(self) -> None:
        """Sends what is ordered, 20 times a second, for ever: no page, no judge and no disk is waited for. Started
        again while an order stands, it goes on with it."""
        while True:
            if self._life.order is None:
                self._ordered.clear()
                await self._ordered.wait()
            await self._speak_on()

    async def _speak_on(self) -> None:
        """As long as an order stands."""
        while self._life.order is not None:
            left_s = self._due_s - self._now()
            if left_s > TIMER_S:
                await asyncio.sleep(left_s)
                continue  # one that was ordered meanwhile has its own time
            self._due_s = max(self._due_s + PERIOD_S, self._now())
            self._speak_safely()

    async def beat(self) -> None:
        """The operator's heartbeat for the guard, 5 times a second, as long as this server is itself healthy."""
        while True:
            await asyncio.sleep(self._guard.PERIOD_S)
            try:
                self._guard.beat(self._now())
            except Exception:
                log.exception("a heartbeat for the guard failed")

    def watch_operators(self, heard_s: float | None) -> None:
        """When a page of an operator was heard last; None: none is here. Armed ends with the last of them, but not an
        order, and not where a rule is to slow the car because nobody is there."""
        if self._life.is_deserted(heard_s, self._now(), keeps=bool(self.limits.on_reach)):
            self._life.disarm()
            self._countdown.stop()
            self._mouth.unadvertise_all()
            text = f"Slow-down is not armed any more: the last operator's page has been gone for {DESERTED_S:.0f} s."
            self._note("disarmed", text)

    # -- orders ------------------------------------------------------------------------------------------------------

    def obey(self, command: commands.SlowingCommand, *, by: str) -> None:
        """What an operator orders. Raises Refused; the refusal of a slow-down stands in the log."""
        match command:
            case commands.Arm():
                if self._life.arm(self._way, by):
                    self._announce_way()
                    self._note("armed", f"Slow-down armed on {self._way.topic}.{self._rivals_words()}", by=by)
            case commands.Disarm():
                if self._life.disarm():
                    self._countdown.stop()
                    self._mouth.unadvertise_all()
                    self._note("disarmed", "Slow-down is not armed any more: nothing can be ordered.", by=by)
            case commands.Decelerate():
                self._order_by_hand(command, by)
            case commands.Release():
                self._release(command.number, by)
            case commands.Veto():
                self._countdown.veto(command.trigger, by=by)

    def _order_by_hand(self, command: commands.Decelerate, by: str) -> None:
        now_s = self._now()
        late_s = command.late_s(self._wall_ms())
        try:
            if late_s > LATE_S:
                raise Refused(f"This was pressed {late_s:.1f} s ago: press again if it still counts.")
            if self._life.order is None and (self._link is None or not self._link.is_open):
                raise Refused("Not ordered: there is no link to the car. Use the physical stop.")
            self._begin(by, BY_HAND, now_s, pressed_s=now_s - late_s)
        except Refused as why:
            self._note("slow_down", f"Slow-down refused: {why.reason}", by=by, step="refused")
            raise

    def _begin(self, by: str, why: str, now_s: float, *, pressed_s: float | None) -> None:
        order = self._life.begin(
            self._way,
            by=by,
            why=why,
            deceleration_mps2=self.limits.deceleration_mps2,
            now_s=now_s,
            pressed_s=pressed_s,
        )
        self._countdown.stop()
        if order is None:
            return  # one stands already
        self._told_unconfirmed = False
        self._ordered.set()
        self._speak_at_once()  # first to the car, then to the log
        self._tell(order, "ordered", f"Slow down with {order.deceleration_mps2:g} m/s², {why}.", by=by)
        if order.first_sent_s is not None:
            self._tell(order, "sent", f"The first command is on the bridge: {_said(order)}.")

    def _release(self, number: int, by: str) -> None:
        """Ends the order; where none stands and the guard holds the car by itself, its hold."""
        if self._life.order is None and self._guard.holds:
            self._guard.release(number)
            self._note("slow_down", "The guard on the car is told to release it.", by=by, step="released", hold=number)
            return
        order = self._life.release(number)
        self._guard.release()
        self._tell(order, "released", "The car is released: whoever drives it commands again.", by=by)

    # -- within ------------------------------------------------------------------------------------------------------

    def _watch_way(self, way: Way) -> None:
        """A topic that changes its type or goes disarms: what was confirmed is not so any more. An order goes on."""
        before, self._way = self._way, way
        if self._life.armed_by is None or self._life.order is not None:
            if self._life.order is not None and way.problem is not None:
                self._way = before  # the order goes on where it began, as soon as there is a link
            return
        if way.problem is not None or (way.topic, way.kind) != (before.topic, before.kind):
            why = way.problem or f"commands go to {way.topic} now."
            self._life.disarm()
            self._countdown.stop()
            self._note("disarmed", f"Slow-down is not armed any more: {why}")
        else:
            self._announce_way()

    def _announce_way(self) -> None:
        """Advertised before anything is ordered: a publisher needs a moment to find who listens."""
        way = self._way
        if way.type is not None and self._link is not None and self._link.is_open:
            self._mouth.advertise(way.topic, way.type)

    def _watch_rules(self, alarms: Mapping[str, Alarm], now_s: float, is_paused: bool) -> None:
        can_begin = self._life.order is None and self._life.armed_by is not None and self._way.problem is None
        over = self._countdown.look(alarms, self.limits, now_s, can_begin=can_begin and not is_paused)
        if over is not None and self._link is not None and self._link.is_open:  # else once the link is back
            self._begin("catgraph", over.trigger.title, now_s, pressed_s=None)

    def _speak_at_once(self) -> None:
        """Out of turn; the next one is due a period from now."""
        self._speak_safely()
        self._due_s = self._now() + PERIOD_S

    def _speak_safely(self) -> None:
        """A fault in one command must not end the others, nor the order."""
        try:
            self._speak()
        except Exception:
            log.exception("a command to the car failed")

    def _speak(self) -> None:
        """One command, now or not at all."""
        now_s = self._now()
        was_stalled, self._turned_s = now_s - self._turned_s > STALL_S, now_s
        order, link = self._life.order, self._link
        if order is None:
            return
        if link is None or not link.is_open:
            self._cut("the link to the car was lost")
            return
        is_stuck = link.unanswered >= UNDER_WAY
        proved_s = min(link.heard_s or 0.0, self._sent_s if is_stuck else now_s)
        if order.sending_s is not None and not was_stalled and now_s - proved_s > DOUBT_S:
            self._cut("the bridge does not answer")
            link.abort()
            return
        if is_stuck:
            return  # nothing is put behind what may be stuck
        way = self._way
        if way.kind is None or way.type is None:
            self._cut("the command topic is not confirmed yet")  # after a restart the car is asked first
            return
        car = self._car()
        is_measured = car.speed_mps is not None and car.tyre_rad is not None
        if not is_measured and order.ramp is None and now_s - self._opened_s < FIRST_SPEED_S:
            return  # a link that is back brings both at once: the ramp begins at what is measured
        if car.tyre_rad is None:
            car = replace(car, tyre_rad=self._tyre_rad)
        command = self._life.next(car, now_s)
        if command is None:
            self._cut("the tyre angle that is to be held is not known")
            return
        said = message(
            way.kind,
            command.speed_mps,
            command.tyre_rad,
            stamp_ns=self._wall_ms() * 1_000_000,
            ros_version=self._ros_version,
        )
        was_sending = order.sending_s is not None
        try:
            self._mouth.publish(way.topic, way.type, said)
            link.ping()
        except LinkDown:
            self._cut("the link to the car was lost")
            return
        except NotAllowed as why:
            self._cut(f"the command is not a valid message ({why})")
            return
        self._sent_s = now_s
        is_first = self._life.sent(command, now_s)
        self._record({"topic": way.topic, "type": way.type, "message": said, "by": order.by, "order": order.number})
        if not is_first and not was_sending:
            self._tell(order, "resumed", f"Commands reach the bridge again: {_said(order)}.")

    def _cut(self, why: str) -> None:
        order = self._life.order
        if self._life.cut() and order is not None:
            self._tell(
                order, "cut", f"No command goes out: {why}. It goes on when the link is back, if it still stands."
            )

    def _car(self) -> Car:
        """What is measured now. Where that cannot be made, an order goes on without it."""
        try:
            return self._measured()
        except Exception:
            log.exception("the car's speed and steering cannot be read")
            return Car(speed_mps=None, tyre_rad=None)

    def _measured(self) -> Car:
        snapshot = self._snapshot()
        speed, steering, ordered = snapshot.get("speed"), snapshot.get("steering"), snapshot.get("command")
        now_s = snapshot.now_s
        tyre_rad = None
        if not self.is_steering_known:
            tyre_rad = None
        elif steering is not None and self._is_of_now(steering, now_s):
            tyre_rad = steering.value.tyre_rad
        elif ordered is not None and self._is_of_now(ordered, now_s):
            tyre_rad = ordered.value.tyre_angle_rad
        is_known = speed is not None and self._is_of_now(speed, now_s)
        return Car(speed_mps=speed.value.speed_mps if speed is not None and is_known else None, tyre_rad=tyre_rad)

    def _is_of_now(self, reading: Reading[Any], now_s: float) -> bool:
        """Fresh, and not of before the link was lost: meanwhile the car may have done anything."""
        return reading.is_fresh(now_s) and reading.received_s >= self._opened_s

    def _prove(self, order: Order, now_s: float) -> None:
        snapshot = replace(self._snapshot(), slowing=self._facts())
        found = obeys(snapshot, self.limits, self._told_unconfirmed).verdict
        proof = proof_of(snapshot)
        if found is Verdict.OK:
            self._told_unconfirmed = False
            if proof.shown is None:
                self._tell_standing(order, stood_before=proof.stood_before)
            elif order.first_sent_s is not None and self._life.confirm(now_s):
                after = f"{now_s - order.first_sent_s:.1f} s after the first command"
                text = (
                    f"The car slows: shown by its own speed {after}."
                    if proof.shown == "slows"
                    else f"The car stopped: shown by its own speed {after}."
                )
                self._tell(order, "slows", text)
        elif found is Verdict.FAULT and not self._told_unconfirmed:
            self._told_unconfirmed = True
            self._tell(order, "not_confirmed", "NOT CONFIRMED: the car does not slow. Use the physical stop.")
        if found is not Verdict.OK:
            order.stands = None

    def _tell_standing(self, order: Order, *, stood_before: bool) -> None:
        """It stands, and nothing shows that the order did it: no more is claimed."""
        stands: Stands = "before" if stood_before else "unproven"
        if order.stands != stands:
            order.stands = stands
            self._tell(order, "stands", f"{STANDS_ALREADY if stood_before else STANDS_UNPROVEN}.")

    def _facts(self) -> SlowingFacts:
        order = self._life.order
        return SlowingFacts(
            is_armed=self._life.armed_by is not None,
            topic=self._way.topic,
            rivals=self.rivals or (),
            ordered_s=order.ordered_s if order else None,
            sending_s=order.sending_s if order else None,
            deceleration_mps2=order.deceleration_mps2 if order else 0.0,
            commanded_mps=order.last.speed_mps if order and order.last else None,
            ended_at_longest_s=self._life.ended_at_longest_s,
        )

    def _rivals_words(self) -> str:
        if self.rivals is None:
            return " Who else publishes there is not known."
        return (
            f" {', '.join(self.rivals)} also publish{'es' if len(self.rivals) == 1 else ''} there."
            if self.rivals
            else ""
        )

    def _tell(self, order: Order, step: str, text: str, *, by: str | None = None) -> None:
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
            topic=self._way.topic,
            stands=order.stands,
            tyre_rad=serialize.plain(last.tyre_rad, 4) if last else None,
        )

    # -- what pages see ----------------------------------------------------------------------------------------------

    def frame(self) -> dict[str, Any]:
        """The `decelerate` of a state."""
        now_s = self._now()
        way, order, life = self._way, self._life.order, self._life
        return {
            "state": life.state(way, now_s),
            "why": way.problem if order is None else None,
            "topic": way.topic or None,
            "type": way.type,
            "rivals": None if self.rivals is None else list(self.rivals),
            "armed_by": life.armed_by,
            "deceleration_mps2": serialize.plain(self.limits.deceleration_mps2, 2),
            "order": None if order is None else self._order(order, now_s),
            "countdown": self._countdown.frame(now_s),
            "guard": self._guard.frame(now_s),
        }

    def _order(self, order: Order, now_s: float) -> dict[str, Any]:
        def at_ms(moment_s: float | None) -> int | None:
            return None if moment_s is None else round(self._wall_ms() - (now_s - moment_s) * 1000)

        return {
            "number": order.number,
            "by": order.by,
            "why": order.why,
            "for_s": serialize.plain(now_s - order.ordered_s, 1),
            "from_mps": serialize.plain(order.from_mps, 2),
            "ordered_mps": serialize.plain(order.last.speed_mps, 2) if order.last else None,
            "deceleration_mps2": serialize.plain(order.deceleration_mps2, 2),
            "sending": order.sending_s is not None,
            "confirmed": False if self._told_unconfirmed else True if order.slows_s is not None else None,
            "stands": order.stands,
            "steps": {
                "pressed_ms": at_ms(order.pressed_s),
                "server_ms": at_ms(order.ordered_s),
                "bridge_ms": at_ms(order.first_sent_s),
                "slows_ms": at_ms(order.slows_s),
            },
            "longest_s": serialize.plain(self.limits.longest_s, 0),
        }


def _said(order: Order) -> str:
    last = order.last
    return "nothing yet" if last is None else f"{last.speed_mps:.2f} m/s, tyres at {last.tyre_rad:+.3f} rad"

"""Sends the commands of an order to the car, 20 times a second.

A command is made at the moment it is sent, and only while the bridge answers. A ping follows every command: with two
unanswered nothing more is sent, and where nothing is received for 0.3 s the socket is aborted, so that what the system
still holds is dropped with it (RFC 9293, RST) instead of arriving late.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from monitor.state import Reading, Snapshot
from server.rosbridge.live_source import CommandChannel, LinkDown
from server.rosbridge.outgoing import NotAllowed
from server.slowdown.command_target import CommandTarget, twist_message
from server.slowdown.order import Car, SlowDown
from server.slowdown.order_log import OrderLog, commanded
from server.slowdown.publisher import CommandPublisher

log = logging.getLogger("catgraph.slowing")

TIMER_S = 0.001  # timers of the event loop know whole milliseconds
PERIOD_S = 0.05  # the obstacle stopper lets a command count for 0.2 s
DOUBT_S = 0.3
FIRST_SPEED_S = 0.5
MOST_UNANSWERED = 2  # pings; where the bridge freezes, no more commands arrive late
STALL_S = 0.1  # a turn so late was our own fault: what the bridge sent meanwhile is still unread


class MeasuredCar:
    """Speed and steering of the car as measured now, for the next command.

    `snapshot`: what is known of the car now.
    """

    def __init__(self, snapshot: Callable[[], Snapshot]) -> None:
        self._snapshot = snapshot
        self.opened_s = 0.0  # the newest opening of the link; a reading from before it does not count
        self.is_steering_known = False  # whether an angle of the tyres follows from the steering signal
        self.tyre_rad: float | None = None  # the last known angle, in rad, positive to the left

    def now(self) -> Car:
        """The measured motion; unknown after an error, and an order continues without it."""
        try:
            return self._measured()
        except Exception:
            log.exception("speed and steering of the car cannot be read")
            return Car(speed_mps=None, tyre_rad=None)

    def update(self) -> bool:
        """Keeps the tyre angle; whether it is measured now."""
        measured_rad = self.now().tyre_rad
        if measured_rad is not None:
            self.tyre_rad = measured_rad
        return measured_rad is not None

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
        """Fresh, and not from before the link was lost: the car may have changed its speed since."""
        return reading.is_fresh(now_s) and reading.received_s >= self.opened_s


class Sender:
    """Of one vehicle. `now` is the session's clock in seconds, `wall_ms` the time of day; `record` keeps what was sent.

    `target` is set with each tick, and stays where an order began.
    """

    def __init__(
        self,
        life: SlowDown,
        order_log: OrderLog,
        car: MeasuredCar,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        record: Callable[[Mapping[str, Any]], None],
    ) -> None:
        self._life = life
        self._order_log = order_log
        self._car = car
        self._now = now
        self._wall_ms = wall_ms
        self._record = record
        self._link: CommandChannel | None = None
        self._ordered = asyncio.Event()
        self._turned_s = 0.0
        self._due_s = 0.0  # the next command
        self._sent_s = 0.0  # the newest command
        self.publisher = CommandPublisher()
        self.target = CommandTarget(problem="No car is connected.")
        self.ros_version = 1

    @property
    def is_linked(self) -> bool:
        """Whether a command can be sent now."""
        return self._link is not None and self._link.is_open

    def attach(self, link: CommandChannel) -> None:
        """The link is open: an active order resumes at once."""
        self._link = link
        self.publisher.attach(link)
        if self._life.order is not None:
            self.send_at_once()

    def link_closed(self) -> None:
        """The link may come back."""
        self.publisher.attach(None)
        self._cut("the link to the car was lost")

    def detach(self) -> None:
        """The car is not monitored any more."""
        self.publisher.attach(None)
        self._link = None
        self.target = CommandTarget(problem="No car is connected.")

    def announce(self) -> None:
        """Advertises the command topic before anything is ordered: a publisher needs a moment to find its listeners."""
        if self.target.type is not None and self.is_linked:
            with contextlib.suppress(LinkDown, NotAllowed):  # each command advertises too, and has the reason
                self.publisher.advertise(self.target.topic, self.target.type)

    def begin(self) -> None:
        """An order was given: the loop sends it, from the next turn on."""
        self._ordered.set()

    async def send_loop(self) -> None:
        """Send commands forever, without waiting for pages, checks or the disk.

        Restarted while an order is active, it resumes the order.
        """
        while True:
            if self._life.order is None:
                self._ordered.clear()
                await self._ordered.wait()
            await self._send_order()

    async def _send_order(self) -> None:
        """Send while an order is active."""
        while self._life.order is not None:
            left_s = self._due_s - self._now()
            if left_s > TIMER_S:
                await asyncio.sleep(left_s)
                continue  # one that was ordered meanwhile has its own time
            now_s, self._due_s = self._now(), self._due_s + PERIOD_S
            if self._due_s < now_s + TIMER_S:  # after a stall: what was missed is not sent at once
                self._due_s = now_s + PERIOD_S
            self.send_safely()

    def send_at_once(self) -> None:
        """Sends out of turn; the next command is due a period from now."""
        self.send_safely()
        self._due_s = self._now() + PERIOD_S

    def send_safely(self) -> None:
        """Sends one command. A fault in one must not end the others, nor the order."""
        try:
            self.send()
        except Exception:
            log.exception("command to the car failed")

    def send(self) -> None:
        """Sends one command, now or not at all."""
        now_s = self._now()
        was_stalled, self._turned_s = now_s - self._turned_s > STALL_S, now_s
        link = self._link
        if self._life.order is None or not self._may_send(now_s, was_stalled=was_stalled) or link is None:
            return
        if self.target.kind is None or self.target.type is None:
            self._cut("the command topic is not confirmed yet")  # after a restart the car's speed is needed first
            return
        car = self._car_for_command(now_s)
        if car is not None:
            self._publish(link, car, now_s)

    def _may_send(self, now_s: float, *, was_stalled: bool) -> bool:
        """Whether the link takes a command, and what was sent before was received."""
        order, link = self._life.order, self._link
        if link is None or not link.is_open:
            self._cut("the link to the car was lost")
            return False
        is_stuck = link.unanswered >= MOST_UNANSWERED
        proved_s = min(link.heard_s or 0.0, self._sent_s if is_stuck else now_s)
        is_sending = order is not None and order.sending_s is not None
        if is_sending and not was_stalled and now_s - proved_s > DOUBT_S:
            self._cut("the bridge does not answer")
            link.abort()
            return False
        return not is_stuck  # nothing is queued behind what may be stuck

    def _car_for_command(self, now_s: float) -> Car | None:
        """What the next command follows from; None: a link that was just opened brings the car's speed in a moment."""
        order, car = self._life.order, self._car.now()
        is_measured = car.speed_mps is not None and car.tyre_rad is not None
        is_ramp_new = order is not None and order.ramp is None
        if not is_measured and is_ramp_new and now_s - self._car.opened_s < FIRST_SPEED_S:
            return None
        return car if car.tyre_rad is not None else replace(car, tyre_rad=self._car.tyre_rad)

    def _publish(self, link: CommandChannel, car: Car, now_s: float) -> None:
        order, target = self._life.order, self.target
        if order is None or target.kind is None or target.type is None:
            return
        command = self._life.next(car, now_s)
        if command is None:
            self._cut("the tyre angle that is to be held is not known")
            return
        twist = twist_message(
            target.kind,
            command.speed_mps,
            command.tyre_rad,
            stamp_ns=self._wall_ms() * 1_000_000,
            ros_version=self.ros_version,
        )
        was_sending = order.sending_s is not None
        try:
            self.publisher.publish(target.topic, target.type, twist)
            link.ping()
        except LinkDown:
            self._cut("the link to the car was lost")
            return
        except NotAllowed as why:
            self._cut(f"the command is not a valid message ({why})")
            return
        self._sent_s = now_s
        is_first = self._life.sent(command, now_s)
        row = {"topic": target.topic, "type": target.type, "message": twist}
        self._record(row | {"by": order.by, "order": order.number})
        if not is_first and not was_sending:
            self._order_log.write(order, "resumed", f"Commands reach the bridge again: {commanded(order)}.")

    def _cut(self, why: str) -> None:
        order = self._life.order
        if self._life.cut() and order is not None:
            text = f"No command is sent: {why}. Sending resumes with the link, if the order is still active."
            self._order_log.write(order, "cut", text)

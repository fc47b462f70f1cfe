"""The hand-over of control of one car: offered and read back by commands, logged, and shown in its state."""

from __future__ import annotations

from typing import assert_never

from monitor.alarm import Alarm, AlarmState
from monitor.runner import Refused
from server.control import display_name
from server.control.authorization import Authorization, Caller
from server.control.handover import Handover, Line, NotReadBack, version_of
from server.control.lease import Operator
from server.judge.active_settings import ActiveSettings
from server.protocol import handover_commands, serialize
from server.protocol.alarm_state import Note
from server.protocol.messages import Answer
from server.protocol.operator_state import HandoverState
from server.slowdown.controller import SlowDownController
from server.vehicle import phone
from server.vehicle.car_departure import CarDeparture
from server.vehicle.car_driving import CarDriving
from server.vehicle.handover_lines import (
    alarm_key,
    alarm_lines,
    departure_line,
    driving_line,
    in_car_line,
    limit_lines,
    mode_lines,
    stop_lines,
)
from server.vehicle.judgement import Judgement
from server.vehicle.pause import CarPlannedStop, Pause

MOST_OWNERS = 100  # of which it is known that they are off duty


class CarHandover:
    """Of one vehicle; its session is the only writer. Times are on the session's monotonic clock, in seconds."""

    def __init__(
        self,
        judgement: Judgement,
        settings: ActiveSettings,
        authorization: Authorization,
        pause: Pause,
        planned_stop: CarPlannedStop,
        slow_down: SlowDownController,
        driving: CarDriving,
        departure: CarDeparture,
        note: Note,
    ) -> None:
        self._judgement = judgement
        self._settings = settings
        self._authorization = authorization
        self._pause = pause
        self._planned_stop = planned_stop
        self._slow_down = slow_down
        self._driving = driving
        self._departure = departure
        self._note = note
        self._handover = Handover()
        self._since_ms = 0  # when it was offered; the same in every state, by which pages distinguish offers
        self._owners_off: dict[
            str, int
        ] = {}  # owners of acknowledged alarms, and when their duty ended, as logged last

    def tick(self, now_s: float) -> bool:
        """Time passes, or control changed; whether the offer ended by it."""
        gate = self._authorization
        ended = self._handover.advance(gate.lease, lambda one: gate.is_here(one, now_s), now_s)
        if ended is not None:
            self._log_step("ended", ended, None)
        return ended is not None

    def watch_owners(self) -> None:
        """Log that an owner of acknowledged alarms is off duty, and on duty again: a replay knows it by that."""
        acknowledged = [one for one in self._judgement.monitor.standing() if one.state is AlarmState.ACKED]
        owners = sorted({one.acknowledged_by or "" for one in acknowledged} - {""})
        self._authorization.owners = frozenset(display_name.person_of(owner) or "" for owner in owners)
        for owner in owners:
            off_ms, logged_ms = self._authorization.off_duty_ms(owner), self._owners_off.pop(owner, None)
            if off_ms is not None:
                self._owners_off = dict([*self._owners_off.items(), (owner, off_ms)][-MOST_OWNERS:])
            if (off_ms is None) != (logged_ms is None):  # web nodes may state another moment each
                titles = ", ".join(one.spec.title for one in acknowledged if one.acknowledged_by == owner)
                does = "is off duty and" if off_ms is not None else "is on duty again, and"
                self._note("owner", f"{owner} {does} has acknowledged: {titles}.", owner=owner, off_duty_ms=off_ms)

    def execute(
        self, command: handover_commands.HandoverCommand, caller: Caller, now_s: float, wall_ms: int
    ) -> Operator | None:
        """Who was in control until now, where control changed by it; None: it did not. Raises Refused."""
        self._authorization.tick(now_s)
        self.tick(now_s)
        by, handover = caller.operator, self._handover
        if by is None:
            raise Refused("Only a page can hand control over: a program cannot show that somebody is watching.")
        match command:
            case handover_commands.OfferControl():
                to = self._authorization.find(command.to, now_s)
                if to is None:
                    raise Refused("That page is closed or not visible.")
                if handover.begin(by, self._authorization.lease, to, now_s):
                    self._since_ms = wall_ms
                    self._authorization.answer(to)
                    self._log_step(
                        "offered", f"{by.name} offers control to {to.name}, who reads back what is in force.", by
                    )
            case handover_commands.ReadBack():
                handover.read(by, command.line, command.is_read, self.lines(now_s, wall_ms))
            case handover_commands.AcceptControl():
                return self._accept(by, command.version, now_s, wall_ms)
            case handover_commands.EndOffer():
                offer = handover.end(by)
                text = (
                    f"{by.name} declined control: {offer.by.name} keeps it."
                    if by.is_same(offer.to)
                    else f"{by.name} does not offer control to {offer.to.name} any more."
                )
                self._log_step("declined" if by.is_same(offer.to) else "withdrawn", text, by)
            case _:
                assert_never(command)
        return None

    def _accept(self, by: Operator, version: str, now_s: float, wall_ms: int) -> Operator:
        lines = self.lines(now_s, wall_ms)
        offer = self._handover.accept(by, version, lines)
        self._authorization.hand_over(offer.by, offer.fence, offer.to, now_s)
        titles = "; ".join(line.title for line in lines)
        self._log_step("accepted", f"{by.name} read back what is in force: {titles}.", by)
        keys = {line.key for line in lines}

        def is_read_back(alarm: Alarm) -> bool:
            return any(alarm_key(kind, alarm.id, alarm.occurrence) in keys for kind in ("alarm", "shelved"))

        self._judgement.report(self._judgement.monitor.hand_over(is_read_back, by.name, now_s))
        return offer.by

    def take_alarm(self, command: handover_commands.TakeAlarm, caller: Caller, now_s: float) -> None:
        """Make who sends it the owner of an acknowledged alarm whose owner is off duty. Raises Refused."""
        monitor = self._judgement.monitor
        alarm = monitor.alarms.get(command.alarm)
        if alarm is None or alarm.state is not AlarmState.ACKED or alarm.occurrence != command.occurrence:
            raise Refused("This alarm is not an acknowledged one any more: look at the list again.")
        if self._authorization.off_duty_ms(alarm.acknowledged_by) is None:
            raise Refused(f"{alarm.spec.title}: {alarm.acknowledged_by} has acknowledged it and is not off duty.")
        if caller.person is None and self._authorization.has_people:
            raise Refused("Sign on first: only a person who is on duty takes an alarm over.")
        self._judgement.report(monitor.take_over(command.alarm, caller.name, now_s, is_read_back=True))

    def refusal(self, why: NotReadBack, now_s: float, wall_ms: int) -> Answer:
        """The answer to a read-back that does not match, with the present list."""
        return {"ok": False, "reason": why.reason, "handover": self.as_json(now_s, wall_ms)}

    def lines(self, now_s: float, wall_ms: int) -> list[Line]:
        """The present list."""
        judgement, slow_down = self._judgement, self._slow_down.frame()
        off_duty_ms = self._authorization.off_duty_ms
        standing = [serialize.alarm(one, now_s, wall_ms, None, off_duty_ms) for one in judgement.monitor.standing()]
        compared = phone.as_json(judgement.snapshot().phone, now_s)
        is_riding = compared is not None and not compared["handheld"]
        return [
            *alarm_lines(standing),
            *limit_lines(self._settings.as_json()),
            in_car_line(
                self._authorization.people(now_s), compared["label"] if compared is not None and is_riding else None
            ),
            driving_line(self._driving.frame(now_s, wall_ms)),
            departure_line(self._departure.state(), self._departure.failed_items),
            *stop_lines(self._planned_stop.stop, now_s, wall_ms),
            *mode_lines(
                slow_down["state"], slow_down["why"], self._pause.by, is_paused=self._pause.since_s is not None
            ),
        ]

    def as_json(self, now_s: float, wall_ms: int) -> HandoverState | None:
        """The `handover` of a state; None: control is not being handed over."""
        offer = self._handover.offer
        if offer is None:
            return None
        lines = self.lines(now_s, wall_ms)
        return {
            "by": offer.by.name,
            "by_page": offer.by.page,
            "name": offer.to.name,
            "page": offer.to.page,
            "since_ms": self._since_ms,
            "lines": [
                {
                    "key": line.key,
                    "kind": line.kind,
                    "title": line.title,
                    "text": line.text,
                    "priority": line.priority,
                    "since_ms": line.since_ms,
                    "until_ms": line.until_ms,
                    "off_duty_ms": line.off_duty_ms,
                    "read": line.key in offer.read,
                }
                for line in lines
            ],
            "left": len(self._handover.unread(lines)),
            "version": version_of(lines),
        }

    def _log_step(self, step: str, text: str, by: Operator | None) -> None:
        self._note("hand_over", text, by=by.name if by else None, step=step)

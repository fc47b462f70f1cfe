"""Carries out the commands of pages, and answers what pages ask of a session."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping
from typing import Any, assert_never

from monitor.alarm import Refused, Transition
from monitor.runner import Monitor
from server.control import display_name
from server.control.authorization import Caller
from server.control.duty import acting_as
from server.control.handover import NotReadBack
from server.control.lease import Operator
from server.judge.phone_report import phone_report
from server.protocol import commands, drive_commands, handover_commands, serialize
from server.protocol.command_base import OfCar, Prompt
from server.protocol.messages import Answer
from server.protocol.state import LiveState
from server.rosbridge.address import BadAddress
from server.storage.storage_thread import StorageThread
from server.vehicle import departure_seen, phone, queries
from server.vehicle.outcomes import Outcomes, log_late, order_of
from server.vehicle.queries import check_answer
from server.vehicle.session_parts import SessionActions, SessionParts
from server.vehicle.settings_change import SettingsChange

log = logging.getLogger("catgraph.session")

# Nothing of the car changes by these, so one that is not on the disk was not executed.
RECORDS = (drive_commands.OfMark, drive_commands.OfDeparture, drive_commands.DescribeIntervention)
OTHER_CAR = "This was meant for {meant}, and this is {this}: nothing was sent to either."


class CommandHandler:
    """Of one vehicle. `now` is a monotonic clock in seconds, `wall_ms` the time of day in ms since 1970.

    A command is executed first, then logged: its reply does not depend on the log.
    """

    def __init__(
        self,
        vehicle: str,
        parts: SessionParts,
        actions: SessionActions,
        frame: Callable[[], LiveState],
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        storage: StorageThread | None = None,
    ) -> None:
        """`storage`: the thread that writes settings; None: the caller waits for the disk."""
        self._storage = storage
        self._settings = SettingsChange(parts, actions, now, storage)
        self._vehicle = vehicle
        self._parts = parts
        self._actions = actions
        self._frame = frame
        self._now = now
        self._wall_ms = wall_ms
        self._outcomes = Outcomes(now, self._log_given_up)

    async def handle(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """The answer to a command or a query."""
        found = self._query(message)
        if found is not None:
            return found
        return await self._outcomes.keep(message, self._carry_out)

    def _log_given_up(self, message: Mapping[str, Any], why: str) -> None:
        if (kind := order_of(message)) is not None:
            log_late(self._parts.event_log.note, kind, why, by=Caller.of(message).name)

    async def _carry_out(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        caller = Caller.of(message)
        with acting_as(caller.name, caller.person):
            return await self._execute(message, caller)

    async def _execute(self, message: Mapping[str, Any], caller: Caller) -> Mapping[str, Any]:
        parts, by = self._parts, caller.name
        try:
            command = commands.read(dict(message))
            if isinstance(command, commands.PresentWord):
                return self._present(command, caller)
            if isinstance(command, commands.AskOutcome):
                return self._outcomes.ask(caller.page, command.of, command.ago_s, self._now())
            self._check_meant(command, by)
            parts.authorization.admit(command, caller, self._now())
            was = await self._apply(command, caller)
        except NotReadBack as why:
            self._record(message, by=by, reason=why.reason)
            return parts.handover.refusal(why, self._now(), self._wall_ms())
        except queries.REFUSALS as why:
            if isinstance(why, BadAddress) and parts.connection.refuse(why):
                parts.publisher.put()
            refusal = queries.refusal(why)
            if message.get("kind") in commands.SLOW_DOWN and parts.connection.phase != "monitoring":
                refusal["outcome"], refusal["cut"] = "not_delivered", "agent-car"
            self._record(message, by=by, reason=refusal.get("reason"))
            return refusal
        self._record(message, by=by)
        answer: Answer = {"ok": True}
        if was is not None and was.person is not None:  # for the web node, which has who is on duty there
            answer["handed_over"] = {"device": was.person.device, "to": by}
        if isinstance(command, (commands.Set, commands.Import)):  # another version of the settings
            answer["version"] = parts.settings.settings.version
        if (fence := parts.authorization.fence_of(caller)) is not None:
            answer["fence"] = fence
        return answer

    def _check_meant(self, command: commands.LoggedCommand, by: str) -> None:
        """It must be for this car and for now. Raises Refused; what came too late, and any slow-down, is logged."""
        why = self._of_other_car(command)
        is_late = why is None
        if why is None and isinstance(command, Prompt):
            why = command.too_late(self._wall_ms())
        if why is None:
            return
        if is_late or isinstance(command, drive_commands.Decelerate):
            log_late(self._parts.event_log.note, command.kind, why, by=by)
        raise Refused(why)

    def _of_other_car(self, command: commands.LoggedCommand) -> str | None:
        """Why a command that acts on a car is not for this one; None: it is."""
        meant = command.vehicle if isinstance(command, OfCar) else None
        if meant is None or meant == self._vehicle:
            return None
        return OTHER_CAR.format(meant=display_name.clean(meant), this=self._vehicle)

    def _query(self, message: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """The answer to a query; None: it is a command."""
        parts, judgement = self._parts, self._parts.judgement
        match message.get("kind"):
            case "state":
                return self._frame()
            case "refresh":
                parts.publisher.put()
                return {"ok": True}
            case "announces":  # of a page that shows another car; no page can send it itself
                status, caller = commands.PresentWord.model_validate({**message, "kind": "present"}), Caller.of(message)
                parts.authorization.update_status_elsewhere(status, caller, self._now())
                if not status.leaves:
                    parts.attention.mark_present(caller, self._now())
                return {"ok": True}
            case "signals":
                topics = parts.connection.subscriptions
                return queries.signals(
                    topics.signals.candidates(topics.offered), topics.signals.unmapped, judgement.reception
                )
            case "settings":
                return {**parts.settings.as_json(), "toml": parts.settings.as_toml()}
            case "check":
                now_s = self._now()
                return dict(check_answer(judgement.monitor, str(message.get("check")), now_s, judgement.minute))
            case "driving" | "intervention":
                return parts.driving.answer(message, self._now(), self._wall_ms())
            case "departure":
                return self._parts.departure.answer()
            case "trends":
                return serialize.trends(judgement.trends.piece(self._now(), after=message.get("after")))
            case "drive_trends":
                return queries.drive_trends(judgement, message, self._now(), self._wall_ms())
            case "marks":
                return parts.marks.rows()
            case "mark_file":  # of the route that wrote it, into a folder of this server
                return parts.marks.answer_file(message)
            case "track":
                return queries.track(judgement.snapshot())
            case "track_points":
                after = message.get("after")
                return queries.track_points(
                    judgement.snapshot(),
                    number=judgement.track_number,
                    after=after if isinstance(after, int) else 0,
                )
        return None

    def _record(self, message: Mapping[str, Any], *, by: str, reason: str | None = None) -> None:
        """Record a command that was executed or refused; the reply does not depend on it."""
        try:
            self._parts.recording.note_command(message, by=by, reason=reason)
        except Exception:
            log.exception("command not recorded: vehicle=%s", self._vehicle)

    def _present(self, status: commands.PresentWord, caller: Caller) -> Answer:
        if not status.leaves:
            self._parts.attention.mark_present(caller, self._now())
        if self._parts.authorization.update_status(status, caller, self._now()):
            self._parts.publisher.put_soon()
        return {"ok": True}

    async def _apply(self, command: commands.LoggedCommand, caller: Caller) -> Operator | None:
        """Who handed control over by it. Each command has exactly one case here. Raises one of queries.REFUSALS."""
        parts, now_s, by = self._parts, self._now(), caller.name
        match command:
            case commands.Set() | commands.Import():
                await self._settings.change(command, caller)
                return None
            case commands.Connect():
                self._actions.connect(command.address, by=by)
            case commands.Retry():
                if parts.connection.link is None:
                    raise Refused("There is no address to dial.")
                parts.connection.link.retry_now()
            case commands.Disconnect():
                self._actions.disconnect(by=by)
            case commands.Pause():
                parts.pause.begin(parts.judgement.state, now_s, by=by)
            case commands.Resume():
                if parts.pause.end(parts.judgement.state, by=by):
                    parts.judgement.judge(now_s)
            case drive_commands.OfPlannedStop():
                self._plan_stop(command, now_s, by=by)
            case commands.Record():
                await self._record_by_hand(command.on, by=by)
                return None
            case commands.Acknowledge() | commands.Silence() | commands.Shelve() | commands.Unshelve():
                judgement = parts.judgement
                judgement.report(respond(judgement.monitor, command, now_s, by))
            case handover_commands.TakeAlarm():
                parts.handover.take_alarm(command, caller, now_s)
            case commands.TakeControl():
                parts.authorization.execute(command, caller, now_s)
                self._actions.attention_changed()  # the queue shows who requests control
            case handover_commands.OfHandover():
                was = parts.handover.execute(command, caller, now_s, self._wall_ms())
                parts.publisher.put()
                return was
            case drive_commands.OfDeparture():
                await parts.departure.execute(command, caller, self._wall_ms(), self._storage)
            case handover_commands.OfItem():
                parts.attention.execute(command, caller, now_s)
                self._actions.attention_changed()
                return None  # the state has nothing of it
            case commands.Ride():
                self._ride(command.phone, now_s, by=by)
            case drive_commands.DescribeIntervention():
                parts.driving.describe(command, by=by)
            case drive_commands.OfMark():
                parts.marks.execute(command, by=by, source="http" if caller.page is None else "page")
            case drive_commands.OfSlowing():
                parts.slow_down.execute(command, by=by)
                self._actions.slow_down_ordered()
            case commands.Position():
                self._receive_position(command, now_s, by=by)
                return None  # many phones may report every second; the next tick judges and puts a state
            case _:
                assert_never(command)
        await self._demand_stored(command)
        parts.publisher.put()
        return None

    async def _demand_stored(self, command: commands.LoggedCommand) -> None:
        """What was logged of a command that is only a record is on the disk. Raises Refused: it is not."""
        if not isinstance(command, RECORDS):
            return
        if self._storage is not None:
            await self._storage.run(lambda: None)  # behind the job that writes the log
        if (trouble := self._parts.event_log.trouble_of_disk()) is not None:
            raise Refused(trouble)

    async def _record_by_hand(self, is_on: bool, *, by: str) -> None:
        parts = self._parts
        parts.recording.order(is_on, by=by)
        parts.event_log.note("recording", f"Recording {'begins' if is_on else 'ends'}, by hand.", by=by)
        self._actions.recording_ordered()
        parts.publisher.put()
        await parts.recording.demand_settled()

    def _plan_stop(self, command: drive_commands.PlannedStopCommand, now_s: float, *, by: str) -> None:
        speed_mps, phase = departure_seen.speed_of(self._parts, now_s), self._parts.connection.phase
        self._parts.planned_stop.execute(command, now_s, by=by, phase=phase, speed_mps=speed_mps)
        self._actions.attention_changed()  # the summary of the car shows it

    def _receive_position(self, command: commands.Position, now_s: float, *, by: str) -> None:
        if self._parts.connection.phase == "idle":
            raise Refused("No car is monitored: no position is needed.")
        self._parts.judgement.state.receive_phone(phone_report(command, now_s, self._wall_ms(), by), now_s)

    def _ride(self, phone_: str | None, now_s: float, *, by: str) -> None:
        judgement = self._parts.judgement
        judgement.ride(phone_, now_s)
        judgement.judge(now_s)
        self._parts.event_log.note("ride", phone.phone_in_car_text(judgement.snapshot(), phone_), by=by, phone=phone_)


def respond(
    monitor: Monitor,
    command: commands.Acknowledge | commands.Silence | commands.Shelve | commands.Unshelve,
    now_s: float,
    by: str,
) -> Collection[Transition]:
    """Carries out what an operator does about an alarm.

    What changed by it. Raises Refused.
    """
    match command:
        case commands.Acknowledge():
            return monitor.acknowledge(command.alarm, command.occurrence, by=by, now_s=now_s)
        case commands.Silence():
            return monitor.silence(command.alarm, command.occurrence, by=by, now_s=now_s)
        case commands.Shelve():
            return monitor.shelve(command.alarm, command.occurrence, minutes=command.minutes, by=by, now_s=now_s)
        case _:
            return monitor.unshelve(command.alarm, by=by, now_s=now_s)

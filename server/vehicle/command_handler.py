"""Carries out the commands of pages, and answers what pages ask of a session."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, assert_never

from monitor.alarm import Refused
from server.control import display_name
from server.control.authorization import Caller
from server.judge.phone_report import phone_report
from server.judge.settings import Settings
from server.protocol import commands, serialize
from server.protocol.messages import Answer
from server.protocol.state import LiveState
from server.rosbridge.address import BadAddress
from server.storage.storage_thread import StorageThread
from server.vehicle import phone, queries
from server.vehicle.check_detail import check_answer
from server.vehicle.session_parts import SessionActions, SessionParts

log = logging.getLogger("catgraph.session")


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
        self._changing = asyncio.Lock()
        self._vehicle = vehicle
        self._parts = parts
        self._actions = actions
        self._frame = frame
        self._now = now
        self._wall_ms = wall_ms

    async def handle(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """The answer to a command or a query."""
        found = self._query(message)
        if found is not None:
            return found
        parts = self._parts
        caller = Caller.of(message)
        by = caller.name
        try:
            command = commands.read(dict(message))
            if isinstance(command, commands.PresentWord):
                return self._present(command, caller)
            self._check_car(command, by)
            parts.authorization.admit(command, caller, self._now())
            await self._apply(command, caller)
        except queries.REFUSALS as why:
            if isinstance(why, BadAddress) and parts.connection.refuse(why):
                parts.publisher.put()
            refusal = queries.refusal(why)
            self._record(message, by=by, reason=refusal.get("reason"))
            return refusal
        self._record(message, by=by)
        answer: Answer = {"ok": True}
        if isinstance(command, (commands.Set, commands.Import)):  # another version of the settings
            answer["version"] = parts.settings.settings.version
        if (fence := parts.authorization.fence_of(caller)) is not None:
            answer["fence"] = fence
        return answer

    def _check_car(self, command: commands.LoggedCommand, by: str) -> None:
        """A command that acts on a car must be for this one. Raises Refused; a slow-down that is refused is logged."""
        meant = command.vehicle if isinstance(command, commands.OfCar) else None
        if meant is None or meant == self._vehicle:
            return
        why = (
            f"This was meant for {display_name.clean(meant)}, and this is {self._vehicle}: nothing was sent to either."
        )
        if isinstance(command, commands.Decelerate):
            self._parts.event_log.note("slow_down", f"Slow-down refused: {why}", by=by, step="refused")
        raise Refused(why)

    async def _change_settings(self, command: commands.Set | commands.Import, caller: Caller) -> None:
        """Stores settings and puts them in force; both happen though the caller waits no longer.

        Raises BadSetting, Conflict, OSError.
        """
        parts, by = self._parts, caller.name
        if isinstance(command, commands.Import):  # a file may take a while to read, and control may pass meanwhile
            read = await asyncio.to_thread(parts.settings.read, command.toml)
            parts.authorization.admit(command, caller, self._now())
            prepare = partial(parts.settings.prepare_all, read)
        else:
            prepare = partial(
                parts.settings.prepare,
                values=command.values,
                topics=command.topics,
                profile=command.profile,
                version=command.version,
            )
        await asyncio.shield(asyncio.create_task(self._store_and_adopt(prepare, by), name="change settings"))

    async def _store_and_adopt(self, prepare: Callable[[], Settings], by: str) -> None:
        settings = self._parts.settings
        async with self._changing:  # one after the other: each is prepared from what the one before put in force
            new = prepare()
            if self._storage is None:
                settings.store(new)
            else:
                await self._storage.run(lambda: settings.store(new))
            self._actions.settings_changed(settings.adopt(new), by=by)
            self._parts.publisher.put()

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
                word = commands.PresentWord.model_validate({**message, "kind": "present"})
                parts.authorization.hear_elsewhere(word, Caller.of(message), self._now())
                return {"ok": True}
            case "signals":
                topics = parts.connection.subscriptions
                return queries.signals(topics.signals.unmapped, judgement.reception, topics.offered)
            case "settings":
                return {**parts.settings.as_json(), "toml": parts.settings.as_toml()}
            case "check":
                now_s = self._now()
                return dict(check_answer(judgement.monitor, str(message.get("check")), now_s, judgement.minute))
            case "trends":
                return serialize.trends(judgement.trends.piece(self._now(), after=message.get("after")))
            case "drive_trends":
                return queries.drive_trends(judgement, message, self._now(), self._wall_ms())
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
            self._parts.recording.asked(message, by=by, reason=reason)
        except Exception:
            log.exception("command not recorded: vehicle=%s", self._vehicle)

    def _present(self, word: commands.PresentWord, caller: Caller) -> Answer:
        if self._parts.authorization.hear(word, caller, self._now()):
            self._parts.publisher.put_soon()
        return {"ok": True}

    async def _apply(self, command: commands.LoggedCommand, caller: Caller) -> None:
        """Each command has exactly one case here. Raises one of queries.REFUSALS."""
        parts, now_s, by = self._parts, self._now(), caller.name
        match command:
            case commands.Set() | commands.Import():
                await self._change_settings(command, caller)
                return
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
            case commands.Record():
                parts.recording.order(command.on, by=by)
                begins = "begins" if command.on else "ends"
                parts.event_log.note("recording", f"Recording {begins}, by hand.", by=by)
                self._actions.recording_ordered()
                parts.publisher.put()
                await parts.recording.demand_settled()
                return
            case commands.Acknowledge() | commands.Silence() | commands.Shelve() | commands.Unshelve():
                self._respond(command, now_s, by)
            case commands.TakeControl():
                parts.authorization.obey(command, caller, now_s)
            case commands.Ride():
                self._ride(command.phone, now_s, by=by)
            case commands.Arm() | commands.Disarm() | commands.Decelerate() | commands.Release() | commands.Veto():
                parts.slow_down.obey(command, by=by)
                self._actions.slow_down_ordered()
            case commands.Position():
                if parts.connection.phase == "idle":
                    raise Refused("No car is monitored: no position is needed.")
                parts.judgement.state.receive_phone(phone_report(command, now_s, self._wall_ms(), by), now_s)
                return  # many phones may report every second; the next tick judges and puts a state
            case _:
                assert_never(command)
        parts.publisher.put()

    def _respond(
        self,
        command: commands.Acknowledge | commands.Silence | commands.Shelve | commands.Unshelve,
        now_s: float,
        by: str,
    ) -> None:
        """What an operator does about an alarm."""
        judgement = self._parts.judgement
        match command:
            case commands.Acknowledge():
                found = judgement.monitor.acknowledge(command.alarm, command.occurrence, by=by, now_s=now_s)
            case commands.Silence():
                found = judgement.monitor.silence(command.alarm, command.occurrence, by=by, now_s=now_s)
            case commands.Shelve():
                found = judgement.monitor.shelve(
                    command.alarm, command.occurrence, minutes=command.minutes, by=by, now_s=now_s
                )
            case _:
                found = judgement.monitor.unshelve(command.alarm, by=by, now_s=now_s)
        judgement.report(found)

    def _ride(self, phone_: str | None, now_s: float, *, by: str) -> None:
        judgement = self._parts.judgement
        judgement.ride(phone_, now_s)
        judgement.judge(now_s)
        self._parts.event_log.note("ride", phone.phone_in_car_text(judgement.snapshot(), phone_), by=by, phone=phone_)

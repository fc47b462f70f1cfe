"""Controls when one vehicle is recorded and in which parts: with monitoring or manually, held while the link is lost.

A session of recording is one id and one or more parts, a file each: a part ends when the link is lost, and the next
begins when it returns in time. What is recorded is handed to the recorder's thread; nothing here waits for a disk.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from monitor.runner import Refused
from monitor.shell_facts import RecorderFacts
from server.judge.active_settings import ActiveSettings
from server.protocol.recording_state import RecordingState
from server.recording.delay import LinkDelay
from server.recording.folder import RecordingsFolder
from server.recording.own import Own
from server.recording.parts import RecordingParts
from server.recording.recorded_topics import Also, Missing
from server.recording.recorder_queue import Attachment
from server.recording.recording_clock import ClockHistory
from server.recording.recording_session import ControllerState, RecordingSettings
from server.recording.recording_status import NOWHERE, RecordingStatus
from server.rosbridge.address import without_login


class SessionRecording:
    """Of one vehicle. `now` is a monotonic clock [s], `wall_ms` the time of day [ms since 1970]. `on_finished(path)` is
    called for each finished part; `folder` None: this server stores nothing."""

    def __init__(
        self,
        vehicle: str,
        folder: RecordingsFolder | None,
        tuning: ActiveSettings,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        on_finished: Callable[[Path], None] = lambda _: None,
        unreadable: Callable[[str, str], None] = lambda *_: None,
    ) -> None:
        """`unreadable(topic, why)` is called for each message that came unparsed and could not be read."""
        self._folder = folder
        self._now = now
        self._settings = RecordingSettings(tuning)
        self._state = ControllerState()
        self._parts = RecordingParts(
            vehicle,
            folder,
            self._settings,
            self._state,
            now=now,
            wall_ms=wall_ms,
            on_finished=on_finished,
            on_unreadable=unreadable,
        )
        self._status = RecordingStatus(self._state, self._parts, self._settings, has_folder=folder is not None)

    @property
    def ros_version(self) -> int | None:
        """Of the car; None: not known yet."""
        return self._state.ros_version

    @ros_version.setter
    def ros_version(self, version: int | None) -> None:
        self._state.ros_version = version

    @property
    def missing(self) -> Missing:
        """What of the car is not recorded."""
        return self._state.missing

    @missing.setter
    def missing(self, missing: Missing) -> None:
        self._state.missing = missing

    @property
    def history(self) -> ClockHistory:
        """What the server's clock was, and that of each recording."""
        return self._parts.history

    def prepare(self) -> None:
        """Gets ready to record, so that the first message finds all that it needs."""
        self._parts.prepare()

    def on_closing(self, settle: Callable[[], None]) -> None:
        """`settle` is called before each part ends, while messages are still taken."""
        self._parts.on_closing = settle

    # -- events of the session ---------------------------------------------------------------------------------------

    def link_opened(self, address: str | None) -> None:
        """Monitoring of a car starts, or resumes after a lost link."""
        self._state.address = address
        self._state.is_monitoring = True
        session, now_s = self._state.session, self._now()
        if session is not None and session.lost_s is not None:
            if now_s - session.lost_s <= self._settings.value("hold_s"):
                self._parts.resume(session, now_s)
                return
            self._state.session = None
        if (
            self._state.session is None
            and self._folder is not None
            and self._settings.value("automatic") >= 1
            and not self._state.stopped_by
        ):
            self._parts.start(by=None)

    def link_lost(self) -> None:
        """What was recorded is completed at once; the session waits for the link."""
        self._state.is_monitoring = False
        session = self._state.session
        if session is not None and session.lost_s is None:
            session.lost_s, session.due_s = self._now(), None
            self._parts.close("The link to the car was lost.")
            if self._settings.value("hold_s") <= 0:
                self._state.session = None

    def ended(self, why: str = "Monitoring was stopped.") -> None:
        """Monitoring of this car is over; what is recorded of the next one is another session."""
        self._state.is_monitoring = False
        self._state.stopped_by = None
        self._parts.close(why)
        self._state.session = None
        self._parts.forget()

    def order(self, on: bool, *, by: str) -> None:
        """By hand. Raises Refused."""
        if not on:
            if self._state.session is None:
                raise Refused("Nothing is being recorded.")
            self._state.stopped_by = by
            self._parts.close(f"Recording was stopped by {by}.")
            self._state.session = None
            return
        if self._folder is None:
            raise Refused(NOWHERE)
        if not self._state.is_monitoring:
            raise Refused("No car is connected, so there is nothing to record.")
        if self._state.session is not None and self._status.state() != "stopped":
            raise Refused("It is already being recorded.")
        self._state.session = None
        self._state.stopped_by = None
        self._parts.begin(self._parts.start(by=by))

    async def demand_settled(self, *, within_s: float = 2.0) -> None:
        """Wait until the disk accepts the new part. Raises Refused if it does not."""
        until_s = self._now() + within_s
        session = self._state.session

        def is_open() -> bool:
            return (
                session is None
                or session is not self._state.session
                or self._parts.is_current(session)
                or self._now() >= until_s
            )

        while not is_open():  # noqa: ASYNC110
            await asyncio.sleep(0.02)
        why = self._status.why_stopped()
        if why is not None:
            raise Refused(why)

    def take(self, topic: str, type: str | None, message: Any, now_s: float, size: int) -> None:
        """A message of the car, or the RawFrame that holds it."""
        self._parts.take(topic, type, message, now_s, size)

    def hold(self, topic: str, type: str | None, message: Any) -> None:
        """A message that is sent once and holds for the whole drive: every later part begins with it."""
        self._parts.hold(topic, type, message)

    def holds(self, topic: str, message: Any) -> bool:
        """Whether a message is held, so that the part that is open has it."""
        return self._parts.holds(topic, message)

    def release(self) -> None:
        """What was held is of an earlier opening of the link."""
        self._parts.release()

    def own(self, channel: Own, fields: Mapping[str, Any]) -> None:
        """An entry of one of our own channels."""
        self._parts.own(channel, fields)

    def note_command(self, message: Mapping[str, Any], *, by: str, reason: str | None = None) -> None:
        """Record a page's command and the reason of a refusal. Phone positions have their own channel."""
        fields = {name: value for name, value in message.items() if name not in ("id", "by")}
        if isinstance(fields.get("address"), str):
            fields["address"] = without_login(fields["address"])
        if message.get("kind") == "position" and reason is None:
            self.own("phone", {"by": by} | {name: value for name, value in fields.items() if name != "kind"})
        else:
            self.own("operator", {"by": by, "ok": reason is None, "reason": reason} | fields)

    def mark(self, fields: Mapping[str, Any], marked_ms: int, at_ms: int) -> bool:
        """Record an entry of a mark; False: no part that is written covers its moment."""
        return self._parts.mark(fields, marked_ms, at_ms)

    def attach(self, attachment: Attachment) -> bool:
        """Stores a file in the part that is written; False: it does not cover the moment."""
        return self._parts.attach(attachment)

    def delays(self, delays: Mapping[str, float], link: LinkDelay) -> None:
        """Record the delay of messages once a tick, because a later evaluation needs it."""
        self._parts.delays(delays, link)

    def events(self, numbered: list[dict[str, Any]]) -> None:
        """Numbered events of the log."""
        for event in numbered:
            self.own("alarms", event)

    def remember(self, stood: Iterable[Mapping[str, Any]]) -> None:
        """Events of alarms that stand since before the server was started."""
        self._parts.early.remember(stood)

    def settings(self) -> None:
        """All settings, as they are in force now."""
        self.own("settings", self._settings.as_entry())

    def link(self, **fields: Any) -> None:
        """The link, whenever it changed."""
        self.own("link", fields | {"address": self._state.address, "ros_version": self.ros_version})

    def learn(self, definitions: Mapping[str, str]) -> None:
        """Definitions of types, in .msg text, as the bridge has them."""
        self._parts.learn(definitions)

    @property
    def part(self) -> tuple[str, int] | None:
        """The part that a message of the car would be recorded in: its session and number; None: it would not be."""
        session = self._state.session
        return (session.session, session.newest) if session is not None and session.lost_s is None else None

    @property
    def also(self) -> Also:
        """Which topics beyond those that are judged are to be recorded now."""
        if self._state.session is None or self._status.state() == "stopped" or self._settings.value("all_topics") < 1:
            return "none"
        return "all" if self._settings.value("bulky") >= 1 else "light"

    def tick(self, now_s: float) -> None:
        """Advance the time: a link that does not return ends the session; a silent car is recorded as such."""
        self.history.look()
        session = self._state.session
        if session is None:
            return
        if session.due_s is not None and now_s >= session.due_s:
            self._parts.begin(session)
        if session.is_open and session.begun is not None and self.ros_version not in (None, session.begun.version):
            self._parts.close("The ROS version became known: the recording continues in another part.")
            self._parts.begin(session)
        if session.lost_s is not None and now_s - session.lost_s > self._settings.value("hold_s"):
            self._state.session = None
        self._parts.tick(session, now_s)

    async def stop(self) -> None:
        """Completes what is being written; for the end of the server."""
        await self._parts.stop()

    # -- what others see ---------------------------------------------------------------------------------------------

    def facts(self, now_s: float) -> RecorderFacts:
        """For the checks."""
        return self._status.facts(now_s)

    def frame(self, now_s: float) -> RecordingState:
        """The `recording` of a state, as docs/protocol.md has it."""
        return self._status.frame(now_s)

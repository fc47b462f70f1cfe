"""Begins and ends the parts of a recording, and passes their content to the recorder."""

from __future__ import annotations

import asyncio
import contextlib
import math
import uuid
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from server.judge.message import RosVersion
from server.recording.delay import DelayWriter, LinkDelay
from server.recording.folder import RecordingsFolder, id_of, part_id
from server.recording.own import Own
from server.recording.recorded_topics import Missing
from server.recording.recorder import Recorder
from server.recording.recorder_queue import Attachment, Part
from server.recording.recorder_thread import Status
from server.recording.recording_clock import ClockHistory, RecordingClock
from server.recording.recording_session import ControllerState, RecordingSession, RecordingSettings
from server.recording.standing import EarlyEntries
from server.version import catgraph_version

EARLY_S = 10.0  # entries from before a session began are kept, if it was not long before: how it came to be connected
NOTE_EVERY_S = 2.0  # at most: what is missing in a part, written into it
BEGIN_AFTER_S = 2.0  # a silent car is recorded too, as silent
MOST_HELD = 100  # messages of transforms
SETTLE_S = 5.0  # a disk that takes longer is not waited for when the server ends


class RecordingParts:
    """One vehicle's. `folder` None: nothing is ever recorded."""

    def __init__(
        self,
        vehicle: str,
        folder: RecordingsFolder | None,
        settings: RecordingSettings,
        state: ControllerState,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        on_finished: Callable[[Path], None],
        on_unreadable: Callable[[str, str], None],
    ) -> None:
        self.recorder: Recorder | None = None
        self.early = EarlyEntries()
        self._vehicle = vehicle
        self._folder = folder
        self._settings = settings
        self._state = state
        self._now = now
        self._wall_ms = wall_ms
        self._on_finished = on_finished
        self._on_unreadable = on_unreadable
        self._definitions: dict[str, str] = {}
        self._held: dict[tuple[str, ...], tuple[str, str | None, Any]] = {}
        self._clock = RecordingClock(now, wall_ms)
        self.history = ClockHistory(now, wall_ms)
        self._ended_ms = 0
        self.on_closing: Callable[[], None] = lambda: None  # called before a part ends

    @property
    def status(self) -> Status:
        """The newest status of the recorder's thread."""
        return self.recorder.status if self.recorder is not None else Status()

    def is_current(self, session: RecordingSession) -> bool:
        """Whether the thread's status is of the newest part of this session."""
        return session.begun is not None and self.status.part is session.begun

    def prepare(self) -> None:
        """Gets ready to record, so that the first message finds all that it needs."""
        if self.recorder is None and self._folder is not None:
            self.recorder = Recorder(
                self._folder,
                call=asyncio.get_running_loop().call_soon_threadsafe,
                on_finished=self._finished,
                on_unreadable=self._on_unreadable,
                allowance=self._settings.allowance(),
            )
            self.recorder.prepare()

    def start(self, *, by: str | None) -> RecordingSession:
        """A session begins; its first part with the next message, or soon."""
        assert self._folder is not None
        now_s = self._now()
        if self.recorder is not None:
            self.recorder.forget_dropped()
        self._clock.start()
        self.history.recording_started()
        id = self._folder.first_id(self._vehicle, self._wall_ms())  # made unique by the thread, which may ask the disk
        session = RecordingSession(id=id, session=str(uuid.uuid4()), by=by, began_s=now_s, due_s=now_s + BEGIN_AFTER_S)
        self._state.session = session
        return session

    def resume(self, session: RecordingSession, now_s: float) -> None:
        """The link returned: the next part begins with the next message, or soon."""
        session.lost_s, session.due_s, session.begun = None, now_s + BEGIN_AFTER_S, None

    def begin(self, session: RecordingSession) -> None:
        """Begins the next part."""
        session.due_s = None
        session.part += 1
        session.is_open = True
        self.history.part_started()
        self._state.saved = None
        started_ms = self._clock.ms()  # in the same clock as the parts before
        settings = self._settings.as_entry()
        early = self.early.take(session.began_s - EARLY_S if session.part == 1 else -math.inf)
        part = self._part(session, started_ms, settings)
        self.prepare()
        assert self.recorder is not None
        self.recorder.allowance = self._settings.allowance()
        session.delays = DelayWriter()
        session.begun, session.noted, session.noted_s = part, None, -math.inf
        self.recorder.begin(part)
        if self._definitions:
            self.recorder.learn(self._definitions)
        for topic, type, message in self._held.values():
            self.recorder.take(topic, type, message, self._clock.ns(self._now()), 0, self._now())
        self.own("settings", settings)
        for channel, fields in early:
            self.own(channel, fields)

    def close(self, why: str) -> None:
        """Ends the part that is open, if one is."""
        session = self._state.session
        if session is not None and session.is_open and self.recorder is not None:
            self.on_closing()
            session.is_open = False
            self.history.part_ended()
            self._ended_ms = self._wall_ms()
            self._state.completing += 1
            self.recorder.end(ended="closed", why=why, then=self._completed, **self._state.missing.as_metadata())

    def take(self, topic: str, type: str | None, message: Any, now_s: float, size: int) -> None:
        """A message of the car, or the RawFrame that holds it."""
        session = self._state.session
        if session is None:
            return
        if session.due_s is not None:
            self.begin(session)
        if session.is_open and self.recorder is not None:
            self.recorder.take(topic, type, message, self._clock.ns(now_s), size, now_s)

    def hold(self, topic: str, type: str | None, message: Any) -> None:
        """Transforms that are sent once: a later part begins with them, for they are not sent again."""
        key = _held_as(topic, message)
        if key in self._held or len(self._held) < MOST_HELD:
            self._held[key] = topic, type, message

    def holds(self, topic: str, message: Any) -> bool:
        """Whether transforms are held, so that each part of this opening of the link has them."""
        return _held_as(topic, message) in self._held

    def release(self) -> None:
        """What was held is of an earlier opening of the link: the next one sends it anew."""
        self._held.clear()

    def own(self, channel: Own, fields: Mapping[str, Any]) -> None:
        """An entry of one of our own channels."""
        session = self._state.session
        if session is not None and session.is_open and self.recorder is not None:
            self.recorder.own(channel, self._clock.entry(fields), self._clock.ns(self._now()))
            self.early.note(channel, fields)
        elif self._folder is not None:
            self.early.hold(self._now(), channel, {"time_ms": self._wall_ms(), **fields})

    def mark(self, fields: Mapping[str, Any], marked_ms: int, at_ms: int) -> bool:
        """Record an entry of a mark at `at_ms`; False: the part that is written does not cover its moment."""
        recorder = self._covering(marked_ms)
        if recorder is not None:
            recorder.own("marks", self._clock.entry(fields), round(self._clock.moment_ms(at_ms)) * 1_000_000)
        return recorder is not None

    def attach(self, attachment: Attachment) -> bool:
        """False: the part that is written does not cover it."""
        at_ms = attachment.at_ns / 1e6
        recorder = self._covering(at_ms)
        if recorder is not None:
            moment_ns = attachment.at_ns + round(self._clock.moment_ms(at_ms) - at_ms) * 1_000_000
            recorder.attach(replace(attachment, at_ns=moment_ns))
        return recorder is not None

    def _covering(self, moment_ms: float) -> Recorder | None:
        """The recorder, where it writes a part that covers this moment."""
        session = self._state.session
        if session is None or not session.is_open or session.begun is None:
            return None
        started_ms = int(session.begun.metadata["started_ms"])
        return self.recorder if self._clock.moment_ms(moment_ms) >= started_ms else None

    def delays(self, delays: Mapping[str, float], link: LinkDelay) -> None:
        """Record the delay of messages once a tick, because a later evaluation needs it."""
        session = self._state.session
        if session is not None and session.is_open and self.recorder is not None:
            row = session.delays.row(delays, link)
            if row is not None:
                self.recorder.own("delay", row, self._clock.ns(self._now()))

    def tick(self, session: RecordingSession, now_s: float) -> None:
        """The settings of the disk's room hold at once; what is missing in the part is written into it."""
        if self.recorder is None:
            return
        self.recorder.allowance = self._settings.allowance()
        missing = self._state.missing
        is_due = now_s - session.noted_s >= NOTE_EVERY_S
        if session.is_open and missing != (session.noted or Missing()) and is_due:
            session.noted, session.noted_s = missing, now_s
            self.recorder.note(**missing.as_metadata())

    def learn(self, definitions: Mapping[str, str]) -> None:
        """Definitions of types, in .msg text, as the bridge has them."""
        self._definitions |= definitions
        session = self._state.session
        if session is not None and session.is_open and self.recorder is not None:
            self.recorder.learn(definitions)

    def forget(self) -> None:
        """The car is another one from now on: nothing that was learnt or held is of it."""
        self.early.clear()
        self._definitions.clear()
        self._held.clear()

    async def stop(self) -> None:
        """Completes what is being written; for the end of the server."""
        if self._state.session is not None and self._state.session.is_open:
            self.on_closing()
        recorder, self.recorder = self.recorder, None
        self._state.session = None
        if recorder is not None:
            done = asyncio.Event()
            recorder.stop(then=done.set)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(SETTLE_S):
                    await done.wait()

    def _part(self, session: RecordingSession, started_ms: int, settings: Mapping[str, Any]) -> Part:
        assert self._folder is not None
        version: RosVersion = 2 if self._state.ros_version == 2 else 1
        return Part(
            path=self._folder.place(self._vehicle, part_id(session.id, session.part)),
            version=version,
            metadata={
                "vehicle": self._vehicle,
                "address": self._state.address or "",
                "session": session.session,
                "part": str(session.part),
                "version": catgraph_version(),
                "started_ms": str(started_ms),
                "started_by": session.by or "",
                "profile": str(settings["profile"]),
                "settings": str(settings["toml"]),
                **self.early.standing(),
            },
        )

    def _completed(self) -> None:
        self._state.completing -= 1

    def _finished(self, path: Path) -> None:
        self._state.saved = id_of(path), self._ended_ms or self._wall_ms()
        self._on_finished(path)


def _held_as(topic: str, message: Any) -> tuple[str, ...]:
    """Transforms of the same frames replace each other."""
    rows = message.get("transforms") if isinstance(message, Mapping) else None
    children = [row.get("child_frame_id") for row in rows or () if isinstance(row, Mapping)]
    return (topic, *map(str, children[:MOST_HELD]))

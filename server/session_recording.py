"""When one vehicle is recorded and in which parts: with monitoring or by hand, held while the link is lost, until told.

A session of recording is one id and one or more parts, a file each: a part ends when the link is lost, and the next
begins when it returns in time. What is recorded is handed to the recorder's thread; nothing here waits for a disk.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import uuid
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from monitor.check import Limits
from monitor.recorder import RecorderFacts, RecorderState
from monitor.runner import Refused
from server import wire
from server.address import without_login
from server.others import Also, Missing
from server.recording import space
from server.recording.delay import DelayWriter, LinkDelay
from server.recording.folder import RecordingsFolder, id_of, part_id
from server.recording.own import Own
from server.recording.recorder import Part, Recorder, Status
from server.recording.space import Allowance
from server.recording.standing import Stood
from server.source import RosVersion
from server.tuning import Tuning
from server.version import catgraph_version

NOWHERE = "This server keeps nothing: it was started without a folder for data."
EARLY_AT_MOST = 200  # own words kept while no part is open: those of a gap stand at the beginning of the next part
EARLY_S = 10.0  # and those from before a session began, if it was not long before: how it came to be connected
NOTE_EVERY_S = 2.0  # at most: what is missing in a part, written into it
BEGIN_AFTER_S = 2.0  # a car that says nothing is recorded all the same: that it said nothing
SETTLE_S = 5.0  # a disk that takes longer is not waited for when the server ends
GB = 1e9


@dataclass(slots=True)
class _Tape:
    """One session of recording."""

    id: str  # of its first part, and of the session
    session: str
    by: str | None  # who began it; None: it began with monitoring
    began_s: float
    part: int = 0  # the one being written, or the last
    begun: Part | None = None
    is_open: bool = False  # the part is being written
    lost_s: float | None = None  # since when it is held
    due_s: float | None = None  # a part is to begin with the next message, or at this moment
    noted: Missing | None = None  # what the part says already of what is missing in it
    noted_s: float = -math.inf
    delays: DelayWriter = field(default_factory=DelayWriter)  # of the part

    @property
    def newest(self) -> int:
        """The part that is written, was written last, or is about to begin."""
        return self.part + 1 if self.due_s is not None else max(1, self.part)


class SessionRecording:
    """One vehicle's. `now` is a monotonic clock in seconds, `wall_ms` the time of day in ms since 1970. `told(path)` is
    called for each finished part; `folder` None: this server keeps nothing."""

    def __init__(
        self,
        vehicle: str,
        folder: RecordingsFolder | None,
        tuning: Tuning,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        told: Callable[[Path], None] = lambda _: None,
        unreadable: Callable[[str], None] = lambda _: None,
    ) -> None:
        """`unreadable(why)` is called for each message that came unparsed and could not be read."""
        self._vehicle = vehicle
        self._folder = folder
        self._tuning = tuning
        self._now = now
        self._wall_ms = wall_ms
        self._told = told
        self._unreadable = unreadable
        self._recorder: Recorder | None = None
        self._tape: _Tape | None = None
        self._early: list[tuple[float, Own, dict[str, Any]]] = []  # what was said while nothing was recorded, and when
        self._stood = Stood()  # the alarms, by what was written of them, or would have been
        self._definitions: dict[str, str] = {}
        self._anchor = (0.0, 0)  # a moment of `now`, and the time of day then [ns]: spacing stays true in a part
        self._is_monitoring = False
        self._refused_by: str | None = None  # who ended it by hand: it does not begin by itself again
        self._waiting = 0  # parts that are being completed
        self._saved: tuple[str, int] | None = None  # the newest finished part, and the time of day it reaches [ms]
        self._ended_ms = 0
        self._trouble: str | None = None
        self.address: str | None = None
        self.ros_version: int | None = None
        self.missing = Missing()

    def prepare(self) -> None:
        """Gets ready to record, so that the first message finds all that it needs."""
        if self._recorder is None and self._folder is not None:
            self._recorder = Recorder(
                self._folder,
                call=asyncio.get_running_loop().call_soon_threadsafe,
                on_finished=self._finished,
                on_unreadable=self._unreadable,
                allowance=self._allowance(),
            )
            self._recorder.prepare()

    # -- what the session says ---------------------------------------------------------------------------------------

    def link_opened(self, address: str | None) -> None:
        """Monitoring of a car begins, or goes on after its link was lost."""
        self.address = address
        self._is_monitoring = True
        tape, now_s = self._tape, self._now()
        if tape is not None and tape.lost_s is not None:
            if now_s - tape.lost_s <= self._limit("hold_s"):
                tape.lost_s, tape.due_s, tape.begun = None, now_s + BEGIN_AFTER_S, None
                return
            self._tape = None
        if self._tape is None and self._folder is not None and self._limit("automatic") >= 1 and not self._refused_by:
            self._start(by=None)

    def link_lost(self) -> None:
        """What was recorded is completed at once; the session waits for the link."""
        self._is_monitoring = False
        tape = self._tape
        if tape is not None and tape.lost_s is None:
            tape.lost_s, tape.due_s = self._now(), None
            self._close("The link to the car was lost.")
            if self._limit("hold_s") <= 0:
                self._tape = None

    def ended(self, why: str = "Monitoring was stopped.") -> None:
        """Monitoring of this car is over; what is recorded of the next one is another session."""
        self._is_monitoring = False
        self._refused_by = None
        self._close(why)
        self._tape = None
        self._early.clear()
        self._definitions.clear()

    def order(self, on: bool, *, by: str) -> None:
        """By hand. Raises Refused."""
        if not on:
            if self._tape is None:
                raise Refused("Nothing is being recorded.")
            self._refused_by = by
            self._close(f"Recording was stopped by {by}.")
            self._tape = None
            self._trouble = None
            return
        if self._folder is None:
            raise Refused(NOWHERE)
        if not self._is_monitoring:
            raise Refused("No car is connected: there is nothing to record.")
        if self._tape is not None and self._state() != "stopped":
            raise Refused("It is being recorded already.")
        self._tape = None
        self._refused_by = None
        self._start(by=by)
        assert self._tape is not None
        self._begin(self._tape)

    async def demand_settled(self, *, within_s: float = 2.0) -> None:
        """Waits until the disk has said whether it takes the part that was just begun. Raises Refused where not."""
        until_s = self._now() + within_s
        tape = self._tape

        def is_open() -> bool:
            return tape is None or tape is not self._tape or self._is_current(tape) or self._now() >= until_s

        while not is_open():  # noqa: ASYNC110
            await asyncio.sleep(0.02)
        why = self._why_stopped()
        if why is not None:
            raise Refused(why)

    def take(self, topic: str, type: str | None, message: Any, now_s: float, size: int) -> None:
        """A message of the car, or the RawFrame that holds it."""
        tape = self._tape
        if tape is None:
            return
        if tape.due_s is not None:
            self._begin(tape)
        if tape.is_open and self._recorder is not None:
            self._recorder.take(topic, type, message, self._ns(now_s), size, now_s)

    def own(self, channel: Own, said: Mapping[str, Any]) -> None:
        """Something of ours, on one of our channels."""
        tape = self._tape
        if tape is not None and tape.is_open and self._recorder is not None:
            self._recorder.own(channel, said, self._ns(self._now()))
            self._note(channel, said)
        elif self._folder is not None:
            self._early.append((self._now(), channel, {"time_ms": self._wall_ms(), **said}))
            for _, old, words in self._early[:-EARLY_AT_MOST]:
                self._note(old, words)
            del self._early[:-EARLY_AT_MOST]

    def asked(self, message: Mapping[str, Any], *, by: str, reason: str | None = None) -> None:
        """What a page asked for, and why it was refused, if it was. Where a phone is has a channel of its own."""
        said = {name: value for name, value in message.items() if name not in ("id", "by")}
        if isinstance(said.get("address"), str):
            said["address"] = without_login(said["address"])
        if message.get("kind") == "position" and reason is None:
            self.own("phone", {"by": by} | {name: value for name, value in said.items() if name != "kind"})
        else:
            self.own("operator", {"by": by, "ok": reason is None, "reason": reason} | said)

    def delays(self, delays: Mapping[str, float], link: LinkDelay) -> None:
        """How old what comes is, once a tick: whoever judges the recording must know it."""
        tape = self._tape
        if tape is not None and tape.is_open and self._recorder is not None:
            row = tape.delays.row(delays, link)
            if row is not None:
                self._recorder.own("delay", row, self._ns(self._now()))

    def events(self, numbered: list[dict[str, Any]]) -> None:
        """Numbered events of the log."""
        for event in numbered:
            self.own("alarms", event)

    def remember(self, stood: Iterable[Mapping[str, Any]]) -> None:
        """Events of alarms that stand since before the server was started."""
        self._stood.note_all(stood)

    def settings(self) -> None:
        """All settings, as they are in force now."""
        self.own("settings", self._settings())

    def link(self, **said: Any) -> None:
        """The link, whenever it changed."""
        self.own("link", said | {"address": self.address, "ros_version": self.ros_version})

    def learn(self, definitions: Mapping[str, str]) -> None:
        """Definitions of types, in .msg text, as the bridge has them."""
        self._definitions |= definitions
        if self._tape is not None and self._tape.is_open and self._recorder is not None:
            self._recorder.learn(definitions)

    @property
    def is_on(self) -> bool:
        """Whether a message of the car would be recorded."""
        return self._tape is not None and self._tape.lost_s is None

    @property
    def also(self) -> Also:
        """Which topics beyond those that are judged are to be recorded now."""
        if self._tape is None or self._state() == "stopped" or self._limit("all_topics") < 1:
            return "none"
        return "all" if self._limit("bulky") >= 1 else "light"

    def tick(self, now_s: float) -> None:
        """Time passes: a link that does not return ends the session, a car that says nothing is recorded as such."""
        tape = self._tape
        if tape is None:
            return
        if tape.due_s is not None and now_s >= tape.due_s:
            self._begin(tape)
        if tape.is_open and tape.begun is not None and self.ros_version not in (None, tape.begun.version):
            self._close("The version of ROS became known: the recording goes on in another part.")
            self._begin(tape)
        if tape.lost_s is not None and now_s - tape.lost_s > self._limit("hold_s"):
            self._tape = None
        if self._recorder is not None:
            self._recorder.allowance = self._allowance()
            if tape.is_open and self.missing != (tape.noted or Missing()) and now_s - tape.noted_s >= NOTE_EVERY_S:
                tape.noted, tape.noted_s = self.missing, now_s
                self._recorder.note(**self.missing.as_metadata())

    async def stop(self) -> None:
        """Completes what is being written; for the end of the server."""
        recorder, self._recorder = self._recorder, None
        self._tape = None
        if recorder is not None:
            done = asyncio.Event()
            recorder.stop(then=done.set)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(SETTLE_S):
                    await done.wait()

    # -- what others see ---------------------------------------------------------------------------------------------

    def facts(self, now_s: float) -> RecorderFacts:
        """For the checks."""
        recorder = self._recorder
        status = self._status()
        room, limit = self._room(status)
        return RecorderFacts(
            state=self._state(),
            trouble=self._why_stopped(),
            dropped=recorder.dropped if recorder is not None else 0,
            dropped_s=recorder.dropped_at_s if recorder is not None else None,
            behind_s=recorder.behind_s(now_s) if recorder is not None else 0.0,
            left_gb=room,
            limit=limit,
        )

    def frame(self, now_s: float) -> dict[str, Any]:
        """The `recording` of a state, as docs/protocol.md has it."""
        tape, status, recorder = self._tape, self._status(), self._recorder
        is_mine = tape is not None and self._is_current(tape)
        path = status.path if is_mine else None
        room, _ = self._room(status)
        return {
            "state": self._state(),
            "for_s": wire.plain(now_s - tape.began_s, 1) if tape is not None else None,
            "name": id_of(path) if path else part_id(tape.id, tape.newest) if tape is not None else None,
            "part": tape.newest if tape is not None else None,
            "bytes": status.size if is_mine else 0,
            "messages": status.messages if is_mine else 0,
            "as_json": status.misfits if is_mine else 0,
            "dropped": recorder.dropped if recorder is not None and tape is not None else 0,
            **(self.missing if tape is not None else Missing()).as_json(),
            "room_gb": wire.plain(room, 2),
            "saved": {"name": self._saved[0], "until_ms": self._saved[1]} if self._saved else None,
            "reason": self._reason(),
        }

    def _state(self) -> RecorderState:
        tape = self._tape
        if tape is None:
            return "saving" if self._waiting else "stopped" if self._trouble else "off"
        if tape.lost_s is not None:
            return "saving" if self._waiting else "held"
        if tape.is_open and self._status().state == "stopped" and self._is_current(tape):
            return "stopped"
        return "recording"

    def _is_current(self, tape: _Tape) -> bool:
        """Whether the thread speaks of the newest part of this session."""
        return tape.begun is not None and self._status().part is tape.begun

    def _why_stopped(self) -> str | None:
        return (self._status().trouble or self._trouble) if self._state() == "stopped" else None

    def _reason(self) -> str | None:
        """Why it is not recording, as a sentence; None while it is."""
        if self._folder is None:
            return NOWHERE
        match self._state():
            case "recording":
                return None
            case "stopped":
                return self._why_stopped()
            case "held" if self._saved is None:
                return f"The link is lost. {self._status().trouble or 'Nothing was recorded yet.'}"
            case "held":
                return (
                    "The link is lost: what was recorded is saved. A link that returns within "
                    f"{self._limit('hold_s'):g} s goes on with it."
                )
            case "saving":
                return "What was recorded is being saved."
        if self._refused_by:
            return f"Recording was stopped by {self._refused_by}."
        if not self._is_monitoring:
            return "No car is connected."
        return "Recording begins by hand: a setting." if self._limit("automatic") < 1 else None

    # -- parts -------------------------------------------------------------------------------------------------------

    def _start(self, *, by: str | None) -> None:
        assert self._folder is not None
        self._trouble = None
        now_s = self._now()
        if self._recorder is not None:
            self._recorder.dropped, self._recorder.dropped_at_s = 0, None
        id = self._folder.first_id(self._vehicle, self._wall_ms())  # made unique by the thread, which may ask the disk
        self._tape = _Tape(id=id, session=str(uuid.uuid4()), by=by, began_s=now_s, due_s=now_s + BEGIN_AFTER_S)

    def _begin(self, tape: _Tape) -> None:
        """The next part of a session."""
        assert self._folder is not None
        tape.due_s = None
        tape.part += 1
        tape.is_open = True
        self._saved = None
        now_s, wall_ms = self._now(), self._wall_ms()
        self._anchor = now_s, wall_ms * 1_000_000
        version: RosVersion = 2 if self.ros_version == 2 else 1
        settings = self._settings()
        early, self._early = self._early, []
        since_s = tape.began_s - EARLY_S if tape.part == 1 else -math.inf
        for at_s, channel, said in early:
            if at_s < since_s:
                self._note(channel, said)
        part = Part(
            path=self._folder.place(self._vehicle, part_id(tape.id, tape.part)),
            version=version,
            metadata={
                "vehicle": self._vehicle,
                "address": self.address or "",
                "session": tape.session,
                "part": str(tape.part),
                "version": catgraph_version(),
                "started_ms": str(wall_ms),
                "started_by": tape.by or "",
                "profile": str(settings["profile"]),
                "settings": str(settings["toml"]),
                **self._stood.as_metadata(),
            },
        )
        self.prepare()
        assert self._recorder is not None
        self._recorder.allowance = self._allowance()
        tape.delays = DelayWriter()
        tape.begun, tape.noted, tape.noted_s = part, None, -math.inf
        self._recorder.begin(part)
        if self._definitions:
            self._recorder.learn(self._definitions)
        self.own("settings", settings)
        for at_s, channel, said in early:
            if at_s >= since_s:
                self.own(channel, said)

    def _note(self, channel: Own, said: Mapping[str, Any]) -> None:
        if channel == "alarms":
            self._stood.note(said)

    def _close(self, why: str) -> None:
        tape = self._tape
        if tape is not None and tape.is_open and self._recorder is not None:
            tape.is_open = False
            self._ended_ms = self._wall_ms()
            self._trouble = self._status().trouble if self._state() == "stopped" else None
            self._waiting += 1
            self._recorder.end(ended="closed", why=why, then=self._completed, **self.missing.as_metadata())

    def _completed(self) -> None:
        self._waiting -= 1

    def _finished(self, path: Path) -> None:
        self._saved = id_of(path), self._ended_ms or self._wall_ms()
        self._told(path)

    def _status(self) -> Status:
        return self._recorder.status if self._recorder is not None else Status()

    def _room(self, status: Status) -> tuple[float | None, str]:
        """How many GB may still be recorded, and what ends it."""
        found, allowance = status.space, self._allowance()
        if found is None or self._tape is None:
            return None, ""
        by_quota = allowance.quota and allowance.quota - found.used < found.free - allowance.min_free
        limit = (
            f"recordings may take {space.amount(allowance.quota)}"
            if by_quota
            else f"{space.amount(allowance.min_free)} must stay free"
        )
        return found.left(allowance) / GB, limit

    def _allowance(self) -> Allowance:
        return Allowance(quota=round(self._limit("quota_gb") * GB), min_free=round(self._limit("min_free_gb") * GB))

    def _limit(self, name: str) -> float:
        limits: Limits = self._tuning.limits.recording
        return float(getattr(limits, name))

    def _settings(self) -> dict[str, Any]:
        return {
            "version": self._tuning.settings.version,
            "profile": self._tuning.profile.name,
            "toml": self._tuning.as_toml(),
            "in_force": self._tuning.in_force(),
        }

    def _ns(self, now_s: float) -> int:
        since_s, since_ns = self._anchor
        return since_ns + round((now_s - since_s) * 1e9)

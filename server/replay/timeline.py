"""The time line of a recording: speed, alarm marks, gaps; and the checkpoints for seeking.

Built in one pass over the recording, in small portions, while it is already viewed.
"""

from __future__ import annotations

import io
import logging
import math
import pickle
import zlib
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, cast

from monitor.alarm import AlarmMarks, Transition
from monitor.catalog import CHECKS
from monitor.drive_trends import DriveTrends
from monitor.state import State
from server.judge.drive import Drive
from server.judge.offline import Observer, OfflineRun
from server.judge.recorded_events import NewSettings
from server.judge.run_state import RunState
from server.judge.speed_trace import SpeedTrace
from server.protocol import serialize
from server.protocol.marks import DriveMark
from server.protocol.messages import DrivenSpan, IndexedTimeline, Mark, ReplayIntervention
from server.recording.drive.drive_events import Event, read_drive_events
from server.recording.drive.modes import Intervention, are_modes_known, interventions_of, mode_spans
from server.recording.marks.described import as_event
from server.recording.marks.recorded import described_late, marks_of
from server.recording.read.read import Recording
from server.recording.read.steady_time import span

MOST_TRANSITIONS = 20_000  # transitions of all alarms: days of a car in trouble
MOST_SHOWN = 300  # of one alarm, the newest

_BY_ID = {check.id: check for check in CHECKS}
_IDS = {id(check): check.id for check in CHECKS}

EMPTY_S = 60.0  # a gap without any message that is passed over; a shorter one is played
SHOWN_S, LEAD_S = 10.0, 2.0  # of its beginning and of its end

GAP_S = 1.0  # nothing at all was recorded for longer: a gap
KEYFRAMES = 240  # of some 20 kB each
LEAST_KEYFRAME_S = 10.0
MOST_NAMED = 5  # gaps in a sentence each
MOST_MARKS = 400  # more alarms than a person can view: the most urgent are kept
log = logging.getLogger("catgraph.playback")

MOST = 400  # of each on a time line
MOST_WORDS = 300  # letters


class AlarmHistory:
    """The alarms of a recording by check: what had happened by the moment that is shown.

    Times are seconds since the beginning of the recording.
    """

    def __init__(self) -> None:
        self._of: defaultdict[str, list[tuple[float, Transition]]] = defaultdict(list)
        self._count = 0
        self._full_s: float | None = None  # from here on transitions are missing

    def add(self, transition: Transition, at_s: float) -> None:
        """Keep it. `at_s`: when it became known; what stood before the recording is older than that."""
        if self._count >= MOST_TRANSITIONS:
            if self._full_s is None:
                self._full_s = at_s
            return
        self._count += 1
        self._of[transition.alarm_id].append((at_s, transition))

    def until(self, alarm: str, at_s: float) -> list[Transition] | None:
        """The transitions of one alarm up to a moment, the oldest first; None: some of them are missing."""
        if self._full_s is not None and at_s >= self._full_s:
            return None
        return [transition for known_s, transition in self._of[alarm] if known_s <= at_s][-MOST_SHOWN:]


def save_checkpoint(run_state: RunState) -> bytes:
    """Return the state of a run at a moment as bytes, from which the run can continue any number of times.

    A copy that later steps do not change; some 20 kB.
    """
    out = io.BytesIO()
    _Packer(out, protocol=5).dump(run_state)
    return zlib.compress(out.getvalue(), 1)


def restore_checkpoint(saved: bytes) -> RunState:
    """Restore the state of a run, a new object each time. Only for bytes that this process saved."""
    return cast(RunState, _Unpacker(io.BytesIO(zlib.decompress(saved))).load())


class _Packer(pickle.Pickler):
    def persistent_id(self, obj: Any) -> str | None:
        """Checks are no part of what is known: there is one of each."""
        return _IDS.get(id(obj))

    def reducer_override(self, obj: Any) -> Any:
        if type(obj) is MappingProxyType:
            return (_view, (dict(obj),))
        return NotImplemented


class _Unpacker(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        return _BY_ID[pid]


def _view(mapping: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(mapping)


def behind_gap(run: OfflineRun, length_s: float) -> float | None:
    """Where playing continues [s since the beginning], in the middle of a gap; None: it is in none."""
    last_s = run.run_state.last_message_s
    is_shown = run.at_s - (0.0 if last_s is None else last_s) >= SHOWN_S
    next_s = min(run.next_s, length_s)
    return next_s - LEAD_S if is_shown and next_s - run.at_s > EMPTY_S - SHOWN_S else None


class Index(Observer):
    """Times are seconds since the beginning of the recording."""

    def __init__(self, recording: Recording, drive: Drive, sketch: Sequence[float | None] = ()) -> None:
        """`sketch`: the speed as the catalog has it, in equal steps; it is shown where nothing has been read yet."""
        self._drive = drive
        self._sketch = sketch
        self._every_s = max(LEAST_KEYFRAME_S, drive.length_s / KEYFRAMES)
        self._speed = SpeedTrace(drive.length_s)
        self._gaps: list[tuple[float, float]] = []
        self._received_s = 0.0
        self._marks: list[tuple[int, float, Mark]] = []
        self._active: dict[str, list[Mark]] = {}  # by alarm: announced, and not returned to normal yet
        self._lost_marks = 0
        self._kept_s: list[float] = []
        self._kept: list[bytes] = []
        self.trends = DriveTrends(0.0)
        self.alarm_marks = AlarmMarks()
        self._history = AlarmHistory()
        self._set_limits()
        self.is_done = False
        self.broke_off: str | None = None  # why the recording could not be read to its end
        if drive.recorded.has_alarms:
            for at_s, event in drive.recorded.events:
                if isinstance(event, Transition):
                    self._mark(event, at_s)
        self._run = OfflineRun(recording, drive, observer=self)

    @property
    def every_s(self) -> float:
        """Between two moments that are kept."""
        return self._every_s

    @property
    def at_s(self) -> float:
        """How far it has come."""
        return self._run.at_s

    def work(self, is_over: Callable[[], bool]) -> None:
        """One portion. Raises RecordingUnreadable."""
        while not self.is_done and not is_over():
            due_s = len(self._kept) * self._every_s
            until_s = min(due_s, self._drive.length_s)
            if not self._run.advance(until_s, is_over):
                return
            if due_s <= self._drive.length_s:
                self._kept_s.append(due_s)
                self._kept.append(save_checkpoint(self._run.run_state))
            else:
                self.finish()

    def finish(self) -> None:
        """There is no more to come."""
        if not self.is_done:
            self.is_done = True
            self.message_received("", self._drive.length_s)

    def before(self, at_s: float) -> tuple[float, Callable[[], RunState]] | None:
        """The newest moment kept that is not later, and how to get what was known then."""
        place = bisect_right(self._kept_s, at_s) - 1
        return (self._kept_s[place], lambda: restore_checkpoint(self._kept[place])) if place >= 0 else None

    def history(self, alarm: str, at_s: float) -> list[Transition] | None:
        """The transitions of an alarm up to a moment; None: it has not been read so far, or is too long."""
        is_read = self.is_done or self._drive.recorded.has_alarms or at_s <= self.at_s
        return self._history.until(alarm, at_s) if is_read else None

    def as_json(self) -> IndexedTimeline:
        """The time line of docs/protocol.md, without the fields that only its session has."""
        marks = sorted(self._marks, key=lambda mark: (mark[0], mark[1]))[:MOST_MARKS]
        done_s = self._drive.length_s if self.is_done else self.at_s
        return {
            "length_s": round(self._drive.length_s, 3),
            "done_s": round(done_s, 1),
            "is_done": self.is_done,
            "bucket_s": self._speed.bucket_s,
            "speed_mps": self._speed.completed(done_s, self._sketch),
            "gaps": [(round(a, 2), round(b, 2)) for a, b in self._gaps],
            "marks": [mark for _, _, mark in sorted(marks, key=lambda mark: mark[1])],
            "marks_left_out": len(self._marks) + self._lost_marks - len(marks),
        }

    def empty_stretches(self, least_s: float) -> list[str]:
        """The gaps that playing passes over, in sentences."""
        gaps = [(from_s, to_s - from_s) for from_s, to_s in self._gaps if to_s - from_s >= least_s]
        named = [
            f"Nothing was recorded for {span(gap_s)} from {from_s:.1f} s on: playing passes over it."
            for from_s, gap_s in gaps[:MOST_NAMED]
        ]
        more = len(gaps) - len(named)
        return [*named, f"{more} more gaps are passed over."] if more else named

    def judged(self, transitions: Sequence[Transition], now_s: float) -> None:
        """Alarms are marked where the recording does not hold them."""
        if not self._drive.recorded.has_alarms:
            for transition in transitions:
                self._mark(transition, transition.at_s)

    def _mark(self, transition: Transition, at_s: float) -> None:
        self.alarm_marks.add(transition, at_s)
        self._history.add(transition, at_s)
        spec = transition.spec
        if transition.change == "cleared":
            for ended in self._active.pop(transition.alarm_id, ()):
                ended["duration_s"] = round(max(0.0, at_s - ended["at_s"]), 1)
        if not transition.announces:
            return
        if len(self._marks) >= 10 * MOST_MARKS:
            self._lost_marks += 1
            return
        mark: Mark = {
            "at_s": math.ceil(max(0.0, at_s) * 1000) / 1000,  # there it has been raised already
            "alarm": transition.alarm_id,
            "title": spec.title,
            "priority": spec.priority,
            "text": transition.text,
            "duration_s": None,
        }
        self._active.setdefault(transition.alarm_id, []).append(mark)
        self._marks.append((spec.priority.rank, at_s, mark))

    def signals_changed(self, changed: tuple[str, ...], state: State, now_s: float) -> None:
        """The highest speed of each bucket is kept, and the trends of every signal."""
        self.trends.receive(changed, state, now_s)
        if "speed" not in changed:
            return
        reading = state.get("speed")
        speed = serialize.plain(reading.value.speed_mps, 2) if reading is not None else None
        if speed is not None:
            self._speed.add(now_s, speed)

    def _set_limits(self) -> None:
        """Which thresholds stood when is known before anything is read."""
        epochs = iter(self._drive.epochs)
        self.trends.set_limits(next(epochs).tuning.limits, 0.0)
        for at_s, event in self._drive.recorded.events:
            if isinstance(event, NewSettings):
                self.trends.set_limits(next(epochs).tuning.limits, at_s)

    def message_received(self, topic: str, now_s: float) -> None:
        """Where none comes for long is a gap."""
        if now_s - self._received_s > GAP_S:
            self._gaps.append((self._received_s, now_s))
        self._received_s = max(self._received_s, now_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimelineEvents:
    """Oldest first; texts are shortened."""

    flags: Sequence[DriveMark] = ()
    interventions: Sequence[ReplayIntervention] = ()
    modes: Sequence[DrivenSpan] = ()


NOTHING = TimelineEvents()


def read_timeline_events(open_recording: Callable[[], Recording]) -> TimelineEvents:
    """Read them from a recording and its annotations; what cannot be read is left out and logged."""
    found = NOTHING
    try:
        with open_recording() as recording:
            found = TimelineEvents(flags=_flags(recording))
            events = read_drive_events(recording)
            if events is not None and are_modes_known(events):
                interventions, modes = _interventions(recording, events), _modes(recording, events)
                found = TimelineEvents(flags=found.flags, interventions=interventions, modes=modes)
    except Exception:
        log.exception("recorded events unreadable: replayed without marks, interventions or driving modes")
    return found


def _flags(recording: Recording) -> list[DriveMark]:
    return [{**row, "words": row["words"][:MOST_WORDS]} for row in marks_of(recording)]


def _interventions(recording: Recording, events: Sequence[Event]) -> list[ReplayIntervention]:
    start_ms = recording.start_s * 1000
    found = interventions_of([*events, *map(as_event, described_late(recording))])
    return [_row(one, (one.at_ms - start_ms) / 1000) for one in found[:MOST]]


def _row(one: Intervention, at_s: float) -> ReplayIntervention:
    return {
        "at_s": max(0.0, round(at_s, 3)),
        "kind_of": one.kind_of,
        "category": one.category or None,
        "what": one.what[:MOST_WORDS],
    }


def _modes(recording: Recording, events: Sequence[Event]) -> list[DrivenSpan]:
    start_ms = round(recording.start_s * 1000)
    spans = mode_spans(events, start_ms, start_ms + round(recording.duration_s * 1000))
    return [
        {"mode": one.mode, "from_s": (one.from_ms - start_ms) / 1000, "to_s": (one.to_ms - start_ms) / 1000}
        for one in spans[:MOST]
    ]

"""The time line of a recording: speed, marks of alarms, gaps; and the moments from which a replay can go on at once.

Made by going once through the whole recording, in small portions, while somebody already looks at it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Any

from monitor.alarm import Transition
from monitor.catalog import CHECKS
from monitor.runner import IMPAIRED, IMPAIRED_SPEC
from monitor.state import State
from server.judge.drive import Drive
from server.judge.offline import Observer, OfflineRun
from server.judge.run_state import RunState
from server.protocol import serialize
from server.recording.read.read import Recording
from server.replay.checkpoint import restore, save

BUCKETS = 360  # of the speed: two pixels each on a phone
LEAST_BUCKET_S = 0.5
GAP_S = 1.0  # nothing at all was recorded for longer: a gap
KEYFRAMES = 240  # of 10 to 20 kB each
LEAST_KEYFRAME_S = 10.0
MOST_MARKS = 400  # more alarms than a person can look at: the most urgent are kept


class Index(Observer):
    """Times are seconds since the beginning of the recording."""

    def __init__(self, recording: Recording, drive: Drive) -> None:
        self._drive = drive
        self._bucket_s = max(LEAST_BUCKET_S, drive.length_s / BUCKETS)
        self._every_s = max(LEAST_KEYFRAME_S, drive.length_s / KEYFRAMES)
        self._speed: list[float | None] = [None] * (int(drive.length_s / self._bucket_s) + 1)
        self._gaps: list[tuple[float, float]] = []
        self._heard_s = 0.0
        self._marks: list[tuple[int, float, dict[str, Any]]] = []
        self._lost_marks = 0
        self._kept_s: list[float] = []
        self._kept: list[bytes] = []
        self.is_done = False
        self.broke_off: str | None = None  # why the recording could not be read to its end
        self._specs = {check.id: check.alarm for check in CHECKS} | {IMPAIRED: IMPAIRED_SPEC}
        if drive.recorded.has_alarms:
            for at_s, word in drive.recorded.words:
                if isinstance(word, Transition):
                    self._mark(word, at_s)
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
                self._kept.append(save(self._run.run_state))
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
        return (self._kept_s[place], lambda: restore(self._kept[place])) if place >= 0 else None

    def as_json(self) -> dict[str, Any]:
        """What docs/protocol.md calls the time line; without what only its session knows."""
        marks = sorted(self._marks, key=lambda mark: (mark[0], mark[1]))[:MOST_MARKS]
        return {
            "length_s": round(self._drive.length_s, 3),
            "done_s": round(self._drive.length_s if self.is_done else self.at_s, 1),
            "is_done": self.is_done,
            "bucket_s": self._bucket_s,
            "speed_mps": [serialize.plain(speed, 2) for speed in self._speed],
            "gaps": [[round(a, 2), round(b, 2)] for a, b in self._gaps],
            "marks": [mark for _, _, mark in sorted(marks, key=lambda mark: mark[1])],
            "marks_left_out": len(self._marks) + self._lost_marks - len(marks),
        }

    def judged(self, transitions: Sequence[Transition], now_s: float) -> None:
        """Alarms are marked where the recording does not hold them."""
        if not self._drive.recorded.has_alarms:
            for transition in transitions:
                self._mark(transition, transition.at_s)

    def _mark(self, transition: Transition, at_s: float) -> None:
        spec = self._specs.get(transition.alarm_id)
        if not transition.announces or spec is None:
            return
        if len(self._marks) >= 10 * MOST_MARKS:
            self._lost_marks += 1
            return
        mark = {
            "at_s": math.ceil(max(0.0, at_s) * 1000) / 1000,  # there it has been raised already
            "alarm": transition.alarm_id,
            "title": spec.title,
            "priority": str(spec.priority),
            "text": transition.text,
        }
        self._marks.append((spec.priority.rank, at_s, mark))

    def signals_changed(self, changed: tuple[str, ...], state: State, now_s: float) -> None:
        """The highest speed of each bucket is kept."""
        if "speed" not in changed:
            return
        reading = state.get("speed")
        speed = serialize.plain(reading.value.speed_mps, 2) if reading is not None else None
        place = min(len(self._speed) - 1, int(now_s / self._bucket_s))
        if speed is not None and place >= 0:
            before = self._speed[place]
            self._speed[place] = abs(speed) if before is None else max(before, abs(speed))

    def message_received(self, topic: str, now_s: float) -> None:
        """Where none comes for long is a gap."""
        if now_s - self._heard_s > GAP_S:
            self._gaps.append((self._heard_s, now_s))
        self._heard_s = max(self._heard_s, now_s)

"""The playback of one viewer: position, rate, and seeking.

Within the finished time line a seek restores a checkpoint and plays on, and gives exactly the state of playing through.
Beyond it the checks warm up before the requested time; the replay reports that, and corrects the state once the time
line is that far.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from server.judge.active_settings import NO_CHOICES, SettingsOverride
from server.judge.drive import Drive
from server.judge.offline import OfflineRun
from server.protocol import drive_trends, serialize
from server.protocol.messages import Timeline
from server.protocol.state import RecordedState, ReplayPosition
from server.recording.delay import recorded_delay
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import Recording, RecordingUnreadable
from server.replay import replay_frames
from server.replay.timeline import EMPTY_S, MOST, NOTHING, Index, TimelineEvents, behind_gap
from server.vehicle import queries
from server.vehicle.queries import check_answer

RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
WARM_UP_S = 25.0  # of the recording, before a moment that the time line has not come to: less than a second of work
REACH_S = 30.0  # a moment so little ahead is played to
BEHIND_S = 0.3  # wall time: further behind, it does not reach the requested rate


class Playback:
    """Times without a suffix are seconds since the beginning of the recording; `now_s` is the viewer's clock.

    `open_again` gives the recording a second time, for the time line; `sketch` is its speed in equal steps, `trends`
    all its signals in few buckets, to be shown until the time line is made. Raises RecordingUnreadable.
    """

    def __init__(
        self,
        recording: Recording,
        open_again: Callable[[], Recording],
        *,
        settings: str,
        choices: SettingsOverride = NO_CHOICES,
        now_s: float,
        at_s: float = 0.0,
        sketch: Sequence[float | None] = (),
        trends: drive_trends.DriveTrendsAnswer | None = None,
    ) -> None:
        self._recording = recording
        self._trends = trends
        self.drive = Drive(
            recording,
            read_recorded_events(recording),
            delay=recorded_delay(recording),
            fallback=settings,
            choices=choices,
        )
        self._index_recording = open_again()
        self.index = Index(self._index_recording, self.drive, sketch)
        self._run = OfflineRun(recording, self.drive)
        self.is_playing = False
        self.passes_gaps = True
        self.rate = 1.0
        self.reached_rate: float | None = None  # where it does not keep the pace; None: it does
        self.is_settled = True  # False: the checks were only warmed up
        self.seeks = 0
        self._target_s: float | None = None  # a seek under way
        self._from_s, self._from_now_s = 0.0, now_s  # the pace is kept from here
        self._paced: tuple[float, float] = (now_s, 0.0)
        self.broke_off: str | None = None
        self.seek(at_s, now_s)

    def close(self) -> None:
        self._recording.close()
        self._index_recording.close()

    @property
    def length_s(self) -> float:
        return self.drive.length_s

    @property
    def at_s(self) -> float:
        """The moment that is shown, or sought."""
        return self._target_s if self._target_s is not None else self._run.at_s

    @property
    def is_seeking(self) -> bool:
        return self._target_s is not None

    # -- what the person does ----------------------------------------------------------------------------------------

    def play(self, now_s: float) -> None:
        """From the beginning again where it stood at the end."""
        if self.at_s >= self.length_s and self.length_s > 0:
            self.seek(0.0, now_s)
        self.is_playing = True
        self._keep_pace_from(self.at_s, now_s)

    def pause(self, now_s: float) -> None:
        self.is_playing = False
        self.reached_rate = None

    def set_rate(self, rate: float, now_s: float) -> None:
        """Raises ValueError where there is no such rate."""
        if rate not in RATES:
            raise ValueError(f"A replay runs at {', '.join(f'{one:g}' for one in RATES)} times real time.")
        self.rate = rate
        self._keep_pace_from(self.at_s, now_s)

    def seek(self, at_s: float, now_s: float) -> None:
        """To another moment; beyond the ends, to the end. Raises ValueError for what is not a number."""
        if not math.isfinite(at_s):
            raise ValueError("This time is outside the recording.")
        self.seeks += 1
        self._go_to(min(max(at_s, 0.0), self.length_s), now_s)

    def step_alarm(self, direction: int, now_s: float) -> bool:
        """To the alarm before or after; False where there is none."""
        moments = [mark["at_s"] for mark in self.index.as_json()["marks"]]
        here_s = self.at_s
        if direction > 0:
            found = min((at_s for at_s in moments if at_s > here_s + 0.05), default=None)
        else:
            found = max((at_s for at_s in moments if at_s < here_s - 1.0), default=None)
        if found is None:
            return False
        self.seek(found, now_s)
        return True

    def work(self, now_s: float, is_over: Callable[[], bool]) -> None:
        """Advance to the position for `now_s`, within the time budget; the rest is spent on the time line."""
        try:
            self._work(now_s, is_over)
        except RecordingUnreadable as error:
            self._break_off(str(error), now_s)
        if not self.index.is_done and not is_over():
            try:
                self.index.work(is_over)
            except RecordingUnreadable as error:
                self.index.broke_off = str(error)
                self.index.finish()
            self._put_right(now_s)

    def _work(self, now_s: float, is_over: Callable[[], bool]) -> None:
        if self._target_s is not None:
            if not self._run.advance(self._target_s, is_over):
                return
            self._target_s = None
            self._keep_pace_from(self._run.at_s, now_s)
        if not self.is_playing:
            return
        self._target_s = behind_gap(self._run, self.length_s) if self.passes_gaps else None
        if self._target_s is not None:
            return
        due_s = min(self.length_s, self._from_s + (now_s - self._from_now_s) * self.rate)
        if not self._run.advance(due_s, is_over) and due_s - self._run.at_s > BEHIND_S * self.rate:
            since_s, from_s = self._paced
            self.reached_rate = (self._run.at_s - from_s) / max(now_s - since_s, 0.05)
            self._from_s, self._from_now_s = self._run.at_s, now_s
        elif now_s - self._paced[0] > 2.0:
            reached = (self._run.at_s - self._paced[1]) / (now_s - self._paced[0])
            self.reached_rate = reached if reached < 0.9 * self.rate else None
            self._paced = (now_s, self._run.at_s)
        if self._run.at_s >= self.length_s:
            self.pause(now_s)

    def _keep_pace_from(self, at_s: float, now_s: float) -> None:
        self._from_s, self._from_now_s = at_s, now_s
        self._paced = (now_s, at_s)
        self.reached_rate = None

    def _go_to(self, target_s: float, now_s: float) -> None:
        kept = self.index.before(target_s)
        here_s = self._run.at_s
        is_ahead = self.is_settled and here_s <= target_s
        if is_ahead and (kept is None or kept[0] <= here_s) and target_s - here_s <= REACH_S:
            pass  # what is known already leads there soonest
        elif kept is not None and target_s - kept[0] <= max(WARM_UP_S, 2 * self.index.every_s):
            self._run = OfflineRun(self._recording, self.drive, run_state=kept[1]())
            self.is_settled = True
        else:
            from_s = max(0.0, target_s - WARM_UP_S)
            self._run = OfflineRun(self._recording, self.drive, from_s=from_s)
            self.is_settled = from_s == 0.0
        self._target_s = target_s
        self._keep_pace_from(target_s, now_s)

    def _put_right(self, now_s: float) -> None:
        """What was only warmed up becomes what playing would have come to, once the time line has come there."""
        if not self.is_settled and self._target_s is None and self.index.at_s >= self._run.at_s:
            self._go_to(self._run.at_s, now_s)

    def _break_off(self, why: str, now_s: float) -> None:
        self.broke_off = why
        self._target_s = None
        self.pause(now_s)

    # -- what is shown -----------------------------------------------------------------------------------------------

    def frame(self, **names: Any) -> RecordedState:
        """The state at the moment that has been reached, without `server`, `replay` and `live`."""
        return replay_frames.frame(self._run, track_number=self.seeks, **names)

    def position(self) -> ReplayPosition:
        """The replay's status, as in docs/protocol.md."""
        run_state = self._run.run_state
        silent_s = None if run_state.last_message_s is None else max(0.0, run_state.at_s - run_state.last_message_s)
        return {
            "at_s": round(self.at_s, 3),
            "at_ms": round((self.drive.start_s + self.at_s) * 1000),
            "start_ms": round(self.drive.start_s * 1000),
            "end_ms": round((self.drive.start_s + self.length_s) * 1000),
            "length_s": round(self.length_s, 3),
            "is_playing": self.is_playing,
            "rate": self.rate,
            "reached_rate": round(self.reached_rate, 2) if self.reached_rate is not None else None,
            "is_seeking": self.is_seeking,
            "is_settled": self.is_settled,
            "silent_s": round(silent_s, 2) if silent_s is not None else None,
            "seek": self.seeks,
            "alarms_from": "recording" if self.drive.recorded.has_alarms else "judged",
            "settings_from": "recording" if self.drive.settings_from_recording else "now",
        }

    def timeline(self, events: TimelineEvents = NOTHING) -> Timeline:
        """The time line so far, the recorded events of the drive, and the notes on the recording."""
        notes = [*self.drive.notes, *self.index.empty_stretches(EMPTY_S)]
        if self.index.is_done:
            notes += [f"{sentence}." for sentence in self._index_recording.damage]
        broken = (why for why in (self.index.broke_off, self.broke_off) if why is not None)
        notes += [f"Not all of it can be read: {why}." for why in broken]
        notes = list(dict.fromkeys(notes))[:20]
        return {
            "kind": "timeline", **self.index.as_json(), "notes": notes, "flags": list(events.flags[:MOST]),
            "interventions": list(events.interventions), "modes": list(events.modes),
        }  # fmt: skip

    def scan_bytes(self) -> bytes | None:
        return replay_frames.scan_bytes(self._run)

    def answer(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Answer a page's queries as a session does: `track_points`, `trends`, `drive_trends`, `check` and
        `signals`."""
        run_state = self._run.run_state
        if message.get("kind") == "drive_trends":
            return self._drive_trends(drive_trends.Wanted.of(message))
        after = message.get("after")
        if message.get("kind") == "trends":
            return serialize.trends(run_state.trends.piece(run_state.at_s, after=after))
        if message.get("kind") == "check":
            return _check(self._run, self.index, str(message.get("check")))
        if message.get("kind") == "signals":
            mapped = {source.topic for source in self._run.epoch.sources.values()}
            rest = {name: kind for name, kind in self.drive.offered.items() if name not in mapped}
            return queries.signals(self.drive.offers(self._run.epoch), rest, run_state.reception)
        return queries.track_points(
            run_state.state.glance(run_state.at_s), number=self.seeks, after=after if isinstance(after, int) else 0
        )

    def _drive_trends(self, wanted: drive_trends.Wanted) -> drive_trends.DriveTrendsAnswer:
        """A part of the recording, as far as the time line has read it."""
        index = self.index
        facts = drive_trends.DriveFacts(
            now_s=self.length_s if index.is_done else index.at_s,
            start_ms=round(self.drive.start_s * 1000),
            length_s=self.length_s,
            marks=index.alarm_marks,
            marks_left_out=index.alarm_marks.left_out,
        )
        is_read = index.is_done or min(wanted.to_s, self.length_s) <= index.at_s
        if is_read or self._trends is None:
            return drive_trends.answer(index.trends, wanted, facts)
        return drive_trends.of_sketch(self._trends, index.trends, wanted, facts)


def _check(run: OfflineRun, index: Index, name: str) -> Mapping[str, Any]:
    """One check at the moment that has been reached, with its alarms until then."""
    now_s, monitor = run.run_state.at_s, run.run_state.monitor
    answer = check_answer(monitor, name, now_s, run.run_state.minute)
    if name not in monitor.alarms:
        return dict(answer)
    history, start_s = index.history(name, now_s), run.drive.start_s
    events = [
        serialize.event(one, round((start_s + one.at_s) * 1000), now_s=one.at_s, settings_version=0)
        for one in history or ()
    ]
    numbered = [{**event, "n": n} for n, event in enumerate(events, 1)]
    return {**answer, "history": None if history is None else numbered}

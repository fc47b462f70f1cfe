"""Reads a recording once for the list of recordings: length, distance, top speed, alarms, track.

As a process of its own (`python -m server.recording.catalog.survey`): the path of a file in hex on each line of its
input, what was found as one line of JSON on its output. It runs at the lowest priority, and a file that makes it fail
harms nothing else.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import resource
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson

from monitor.drive_trends import DriveTrends
from monitor.signals import CHARTED
from monitor.state import State
from server.judge.drive import Drive
from server.judge.logged_transition import spec_of
from server.judge.offline import Observer, OfflineRun
from server.judge.speed_trace import SpeedTrace
from server.protocol.drive_trends import DriveFacts, DriveTrendsAnswer, Wanted, answer
from server.protocol.marks import DriveMark
from server.recording.catalog.annotations import MAX_MARKS, line
from server.recording.catalog.discovery import files_of, why_not_one_file
from server.recording.catalog.sketch import sketch
from server.recording.drive.course import course_of
from server.recording.drive.facts import facts_of, figures_of, limits_of, undescribed_of
from server.recording.drive.motion import Motion
from server.recording.drive.parts import Span, gaps_of
from server.recording.event_channels import read_recorded_events
from server.recording.marks.recorded import in_recording
from server.recording.mcap.chain import read_head
from server.recording.read.errors import NoRoom
from server.recording.read.read import Recording, RecordingUnreadable, open_recording

VERSION = 12  # of what is found: with another one, files are read again
PRIORITIES = ("critical", "warning", "advisory")
MAX_RAISED = 200  # alarms listed one by one; all are counted
MAX_SENTENCES = 10
MAX_MARK_WORDS = 400  # letters that a search finds
SKETCH_BUCKETS = 360
DRAWN = tuple(name for name in CHARTED if name != "scan")  # a laser's messages take longer than all others together
_MEMORY_BYTES = 4 << 30  # a damaged length must not take the machine's
_ALARMS = "/catgraph/alarms"


def survey(path: Path) -> dict[str, Any]:
    """The survey of one file. `problem` is the reason why it cannot be read; then it is the only entry, but for
    `is_passing` where it can be read later.

    Lengths in m and s, speeds in m/s, times in ms since 1970. Unknown is None; `alarms` is None if none were recorded.
    """
    try:
        with open_recording([path]) as recording:
            found = _read(recording, path)
    except NoRoom as why:
        return {"problem": _sentence(str(why), path), "is_passing": True}
    except RecordingUnreadable as why:
        return {"problem": _sentence(str(why), path)}
    except MemoryError:
        return {"problem": _sentence(f"{path} has a part that is larger than this machine's memory", path)}
    found["sha256"] = _digest(path)
    head = None if path.is_dir() else read_head(path, "")
    found["head"] = head.digest if head is not None else None
    return found


def _read(recording: Recording, path: Path) -> dict[str, Any]:
    metadata: Mapping[str, str] = recording.metadata
    state, motion, broke_off = _drive(recording)
    facts = replace(facts_of(recording, motion.motion), limits=motion.limits)
    events, has_alarms = _raised(recording)
    snapshot = state.snapshot(recording.duration_s + 1.0)
    drawn = sketch(snapshot.track, [(at_s - recording.start_s, event.get("priority", "")) for at_s, event in events])
    counts = Counter(event.get("priority") for _, event in events)
    started_ms = _whole(metadata.get("started_ms"))
    if started_ms is None or "clip_of" in metadata:  # a clip can have been requested from before its drive started
        started_ms = round(recording.start_s * 1000)
    damage = [_sentence(text, path) for text in (*recording.damage, *broke_off)]
    return {
        "vehicle": _text(metadata.get("vehicle")),
        "session": _text(metadata.get("session")),
        "part": _whole(metadata.get("part")),
        "version": _text(metadata.get("version")),
        "ros_version": recording.ros_version,
        "started_ms": started_ms,
        "length_s": round(recording.duration_s, 3),
        "messages": recording.count,
        "topics": len(recording.topics),
        "distance_m": None if state.track_m is None else round(state.track_m + state.track_ahead_m, 1),
        "top_speed_mps": None if motion.top_mps is None else round(motion.top_mps, 2),
        "speed_mps": [] if motion.top_mps is None else motion.trace.rounded(),
        "alarms": {name: counts.get(name, 0) for name in PRIORITIES} if has_alarms else None,
        "raised": [_raised_entry(at_s, event) for at_s, event in events[:MAX_RAISED]],
        "ended": _text(metadata.get("ended")),
        "ended_why": _text(metadata.get("why")),
        "is_clip": "clip_of" in metadata,
        "clip_of": _text(metadata.get("clip_of")),
        "left_out": _names(metadata.get("left_out", "")),
        "left_out_count": _count(metadata, "left_out"),
        "not_received": _names(metadata.get("not_received", "")),
        "not_received_count": _count(metadata, "not_received"),
        "damage": damage[:MAX_SENTENCES],
        "unread": [_sentence(note, path) for note in recording.notes[:MAX_SENTENCES]],
        "several_files": why_not_one_file(path),
        "sketch": None if drawn is None else drawn.as_json(),
        "marks": _marks(recording),
        "trends": motion.sketch(recording),
        "figures": figures_of(facts),
        "undescribed": [] if facts.log is None else undescribed_of(facts.log),
        "course": course_of(facts),
    }


def _names(lines: str) -> list[str]:
    return [name[:200] for name in lines.split("\n") if name][:MAX_SENTENCES]


def _count(metadata: Mapping[str, str], name: str) -> int:
    """The number of topics; older files have only their names."""
    named = sum(1 for line in metadata.get(name, "").split("\n") if line)
    return max(named, _whole(metadata.get(f"{name}_count")) or 0)


class _Motion(Observer):
    """The highest speed of a run, its course, and that of all other signals."""

    def __init__(self, speed: str, drive: Drive, gaps: Sequence[Span]) -> None:
        """`speed`: the signal that has it; `gaps`: between the files of a split bag."""
        length_s = drive.length_s
        self.limits = limits_of(drive)
        self.top_mps: float | None = None
        self.trace = SpeedTrace(length_s)
        self.motion = Motion(length_s, speed=speed, gaps=gaps)
        self._speed = speed
        self._trends = DriveTrends(0.0)

    def signals_changed(self, changed: tuple[str, ...], state: State, now_s: float) -> None:
        """Keeps the trends, and the distance."""
        self._trends.receive(changed, state, now_s)
        self.motion.signals_changed(changed, state, now_s)

    def message_received(self, topic: str, now_s: float) -> None:
        """Notes when nothing came."""
        self.motion.message_received(topic, now_s)

    def sketch(self, recording: Recording) -> DriveTrendsAnswer:
        """The whole drive in so few buckets that a chart shows it at once."""
        length_s = recording.duration_s
        facts = DriveFacts(now_s=length_s, start_ms=round(recording.start_s * 1000), length_s=length_s)
        return answer(self._trends, Wanted(signals=DRAWN, buckets=SKETCH_BUCKETS), facts)

    def value_decoded(self, signal: str, value: Any, now_s: float, stamp_s: float | None) -> None:
        """Compares the speed; NaN and what no car drives are no speed."""
        self.motion.value_decoded(signal, value, now_s, stamp_s)
        speed_mps = getattr(value, "speed_mps", None) if signal == self._speed else None
        if speed_mps is not None and abs(speed_mps) < 1000.0:
            self.top_mps = max(self.top_mps or 0.0, abs(speed_mps))
            self.trace.add(now_s, speed_mps)


def _drive(recording: Recording) -> tuple[State, _Motion, list[str]]:
    """The state at the end, the speed, and why the recording could not be read to its end.

    By the loop of everything that is judged, so that distances are those the operator saw. Nothing is judged: a list
    names the alarms that were announced, and judging takes twice as long.
    """
    recorded = read_recorded_events(recording)
    drive = Drive(recording, recorded, signals=DRAWN)
    has_speed = any("speed" in epoch.published for epoch in drive.epochs)
    motion = _Motion("speed" if has_speed else "odometry", drive, gaps_of(recording))
    run = OfflineRun(recording, drive, observer=motion, with_checks=False)
    broke_off = []
    try:
        run.advance(math.inf, to_last_message=True)
    except RecordingUnreadable as why:
        broke_off.append(str(why))
        if not run.run_state.reception.received:
            raise
    return run.run_state.state, motion, broke_off


def _raised(recording: Recording) -> tuple[list[tuple[float, dict[str, Any]]], bool]:
    """The raised alarms, oldest first; and whether the file has an alarm log."""
    has_log = bool(recording.metadata)
    found = []
    for at_s, event in recording.own(_ALARMS):
        has_log = True
        if event.get("change") == "raised" and event.get("alarm"):
            spec = spec_of(event)
            found.append((at_s, {**event, "title": spec.title, "priority": spec.priority}))
    return sorted(found, key=lambda one: one[0]), has_log


def _marks(recording: Recording) -> list[DriveMark]:
    """For the list and its search; the catalog adds those beside the file."""
    found = sorted(in_recording(recording), key=lambda row: row["marked_ms"])[:MAX_MARKS]
    return [{**row, "words": row["words"][:MAX_MARK_WORDS]} for row in found]


def _raised_entry(at_s: float, event: Mapping[str, Any]) -> dict[str, Any]:
    entry = {name: (_text(event.get(name)) or "")[:300] for name in ("alarm", "title", "text")}
    return {"at_ms": round(at_s * 1000), "priority": event["priority"], **entry}


def _text(value: object) -> str | None:
    return value[:300] if isinstance(value, str) and value else None


def _whole(value: object) -> int | None:
    try:
        number = int(value) if isinstance(value, (str, int)) else None
    except ValueError:
        return None
    return number if number is not None and 0 < number < 2**53 else None


def _sentence(text: str, path: Path) -> str:
    """As a person reads it: the file's name, not where this server keeps it."""
    sentence = line(text.replace(str(path), path.name))[:400]
    return sentence if sentence.endswith(".") else f"{sentence}."


def _digest(path: Path) -> str:
    """Of a file; of a folder, of the digests of its files."""
    if path.is_dir():
        return hashlib.sha256("".join(map(_digest, files_of(path))).encode()).hexdigest()
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _answers(names: Iterable[str]) -> Iterator[bytes]:
    for name in names:
        path = Path(os.fsdecode(bytes.fromhex(name)))
        try:
            found = survey(path)
        except FileNotFoundError:
            found = {"problem": _sentence(f"{path} no longer exists", path)}
        except OSError as why:
            found = {"problem": _sentence(f"{path} cannot be read: {why.strerror or why}", path)}
        except Exception as why:  # an unforeseen fault of a file is reported like any other
            print(f"{path}: {why!r}", file=sys.stderr)
            found = {"problem": _sentence(f"{path} could not be read: the reader failed", path)}
        yield orjson.dumps(found, option=orjson.OPT_SERIALIZE_NUMPY)


def main() -> None:
    os.nice(15)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    try:
        for line_of_one in _answers(sys.stdin):
            sys.stdout.buffer.write(line_of_one + b"\n")
            sys.stdout.buffer.flush()
    except BrokenPipeError:  # the server was killed: nobody reads the answer
        os._exit(1)  # no last flush, which would fail like this one


if __name__ == "__main__":
    main()

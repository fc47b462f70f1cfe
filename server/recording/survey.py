"""Reads a recording once and tells what a list says of it: how long, how far, how fast, which alarms, along which way.

As a process of its own (`python -m server.recording.survey`): the path of a file in hex on each line of its input, what
was found as one line of JSON on its output. It gives way to everything else on the machine, and a file that breaks it
breaks nothing else.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import resource
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import orjson

from monitor.state import State
from server import bounded_toml, judging
from server.profiles import GENERIC
from server.reception import Reception
from server.recording.read import Recording, RecordingUnreadable, open_recording
from server.recording.remarks import line
from server.recording.sketch import sketch
from server.topics import map_signals

VERSION = 3  # of what is found: with another one, files are read again
PRIORITIES = ("critical", "warning", "advisory")
MAX_RAISED = 200  # alarms told one by one; all are counted
MAX_SENTENCES = 10
_MEMORY_BYTES = 4 << 30  # a damaged length must not take the machine's
_ALARMS = "/catgraph/alarms"


def survey(path: Path) -> dict[str, Any]:
    """What one file holds. `problem` is the sentence why it cannot be read, and then it is all there is.

    Lengths in m and s, speeds in m/s, moments in ms since 1970. Unknown is None: `alarms` where nobody recorded any.
    """
    try:
        with open_recording([path]) as recording:
            found = _read(recording, path)
    except RecordingUnreadable as why:
        return {"problem": _sentence(str(why), path)}
    except MemoryError:
        return {"problem": _sentence(f"{path} tells of a part that is larger than this machine can hold", path)}
    found["sha256"] = _digest(path)
    return found


def _read(recording: Recording, path: Path) -> dict[str, Any]:
    metadata: Mapping[str, str] = recording.metadata
    state, top_mps, broke_off = _drive(recording, metadata)
    events, has_alarms = _raised(recording)
    snapshot = state.snapshot(recording.duration_s + 1.0)
    drawn = sketch(snapshot.track, [(at_s - recording.start_s, event.get("priority", "")) for at_s, event in events])
    counts = Counter(event.get("priority") for _, event in events)
    started_ms = _whole(metadata.get("started_ms"))
    if started_ms is None or "clip_of" in metadata:  # a clip may have been asked for from before its drive began
        started_ms = round(recording.start_s * 1000)
    damage = [_sentence(words, path) for words in (*recording.damage, *broke_off)]
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
        "distance_m": None if snapshot.track_m is None else round(snapshot.track_m, 1),
        "top_speed_mps": None if top_mps is None else round(top_mps, 2),
        "alarms": {name: counts.get(name, 0) for name in PRIORITIES} if has_alarms else None,
        "raised": [_told(at_s, event) for at_s, event in events[:MAX_RAISED]],
        "ended": _text(metadata.get("ended")),
        "ended_why": _text(metadata.get("why")),
        "is_clip": "clip_of" in metadata,
        "clip_of": _text(metadata.get("clip_of")),
        "left_out": _names(metadata.get("left_out", "")),
        "left_out_count": _count(metadata, "left_out"),
        "not_received": _names(metadata.get("not_received", "")),
        "not_received_count": _count(metadata, "not_received"),
        "damage": damage[:MAX_SENTENCES],
        "sketch": None if drawn is None else drawn.as_json(),
    }


def _names(lines: str) -> list[str]:
    return [name[:200] for name in lines.split("\n") if name][:MAX_SENTENCES]


def _count(metadata: Mapping[str, str], name: str) -> int:
    """How many there are; older files say it only by their names."""
    named = sum(1 for line in metadata.get(name, "").split("\n") if line)
    return max(named, _whole(metadata.get(f"{name}_count")) or 0)


def _drive(recording: Recording, metadata: Mapping[str, str]) -> tuple[State, float | None, list[str]]:
    """Speeds and positions by the road of everything that is judged, so that distances are those the operator saw."""
    types = {name: topic.type for name, topic in recording.topics.items() if topic.count}
    mapped = map_signals(types, _chosen(metadata.get("settings", "")))
    wanted = [mapped[name] for name in ("speed", "position") if name in mapped and mapped[name].decode is not None]
    if not any(source.signal == "speed" for source in wanted) and "odometry" in mapped:
        wanted.append(mapped["odometry"])
    listeners = judging.by_topic(source for source in wanted if source.decode is not None)
    state, reception = State(), Reception()
    top_mps: float | None = None
    broke_off = []
    try:
        for message in recording.messages(0.0, listeners):
            sources = listeners.get(message.topic)
            if sources is None:
                continue
            at_s = message.at_s - recording.start_s
            changed = judging.receive(
                sources,
                message.message,
                at_s,
                None,
                reception=reception,
                state=state,
                profile=GENERIC,
                tyre_rad_per_unit=0.0,
            )
            for signal in changed:
                if signal in ("speed", "odometry"):
                    reading = state.get(signal)
                    speed_mps = getattr(reading.value, "speed_mps", None) if reading is not None else None
                    if speed_mps is not None and abs(speed_mps) < 1000.0:  # NaN and what no car drives are no speed
                        top_mps = max(top_mps or 0.0, abs(speed_mps))
    except RecordingUnreadable as why:
        broke_off.append(str(why))
        if not reception.received:
            raise
    return state, top_mps, broke_off


def _chosen(toml: str) -> dict[str, str]:
    """The topics the operator had picked for signals, by the settings of the drive."""
    try:
        topics = bounded_toml.loads(toml).get("topics", {})
    except bounded_toml.BadToml:
        return {}
    return {k: v for k, v in topics.items() if isinstance(v, str)} if isinstance(topics, dict) else {}


def _raised(recording: Recording) -> tuple[list[tuple[float, dict[str, Any]]], bool]:
    """When which alarms were raised, oldest first; and whether the file tells of alarms at all."""
    tells = bool(recording.metadata)
    found = []
    for at_s, event in recording.own(_ALARMS):
        tells = True
        if event.get("change") == "raised" and event.get("priority") in PRIORITIES:
            found.append((at_s, event))
    return sorted(found, key=lambda one: one[0]), tells


def _told(at_s: float, event: Mapping[str, Any]) -> dict[str, Any]:
    told = {name: (_text(event.get(name)) or "")[:300] for name in ("alarm", "title", "text")}
    return {"at_ms": round(at_s * 1000), "priority": event["priority"], **told}


def _text(value: object) -> str | None:
    return value[:300] if isinstance(value, str) and value else None


def _whole(value: object) -> int | None:
    try:
        number = int(value) if isinstance(value, (str, int)) else None
    except ValueError:
        return None
    return number if number is not None and 0 < number < 2**53 else None


def _sentence(words: str, path: Path) -> str:
    """As a person reads it: the file's name, not where this server keeps it."""
    said = line(words.replace(str(path), path.name))[:400]
    return said if said.endswith(".") else f"{said}."


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _answers(names: Iterable[str]) -> Iterator[bytes]:
    for name in names:
        path = Path(os.fsdecode(bytes.fromhex(name)))
        try:
            found = survey(path)
        except FileNotFoundError:
            found = {"problem": _sentence(f"{path} is not there any more", path)}
        except OSError as why:
            found = {"problem": _sentence(f"{path} cannot be read: {why.strerror or why}", path)}
        except Exception as why:  # a file that nobody thought of is told like any other
            print(f"{path}: {why!r}", file=sys.stderr)
            found = {"problem": _sentence(f"{path} could not be read: it made the reader fail", path)}
        yield orjson.dumps(found, option=orjson.OPT_SERIALIZE_NUMPY)


def main() -> None:
    os.nice(15)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    for answer in _answers(sys.stdin):
        sys.stdout.buffer.write(answer + b"\n")
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()

"""The minute around an alarm as a recording of its own: its messages, and what was in force when it begins.

Messages are copied as bytes and never decoded, so a clip holds what was recorded: the same channels, definitions and
stamps. It begins with the settings in force, the state of the link and the last message of each latched topic. Its
metadata names the recording it was cut from, and what was in force: alarms, pause, chosen phone, slow-down.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import orjson

from server.protocol.marks import DriveMark
from server.recording.export.export_format import NothingRecorded, Outcome, Progress, nothing
from server.recording.export.raw import OWN, Raw, described_event, raw_messages, span_ns
from server.recording.folder import WRITING, id_of
from server.recording.marks.recorded import described_late, marks_of, media_of
from server.recording.marks.rows import entry
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.read.errors import Undecodable
from server.recording.read.read import Recording
from server.recording.read.schemas import Schema, TypeBook
from server.recording.read.source import Channel, why_not_decoded
from server.recording.standing import Stood, read_standing

BEFORE_S = AFTER_S = 30.0
LONGEST_S = 3600.0  # before and after: beyond that it is a drive and no clip
_ALARMS, _SETTINGS, _LINK, _MARKS = f"{OWN}alarms", f"{OWN}settings", f"{OWN}link", f"{OWN}marks"
_HELD = 5000  # messages written and not yet handed to the system: a few MB
_OF_THE_FILE = ("ended", "why", "closed_ms", "previous", "previous_record", "previous_head")  # not of a clip
_LATCHED = {"offered_qos_profiles": "- durability: transient_local"}  # in the form that the readers expect


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Which minute. Times are ns since 1970."""

    at_ns: int
    before_s: float = BEFORE_S
    after_s: float = AFTER_S

    @property
    def from_ns(self) -> int:
        return self.at_ns - round(self.before_s * 1e9)

    @property
    def to_ns(self) -> int:
        return self.at_ns + round(self.after_s * 1e9)


def write_clip(
    recording: Recording, path: Path, window: Window, *, clip_of: str, progress: Progress = nothing
) -> Outcome:
    """Writes the clip to `path`, which must not be there and ends in .mcap; until it is whole it ends in .writing.

    Raises NothingRecorded where nothing was recorded then, RecordingUnreadable, OSError.
    """
    first_ns, last_ns = span_ns(recording)
    if not last_ns or window.to_ns < first_ns or window.from_ns > last_ns:
        raise NothingRecorded(f"Nothing was recorded from {_clock(window.from_ns)} to {_clock(window.to_ns)} UTC.")
    before = _before(recording, max(window.from_ns, first_ns), progress)
    file = PartFile(path, profile=f"ros{recording.ros_version}", metadata=_metadata(recording, window, before, clip_of))
    try:
        outcome = _copy(recording, file, window, before, progress)
        file.close(ended="closed", why="")
    except BaseException:
        file.abandon()
        with contextlib.suppress(OSError):
            path.with_name(id_of(path) + WRITING).unlink()
        raise
    outcome.notices += _short(window, first_ns, last_ns)
    outcome.notes += _damage(recording, first_ns)
    return outcome


def first_raised_ns(recording: Recording, alarm: str) -> int | None:
    """When an alarm was first raised, by the recording's own log."""
    for at_s, event in recording.own(_ALARMS):
        if event.get("alarm") == alarm and event.get("change") == "raised":
            at_ms = event.get("at_ms")
            return at_ms * 1_000_000 if isinstance(at_ms, int) else round(at_s * 1e9)
    return None


@dataclass(slots=True)
class _Before:
    """What was so when the clip begins."""

    stood: Stood
    latest: dict[tuple[int, int], Raw]  # file and channel → the last message of settings, link and latched topics
    settings: str | None


def _before(recording: Recording, from_ns: int, progress: Progress) -> _Before:
    found = _Before(Stood(), {}, recording.metadata.get("settings"))
    found.stood.note_all(read_standing(recording.metadata))

    def matters(channel: Channel) -> bool:
        return channel.is_latched or channel.topic in (_ALARMS, _SETTINGS, _LINK)

    for raw in raw_messages(
        recording, wanted=matters, end_ns=from_ns - 1, progress=lambda part: progress(part * _LOOKING)
    ):
        if raw.channel.topic == _ALARMS:
            found.stood.note(_json(raw.data))
            continue
        if raw.channel.topic == _SETTINGS:
            found.settings = _toml(raw.data) or found.settings
        found.latest = {place: old for place, old in found.latest.items() if old.channel.topic != raw.channel.topic}
        found.latest[raw.file, raw.channel.number] = raw
    return found


_LOOKING = 0.4  # of the work: the rest is copying


def _copy(recording: Recording, file: PartFile, window: Window, before: _Before, progress: Progress) -> Outcome:
    outcome = Outcome()
    channels: dict[tuple[int, int], int | tuple[str, str]] = {}  # or topic and reason: it cannot be in a clip
    left_out: Counter[tuple[str, str]] = Counter()  # messages by topic and reason
    books: dict[int, TypeBook] = {}

    def number_of(raw: Raw) -> int | tuple[str, str]:
        try:
            schema = _schema(recording, raw.channel, books)
        except Undecodable as why:
            return raw.channel.topic, str(why)
        return file.channel(raw.channel.topic, schema, _LATCHED if raw.channel.is_latched else None)

    def add(raw: Raw, at_ns: int) -> None:
        place = (raw.file, raw.channel.number)
        if place not in channels:
            channels[place] = number_of(raw)
        number = channels[place]
        if isinstance(number, tuple):
            left_out[number] += 1
        else:
            file.add(number, at_ns, raw.data)

    first_ns, last_ns = span_ns(recording)
    begin_ns, end_ns = max(window.from_ns, first_ns), min(window.to_ns, last_ns)
    described = {row["intervention"]: row for row in described_late(recording)}
    held: set[str] = set()  # interventions of the minute that were described later
    _add_marks(recording, file, window)
    for raw in before.latest.values():
        add(raw, begin_ns)  # what was in force then; the message has its own time where it has a stamp
    for raw in _within(recording, window, progress):
        if raw.channel.topic == _MARKS:
            continue
        if raw.channel.topic == _ALARMS and described:
            held.update(name for name in described if name.encode() in raw.data)
        add(raw, raw.time_ns)
        outcome.entries += 1
        if outcome.entries % _HELD == 0:
            file.flush()
    for row in (described[name] for name in described if name in held):
        file.add(file.channel(_ALARMS, own_schema("alarms")), end_ns, orjson.dumps(described_event(row)))
    if not outcome.entries:
        raise NothingRecorded(f"Nothing was recorded from {_clock(window.from_ns)} to {_clock(window.to_ns)} UTC.")
    outcome.notes += [
        f"{topic} ({count} messages) is left out: {why}." for (topic, why), count in sorted(left_out.items())
    ]
    return outcome


def _add_marks(recording: Recording, file: PartFile, window: Window) -> None:
    """The marks of the minute in their newest form, with their voice notes and photos."""
    marks = {row["mark"]: row for row in marks_of(recording) if _is_within(row, window)}
    for row in marks.values():
        channel = file.channel(_MARKS, own_schema("marks"))
        file.add(channel, row["marked_ms"] * 1_000_000, orjson.dumps(entry(row, "mark")))
    for name, data in media_of(recording):
        if name.mark in marks:
            file.attach(name.attachment, name.media_type, marks[name.mark]["marked_ms"] * 1_000_000, data)


def _is_within(row: DriveMark, window: Window) -> bool:
    return window.from_ns <= row["marked_ms"] * 1_000_000 <= window.to_ns


def _within(recording: Recording, window: Window, progress: Progress) -> Iterator[Raw]:
    yield from raw_messages(
        recording,
        start_ns=window.from_ns,
        end_ns=window.to_ns,
        progress=lambda part: progress(_LOOKING + (1 - _LOOKING) * part),
    )


def _schema(recording: Recording, channel: Channel, books: dict[int, TypeBook]) -> Schema:
    """As the recorder declares it. Raises Undecodable where a recording of catgraph has no such messages."""
    if channel.topic.startswith(OWN) and channel.encoding == "json":
        with contextlib.suppress(KeyError):
            return own_schema(channel.topic.removeprefix(OWN))  # type: ignore[arg-type]
    name = channel.type.replace("/msg/", "/", 1) if channel.encoding == "ros1" else channel.type
    if channel.encoding == "json":
        data = channel.definition or '{"type":"object"}'
        return Schema(name=name, encoding="jsonschema", data=data.encode(), message_encoding="json", encode=None)
    if channel.encoding not in ("ros1", "cdr"):
        raise Undecodable(why_not_decoded(channel.encoding))
    definition = channel.definition
    if channel.format == "none":
        version = recording.ros_version
        known = books.setdefault(version, TypeBook(version)).schema(channel.type)
        if known is None:
            raise Undecodable(f"the definition of {channel.type} is missing")
        return known
    encoding = {"ros1": "ros1msg", "cdr": "ros2idl" if channel.format == "idl" else "ros2msg"}[channel.encoding]
    return Schema(
        name=name, encoding=encoding, data=definition.encode(), message_encoding=channel.encoding, encode=None
    )


def _metadata(recording: Recording, window: Window, before: _Before, clip_of: str) -> dict[str, str]:
    kept = {name: text for name, text in recording.metadata.items() if name not in _OF_THE_FILE}
    return {
        "vehicle": "car",
        **kept,
        **({"settings": before.settings} if before.settings else {}),
        "started_ms": str(window.from_ns // 1_000_000),
        "clip_of": clip_of,
        "clip_at_ms": str(window.at_ns // 1_000_000),
        "clip_from_ms": str(window.from_ns // 1_000_000),
        "clip_to_ms": str(window.to_ns // 1_000_000),
        **before.stood.as_metadata(),
    }


def _short(window: Window, first_ns: int, last_ns: int) -> Iterator[str]:
    """What of the window was not recorded."""
    if first_ns > window.from_ns + 1_000_000_000:
        yield f"The recording begins {(first_ns - window.from_ns) / 1e9:.1f} s after the clip should."
    if last_ns < window.to_ns - 1_000_000_000:
        yield f"The recording ends {(window.to_ns - last_ns) / 1e9:.1f} s before the clip should."


def _damage(recording: Recording, first_ns: int) -> Iterator[str]:
    """What could not be read. That a file has no end yet is no damage to a clip: see `_short`."""
    yield from (f"{sentence}." for sentence in recording.lacking)
    for file in recording.files:
        lost = replace(file.damage, is_cut=False)
        yield from (f"{sentence}." for sentence in lost.sentences(file.path.name, first_ns, file.end_ns))


def _json(data: bytes) -> dict[str, Any]:
    try:
        found = orjson.loads(data)
    except orjson.JSONDecodeError:
        return {}
    return found if isinstance(found, dict) else {}


def _toml(data: bytes) -> str | None:
    text = _json(data).get("toml")
    return text if isinstance(text, str) else None


def _clock(time_ns: int) -> str:
    try:
        return datetime.fromtimestamp(time_ns / 1e9, UTC).strftime("%Y-%m-%d %H:%M:%S")
    except (OverflowError, ValueError, OSError):
        return f"{time_ns / 1e9:.1f} s"

"""Messages of a recording as bytes, in the order of time, for copies that decode and judge nothing.

They come from all of its files; besides them there is what came after it was complete, as messages of catgraph's own
channels: marks, and descriptions of interventions.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import orjson

from server.protocol.driving_state import InterventionDescription
from server.recording.export.export_format import Outcome
from server.recording.marks.described import as_event
from server.recording.marks.recorded import described_late, in_recording, marks_of
from server.recording.marks.rows import entry
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.read import Recording
from server.recording.read.source import Channel, Stream, in_time_order

OWN = "/catgraph/"  # topics that catgraph itself wrote: alarms, phone, settings …
PROGRESS_EVERY = 2000  # messages

_ALARMS, _MARKS = f"{OWN}alarms", f"{OWN}marks"


@dataclass(frozen=True, slots=True)
class Raw:
    """One message."""

    time_ns: int
    file: int  # which of the recording's files
    channel: Channel
    data: bytes


def span_ns(recording: Recording) -> tuple[int, int]:
    """First and last moment; (0, 0) where there is nothing."""
    filled = [file for file in recording.files if any(channel.count for channel in file.channels)]
    if not filled:
        return 0, 0
    return min(file.start_ns for file in filled), max(file.end_ns for file in filled)


def raw_messages(
    recording: Recording,
    *,
    wanted: Callable[[Channel], bool] = lambda channel: True,
    start_ns: int | None = None,
    end_ns: int | None = None,
    progress: Callable[[float], None] = lambda part: None,
) -> Iterator[Raw]:
    """Messages of the wanted channels from `start_ns` to `end_ns`, both included.

    Raises RecordingUnreadable where nothing of any file is whole; what of them is damaged is left out, see
    `recording.damage`.
    """
    first_ns, last_ns = span_ns(recording)
    begin_ns = first_ns if start_ns is None else start_ns
    until_ns = last_ns if end_ns is None else end_ns
    streams = [
        Stream(start_ns=file.start_ns, end_ns=file.end_ns, rows=_of_file(recording, number, wanted, begin_ns))
        for number, file in enumerate(recording.files)
    ]
    length_ns = max(until_ns - begin_ns, 1)
    for count, raw in enumerate(in_time_order(streams, lambda raw: raw.time_ns)):
        if raw.time_ns > until_ns:
            return
        if count % PROGRESS_EVERY == 0:
            progress(min(max((raw.time_ns - begin_ns) / length_ns, 0.0), 1.0))
        yield raw


def _of_file(recording: Recording, number: int, wanted: Callable[[Channel], bool], start_ns: int) -> Iterator[Raw]:
    file = recording.files[number]
    channels = {channel.number: channel for channel in file.channels if channel.count and wanted(channel)}
    if not channels:
        return
    try:
        for time_ns, channel, data in file.messages(set(channels), start_ns):
            yield Raw(time_ns, number, channels[channel], data)
    except (RecordingUnreadable, MemoryError):
        raise
    except Exception as error:  # a damaged file makes the readers fail in every way there is
        raise RecordingUnreadable(f"{file.path} is damaged or not complete: {error}") from None
    if file.damage.is_total:
        recording.assert_some(file)


def later_messages(recording: Recording) -> list[Raw]:
    """What came after a recording was complete, as messages of catgraph's own channels.

    In the order of time. A mark has its own moment; within the span of the recording, so that a bag gets no longer
    by it. A description has the last moment: its own is in its text.
    """
    first_ns, last_ns = span_ns(recording)
    found = [
        _raw(recording, _MARKS, min(max(at_ms * 1_000_000, first_ns), last_ns), orjson.dumps(body))
        for at_ms, body in _later_marks(recording)
    ]
    found += [
        _raw(recording, _ALARMS, last_ns, orjson.dumps(described_event(row))) for row in described_late(recording)
    ]
    return sorted(found, key=lambda raw: raw.time_ns)


def in_time(recorded: Iterator[Raw], later: Sequence[Raw]) -> Iterator[Raw]:
    """Both in the order of time; at one moment what was recorded comes first."""
    return heapq.merge(recorded, later, key=lambda raw: raw.time_ns)


def explain(recording: Recording, later: Sequence[Raw], outcome: Outcome) -> None:
    """Note what a bag has besides what was recorded, and that it has no attachments."""
    if later:
        many = "1 message of catgraph was" if len(later) == 1 else f"{len(later)} messages of catgraph were"
        outcome.notices.append(f"{many} added: marks and descriptions that came after the recording was complete.")
    if any(row["voice"] or row["photo"] for row in marks_of(recording)):
        outcome.notes.append("Voice notes and photos of marks do not fit a bag: the CSV tables have them.")


def described_event(row: InterventionDescription) -> dict[str, object]:
    """As an event of the log, which has a text for people."""
    text = ": ".join(part for part in (row["category"], row["what"]) if part)
    return {**as_event(row), "text": f"An intervention was described after the recording: {text}"}


def _later_marks(recording: Recording) -> Iterator[tuple[int, dict[str, object]]]:
    """Time in ms and entry of each mark that is not as it was recorded."""
    recorded = {row["mark"]: row for row in in_recording(recording)}
    now = {row["mark"]: row for row in marks_of(recording)}
    for mark, row in now.items():
        if row.get("late"):
            yield row["marked_ms"], entry(row, "mark_changed" if mark in recorded else "mark")
    for mark, row in recorded.items():
        if mark not in now:
            yield row["marked_ms"], entry(row, "mark_removed")


def _raw(recording: Recording, topic: str, time_ns: int, data: bytes) -> Raw:
    return Raw(time_ns, 0, _channel(recording, topic), data)


def _channel(recording: Recording, topic: str) -> Channel:
    """That of the first file; one that it does not have is declared."""
    for channel in recording.files[0].channels:
        if channel.topic == topic and channel.encoding == "json":
            return channel
    return Channel(
        number=-1 - (topic == _MARKS),  # no file numbers its channels so
        topic=topic, type="", definition="", format="none", encoding="json", count=1, is_latched=False,
    )  # fmt: skip

"""What came after a recording was complete, as messages of catgraph's own channels: marks, and what was said of
interventions. Copies that decode nothing get it besides what was recorded."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence

import orjson

from server.protocol.driving_state import InterventionDescription
from server.recording.export.outcome import Outcome
from server.recording.export.raw import OWN, Raw, span_ns
from server.recording.marks.described import as_event
from server.recording.marks.of_drive import described_late, in_recording, marks_of
from server.recording.marks.rows import entry
from server.recording.read.read import Recording
from server.recording.read.source import Channel

_ALARMS, _MARKS = f"{OWN}alarms", f"{OWN}marks"


def later_messages(recording: Recording) -> list[Raw]:
    """In the order of time. A mark has its own moment; within the span of the recording, so that a bag gets no longer
    by it. A description has the last moment: its own is in its text."""
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
    """Says what a bag has besides what was recorded, and that it has no attachments."""
    if later:
        many = "1 message of catgraph was" if len(later) == 1 else f"{len(later)} messages of catgraph were"
        outcome.notices.append(f"{many} added: marks and descriptions that came after the recording was complete.")
    if any(row["voice"] or row["photo"] for row in marks_of(recording)):
        outcome.notes.append("Voice notes and photos of marks do not fit a bag: the CSV tables have them.")


def described_event(row: InterventionDescription) -> dict[str, object]:
    """As an event of the log, which has words for people."""
    said = ": ".join(part for part in (row["category"], row["what"]) if part)
    return {**as_event(row), "text": f"An intervention was described after the recording: {said}"}


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

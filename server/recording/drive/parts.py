"""The parts of a drive that is read as one recording: when each was recorded, and the times between them.

Times are seconds since the beginning of the drive.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from monitor.drive_trends import BLIND_S
from server.recording.folder import id_of
from server.recording.read.read import Recording

Span = tuple[float, float]
MOST_NUMBER = 10_000  # of a part


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivePart:
    """One file of ours."""

    id: str
    session: str
    number: int | None  # in its session; None: not known
    from_s: float
    to_s: float
    metadata: Mapping[str, str]


def parts_of(recording: Recording) -> list[DrivePart]:
    """The files of ours, oldest first; none where all are of other programs."""
    found = []
    for file in recording.files:
        metadata: Mapping[str, str] = getattr(file, "metadata", {})  # only files of ours have it
        if metadata and any(channel.count for channel in file.channels):
            part = metadata.get("part", "")
            found.append(
                DrivePart(
                    id=id_of(file.path),
                    session=metadata.get("session", ""),
                    number=int(part) if part.isdecimal() and 0 < int(part[:9]) < MOST_NUMBER else None,
                    from_s=file.start_ns / 1e9 - recording.start_s,
                    to_s=file.end_ns / 1e9 - recording.start_s,
                    metadata=metadata,
                )
            )
    return sorted(found, key=lambda part: part.from_s)


def gaps_of(recording: Recording) -> list[Span]:
    """The times between its files, in which nothing was recorded."""
    spans = sorted(
        (file.start_ns / 1e9 - recording.start_s, file.end_ns / 1e9 - recording.start_s)
        for file in recording.files
        if any(channel.count for channel in file.channels)
    )
    found: list[Span] = []
    until_s = spans[0][1] if spans else 0.0
    for from_s, to_s in spans[1:]:
        if from_s - until_s > BLIND_S:
            found.append((until_s, from_s))
        until_s = max(until_s, to_s)
    return found


def recorded_s(recording: Recording) -> float:
    """How long was recorded: without the times between the parts."""
    return recording.duration_s - sum(to_s - from_s for from_s, to_s in gaps_of(recording))


def outside(span: Span, gaps: Iterable[Span]) -> list[Span]:
    """What of a time is in no gap. `gaps`: in order."""
    found: list[Span] = []
    from_s, end_s = span
    for gap_from_s, gap_to_s in gaps:
        if gap_to_s <= from_s or gap_from_s >= end_s:
            continue
        if gap_from_s > from_s:
            found.append((from_s, gap_from_s))
        from_s = gap_to_s
    return [*found, (from_s, end_s)] if from_s < end_s else found

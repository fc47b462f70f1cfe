"""Messages of a recording as bytes, of all its files in the order of time, for copies that decode and judge nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from server.recording.read.errors import RecordingUnreadable
from server.recording.read.read import Recording
from server.recording.read.source import Channel
from server.recording.read.time_order import Stream, in_time_order

OWN = "/catgraph/"  # topics that catgraph itself wrote: alarms, phone, settings …
PROGRESS_EVERY = 2000  # messages


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

"""The times of the parts of an MCAP file: in the order in which the messages were written, and corrected."""

from __future__ import annotations

import struct
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import IO

import numpy as np
from mcap.opcode import Opcode

from server.recording.mcap.scan import LATEST_NS, Part
from server.recording.read.clock_steps import PLACES_A_PART, Arrivals, Stretch

_HEAD = struct.Struct("<BQHI")  # of a message index: opcode, length, channel, bytes of its entries


def arrivals_of(file: IO[bytes], parts: Sequence[Part]) -> Iterator[Arrivals]:
    """The messages of each part, in the order of the file. Raises OSError."""
    for number, part in enumerate(sorted(parts, key=lambda part: part.at)):
        found = part.arrivals or _indexed(file, part)
        if found is not None:
            yield Arrivals(found.places + number * PLACES_A_PART, found.times_ns, found.channels)


def _indexed(file: IO[bytes], part: Part) -> Arrivals | None:
    """The messages of a chunk by its message indexes; None where these are damaged."""
    file.seek(part.index_at)
    data = file.read(part.index_bytes)
    entries, channels, counts = [], [], []
    at = 0
    while at + _HEAD.size <= len(data):
        opcode, length, channel, size = _HEAD.unpack_from(data, at)
        if opcode != Opcode.MESSAGE_INDEX or size + 6 != length or size % 16:
            return None
        entries.append(data[at + _HEAD.size : at + _HEAD.size + size])
        channels.append(channel)
        counts.append(size // 16)
        at += 9 + length
    joined = b"".join(entries)
    if not joined or at != len(data) or len(joined) != 16 * sum(counts):
        return None
    table = np.minimum(np.frombuffer(joined, "<u8"), LATEST_NS).astype(np.int64).reshape(-1, 2)
    order = np.argsort(table[:, 1], kind="stable")
    numbers = np.repeat(np.array(channels, np.int64), counts)
    return Arrivals(places=table[order, 1], times_ns=table[order, 0], channels=numbers[order])


def corrected_parts(parts: Sequence[Part], stretches: Sequence[Stretch]) -> list[Part]:
    """The parts with the corrections of their times; one in which the clock was set becomes several."""
    starts = [one.place for one in stretches]
    found = []
    for number, part in enumerate(sorted(parts, key=lambda part: part.at)):
        origin = number * PLACES_A_PART
        first = max(bisect_right(starts, origin) - 1, 0)
        behind = max(bisect_left(starts, origin + PLACES_A_PART), first + 1)
        for place, one in enumerate(stretches[first:behind], first):
            is_inner = behind - first > 1
            first_ns, last_ns = part.message_start_time, part.message_end_time
            if is_inner:
                first_ns, last_ns = max(first_ns, one.first_ns), min(last_ns, one.last_ns)
            found.append(
                replace(
                    part,
                    message_start_time=first_ns + one.shift_ns,
                    message_end_time=last_ns + one.shift_ns,
                    shift_ns=one.shift_ns,
                    from_place=max(one.place - origin, 0) if place > first else 0,
                    to_place=stretches[place + 1].place - origin if place + 1 < behind else PLACES_A_PART,
                )
            )
    return found

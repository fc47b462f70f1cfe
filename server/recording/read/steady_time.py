"""Has the files of a recording give times that go on where the recorder's clock was set, and describes each step.

The clock of the last stretch is taken for the right one, as a clock is set to be right; 1970 never is. Where a clock
may have been set, log times are compared with the stamps of sensors that have a clock of their own.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from server.recording.mcap.mcap_file import McapFile
from server.recording.read.clock_steps import (
    BACK_NS,
    FIRST_NS,
    GAP_NS,
    LAST_NS,
    LEAP_NS,
    LEAST,
    UNKNOWN_NS,
    Arrivals,
    Found,
    Ints,
    Jump,
    S,
    Stretch,
    find_steps,
    follows,
    returned,
)
from server.recording.read.source import Channel, FileSource

_UNITS = ((31_557_600, "year", "years"), (86_400, "day", "days"), (3600, "h", "h"), (60, "min", "min"), (1, "s", "s"))
COMPARED = 5  # messages of a channel on each side
LEAST_COMPARED = 3
MOST_CHANNELS = 6
SIDE = 4000  # messages on each side among which they are sought
AFTER_NS = 10 * S  # what waited in a queue has come by then, each later message less late
STEADY_NS = S // 5  # differences of stamp and log time that spread further are of no clock
AGREE_NS = S // 2  # clocks that show a step agree so well
LEAST_STEP_NS = S

_HEADER = re.compile(r"(std_msgs/)?(msg/)?Header\s+\w+")
_STAMPED = re.compile(r"\w+/msg/(Imu|NavSatFix|LaserScan|PointCloud2|Image|CompressedImage|Odometry|\w+Stamped)")
_ROS1 = struct.Struct("<III")  # sequence, seconds, nanoseconds
_CDR = {0: struct.Struct(">4xiI"), 1: struct.Struct("<4xiI")}  # by the second byte: its order of bytes

MOST_NOTED = 10
BETWEEN_FILES_NS = S  # parts of one recording may overlap by less
_PART = re.compile(r"(.*)_(\d+)")


def span(seconds: float) -> str:
    """A span of time in the unit a person would name it in, as "230 days" or "2.5 min"."""
    size, one, many = next((unit for unit in _UNITS if seconds >= 2 * unit[0]), _UNITS[-1])
    count = f"{seconds / size:.1f}".removesuffix(".0")
    return f"{count} {one if count == '1' else many}"


class StampWitness:
    """Compares log times with the stamps of sensors that have a clock of their own.

    Of one file. `raw_at(place, channel)` is the message at a place; None: it cannot be read.
    """

    def __init__(self, channels: Sequence[Channel], raw_at: Callable[[int, int], bytes | None]) -> None:
        self._encodings = {one.number: one.encoding for one in channels if _is_stamped(one)}
        self._raw_at = raw_at

    def ahead_ns(self, found: Arrivals, begin: int, at: int) -> int | None:
        """How far the log time gained on the stamps at a gap: between the messages from `begin` and those from `at` on;
        None: no clock shows it."""
        start, end = max(begin, at - SIDE), at + SIDE
        before = np.arange(start, at)
        after = np.arange(at, at + _goes_on(found.times_ns[at:end]))
        shared, counts = np.unique(found.channels[after], return_counts=True)
        named = [int(one) for one in shared[np.argsort(-counts)] if int(one) in self._encodings]
        shown = []
        for channel in named[:MOST_CHANNELS]:
            old = before[found.channels[before] == channel][-COMPARED:]
            new = after[found.channels[after] == channel]
            if len(old) < LEAST_COMPARED or len(new) < LEAST_COMPARED:
                continue
            new = new[np.linspace(0, len(new) - 1, min(COMPARED, len(new))).astype(int)]
            gained_ns = self._gained(found, old, new)
            if gained_ns is not None and abs(gained_ns) >= LEAST_STEP_NS:
                shown.append(gained_ns)
        return int(np.median(shown)) if shown and max(shown) - min(shown) <= AGREE_NS else None

    def _gained(self, found: Arrivals, old: Sequence[int], new: Sequence[int]) -> int | None:
        was, now = self._ahead_of_stamps(found, old), self._ahead_of_stamps(found, new)
        if was is None or now is None:
            return None
        return int(np.median(now)) - int(np.median(was))

    def _ahead_of_stamps(self, found: Arrivals, indexes: Sequence[int]) -> list[int] | None:
        """Log time minus stamp of these messages [ns]; None where one has no stamp, or they differ."""
        ahead = []
        for index in indexes:
            channel = int(found.channels[index])
            raw = self._raw_at(int(found.places[index]), channel)
            stamp_ns = None if raw is None else _stamp(raw, self._encodings[channel])
            if stamp_ns is None:
                return None
            ahead.append(int(found.times_ns[index]) - stamp_ns)
        return ahead if max(ahead) - min(ahead) <= STEADY_NS else None


def _goes_on(times_ns: Ints) -> int:
    """How many of these times are within AFTER_NS of the first, before they go back or leap."""
    is_other = (times_ns - times_ns[0] > AFTER_NS) | (np.maximum.accumulate(times_ns) - times_ns >= BACK_NS)
    return int(np.argmax(is_other)) if is_other.any() else len(times_ns)


def _is_stamped(channel: Channel) -> bool:
    """Whether its messages begin with a header."""
    if channel.encoding not in ("ros1", "cdr"):
        return False
    if channel.format == "msg":
        lines = (line.partition("#")[0].strip() for line in channel.definition.splitlines())
        return _HEADER.match(next((line for line in lines if line), "")) is not None
    return _STAMPED.fullmatch(channel.type) is not None


def _stamp(raw: bytes, encoding: str) -> int | None:
    """The stamp of a message that begins with a header [ns]; None: there is none."""
    try:
        if encoding == "ros1":
            _, seconds, nanoseconds = _ROS1.unpack_from(raw)
        else:
            seconds, nanoseconds = _CDR[raw[1] & 1].unpack_from(raw)
    except (struct.error, IndexError):
        return None
    return seconds * S + nanoseconds if seconds or nanoseconds else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockStep:
    """The recorder's clock was set."""

    at_s: float  # since the start of the recording, by its corrected times
    by_s: float  # ahead positive, back negative
    at_wall_s: float  # corrected time of day, since 1970

    @property
    def sentence(self) -> str:
        """What happened, for a person, without a full stop."""
        way = "ahead" if self.by_s > 0 else "back"
        return (
            f"The recorder's clock was set {way} by {span(abs(self.by_s))} at {_clock(self.at_wall_s)}, "
            f"{self.at_s:.1f} s after the start: times before and after it are joined"
        )


def notes_on(steps: Sequence[ClockStep]) -> list[str]:
    """A sentence on each of the first steps, and one on the others."""
    notes = [f"{step.sentence}." for step in steps[:MOST_NOTED]]
    more = len(steps) - len(notes)
    return [*notes, f"The recorder's clock was set {more} more times."] if more else notes


@dataclass(slots=True)
class _File:
    source: FileSource
    found: Found
    stretches: list[Stretch]
    is_return: bool = False  # the gap before it is a step of the clock that another one takes back


def make_steady(sources: Sequence[FileSource]) -> list[ClockStep]:
    """Correct the times of files, and list the steps of their clocks in the order of time."""
    files = [_file(source) for source in sources if any(one.count for one in source.channels)]
    pairs = [pair for series in _series(files) for pair in _corrected(_with_returns(series))]
    if not pairs:
        return []
    filled = [file.source for file in files]
    start_ns = min(source.start_ns for source in filled)
    return [
        ClockStep(
            at_s=(one.first_ns + one.shift_ns - start_ns) / S,
            by_s=(before.shift_ns - one.shift_ns) / S,
            at_wall_s=(one.first_ns + one.shift_ns) / S,
        )
        for before, one in sorted(pairs, key=lambda pair: pair[1].first_ns + pair[1].shift_ns)
    ]


def _file(source: FileSource, returns: Collection[int] = ()) -> _File:
    found = find_steps(source.arrivals, StampWitness(source.channels, source.raw_at).ahead_ns, returns)
    count = sum(one.count for one in source.channels)
    whole = Stretch(place=0, count=count, first_ns=source.start_ns, last_ns=source.end_ns)
    return _File(source, found, list(found.stretches) or [whole])


def _with_returns(series: Sequence[_File]) -> Sequence[_File]:
    """Files that follow each other, with the gaps as steps that another step takes back, in whatever file that is."""
    jumps: list[Jump] = []
    owners: list[tuple[int, bool]] = []  # number of the file of each jump, and whether it is the gap before that file
    for number, file in enumerate(series):
        if number:
            before, one = series[number - 1].stretches[-1], file.stretches[0]
            gap_ns = one.first_ns - before.last_ns
            if (is_step := _between(before, one) is not None) or gap_ns > GAP_NS:
                jumps.append(Jump(0, gap_ns, is_sure=is_step))
                owners.append((number, True))
        jumps += file.found.jumps
        owners += [(number, False)] * len(file.found.jumps)
    found = returned(jumps, max((file.found.interval_ns for file in series), default=0))
    made = list(series)
    for number in {owners[index][0] for index in found}:
        own = [index for index in found if owners[index][0] == number]
        places = {jumps[index].place for index in own if not owners[index][1]}
        if places:
            made[number] = _file(series[number].source, places)
        made[number].is_return = any(owners[index][1] for index in own)
    return made


def _corrected(series: Sequence[_File]) -> list[tuple[Stretch, Stretch]]:
    """Corrects the times of files that follow each other; the stretches before and behind each step."""
    flat: list[Stretch] = []
    is_step: list[bool] = []  # between each and the next
    for file in series:
        own = file.stretches
        if flat:
            change_ns = _between(flat[-1], own[0], is_return=file.is_return)
            is_step.append(change_ns is not None)
            first = own[0].moved(flat[-1].shift_ns) if change_ns is None else follows(flat[-1], own[0], change_ns)
            own = [one.moved(first.shift_ns - own[0].shift_ns) for one in own]
        flat += own
        is_step += [True] * (len(own) - 1)
    if not any(is_step):
        return []
    by_ns = -_reference(flat).shift_ns
    by_ns = max(by_ns, -min(one.first_ns + one.shift_ns for one in flat))
    flat = [one.moved(by_ns) for one in flat]
    at = 0
    for file in series:
        file.stretches = flat[at : at + len(file.stretches)]
        at += len(file.stretches)
        if any(one.shift_ns for one in file.stretches):
            file.source.correct(file.stretches)
    return [(flat[place], flat[place + 1]) for place, found in enumerate(is_step) if found]


def _between(before: Stretch, one: Stretch, *, is_return: bool = False) -> int | None:
    """The change of the shift between two files; None: the clock was not set."""
    gap_ns = one.first_ns - before.last_ns
    if is_return or gap_ns < -BETWEEN_FILES_NS or before.last_ns < FIRST_NS <= one.first_ns or gap_ns > LEAP_NS:
        return UNKNOWN_NS - gap_ns
    return None


def _reference(stretches: Sequence[Stretch]) -> Stretch:
    """The stretch whose clock is taken for the right one."""
    likely = [one for one in stretches if FIRST_NS <= one.first_ns and one.last_ns < LAST_NS] or stretches
    return ([one for one in likely if one.count >= LEAST] or likely)[-1]


def _series(files: Sequence[_File]) -> list[list[_File]]:
    """Files of one recording in the order in which they were written; all others by themselves."""
    groups: dict[Hashable, list[tuple[int, _File]]] = {}
    for number, file in enumerate(files):
        key, part = _part_of(file.source) or (number, 0)
        groups.setdefault(key, []).append((part, file))
    series: list[list[_File]] = []
    for group in groups.values():
        parts = [part for part, _ in group]
        if len(set(parts)) < len(parts):
            series += [[file] for _, file in group]
        else:
            series.append([file for _, file in sorted(group, key=lambda one: one[0])])
    return series


def _part_of(source: FileSource) -> tuple[Hashable, int] | None:
    """The recording of which a file is a part, and the number of the part; None: it is not known to be one."""
    if isinstance(source, McapFile) and "session" in source.metadata and "clip_of" not in source.metadata:
        part = source.metadata.get("part", "")
        recording = (source.metadata.get("vehicle", ""), source.metadata["session"])
        return (recording, int(part)) if part.isdecimal() else None
    name = _PART.fullmatch(source.path.name.partition(".")[0])
    return ((source.path.parent, name[1]), int(name[2])) if source.is_listed and name is not None else None


def _clock(at_s: float) -> str:
    try:
        return datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    except (OverflowError, ValueError, OSError):
        return f"{at_s:.1f} s since 1970"

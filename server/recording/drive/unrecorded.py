"""Times of a drive of which its report has no record: a part is missing, is damaged, or the server did not run.

A time between two parts that follow each other in one session is none of them: the recorder keeps the events of the log
meanwhile, and the next part has it. Times are seconds since the beginning of the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from monitor.drive_trends import BLIND_S
from server.recording.chain_neighbours import named, next_behind, read_first_metadata
from server.recording.drive.parts import MOST_NUMBER, DrivePart
from server.recording.folder import first_part, id_of, known_beside, part_id, part_number, readable_beside
from server.recording.read.read import Recording
from server.recording.read.source import is_likely

MOST_NAMED = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Unrecorded:
    """`from_s`, `to_s` None: it is not known since when, or until when."""

    from_s: float | None
    to_s: float | None
    why: str  # as a sentence
    parts: tuple[int, ...] = ()  # numbers of the missing parts
    is_elsewhere: bool = False  # the files of all of them are there, and are not among those of the report

    @property
    def what(self) -> str:
        return "Not in this report" if self.is_elsewhere else "No record here"

    def time(self, clock: Callable[[float], str]) -> str:
        """Its time as text; `clock`: a moment as a time of day."""
        since = "" if self.from_s is None else f"from {clock(self.from_s)}"
        if self.to_s is None:
            return f"{since} on" if since else "at a time that is not known"
        return f"{since} to {clock(self.to_s)}" if since else f"until {clock(self.to_s)}"

    def sentence(self, clock: Callable[[float], str]) -> str:
        return f"{self.what} {self.time(clock)}: {self.why}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Beside:
    """By what parts are known that are not among those of a drive."""

    known: frozenset[str] = frozenset()  # names of recordings in the same folders, or named by one of them
    files: frozenset[str] = frozenset()  # those of them whose files are there, and are not known to be unreadable
    next_s: Mapping[str, float] | None = None  # of a session, by its first part: when the recording behind it began


def unrecorded_of(recording: Recording, parts: Sequence[DrivePart]) -> list[Unrecorded]:
    """All of a recording, in their order; `parts`: its files of ours."""
    cut = _cut(recording)
    ends_s = {one.from_s for one in cut}
    others = [one for one in missing(parts, beside(recording, parts)) if one.parts or one.from_s not in ends_s]
    found = [*others, *cut, *_damaged(recording)]
    return sorted(found, key=lambda one: (one.from_s is not None, one.from_s or 0.0))


def beside(recording: Recording, parts: Sequence[DrivePart]) -> Beside:
    """What the folders of a recording hold. A deleted part is named by the recording behind it."""
    folders = {path.parent for path in recording.paths}
    files = {id for folder in folders for id in readable_beside(folder)} - {id_of(path) for path in recording.paths}
    known = {id for folder in folders for id in known_beside(folder)}
    next_s: dict[str, float] = {}
    for first in dict.fromkeys(first_part(part.id) for part in parts):
        for folder in folders:
            if (path := next_behind(folder, first)) is None:
                continue
            metadata = read_first_metadata(path)
            before = named(metadata)
            if before is not None and first_part(before.id) == first:
                known.add(before.id)
            if (begun := metadata.get("started_ms", "")).isdecimal():
                next_s[first] = int(begun[:15]) / 1000 - recording.start_s
    return Beside(known=frozenset(known), files=frozenset(files), next_s=next_s)


def missing(parts: Sequence[DrivePart], beside: Beside = Beside()) -> list[Unrecorded]:
    """Where parts of its sessions are not there, and where the server was started again between two sessions."""
    parts = sorted((part for part in parts if "clip_of" not in part.metadata), key=lambda part: part.from_s)
    sessions = list(dict.fromkeys(part.session for part in parts))
    found: list[Unrecorded] = []
    is_open = False  # the last part of the session before is missing
    for place, session in enumerate(sessions):
        own = [part for part in parts if part.session == session]
        before = [part for part in parts if part.session in sessions[:place]]
        behind = [part for part in parts if part.session in sessions[place + 1 :]]
        until_s = max((part.to_s for part in before), default=None)
        first = own[0]
        runs = list(_runs(own, beside)) if session else []
        for numbers, earlier, later in runs:
            next_s = (beside.next_s or {}).get(first_part(first.id)) if not behind else behind[0].from_s
            elsewhere = [n for n in numbers if part_id(first_part(first.id), n) in beside.files]
            found.append(
                Unrecorded(
                    from_s=earlier.to_s if earlier is not None else until_s,
                    to_s=later.from_s if later is not None else next_s,
                    why=_why(numbers, elsewhere, first.id, is_end=later is None and next_s is not None),
                    parts=numbers,
                    is_elsewhere=len(elsewhere) == len(numbers),
                )
            )
        is_named = any(earlier is None for _, earlier, _ in runs) or is_open
        if until_s is not None and not is_named and first.from_s - until_s > BLIND_S:
            found.append(Unrecorded(from_s=until_s, to_s=first.from_s, why="nothing was recorded between them."))
        is_open = any(later is None for *_, later in runs)
    return found


def _runs(
    own: Sequence[DrivePart], beside: Beside
) -> Iterator[tuple[tuple[int, ...], DrivePart | None, DrivePart | None]]:
    """Missing numbers that follow each other, with the part before and the part behind them."""
    there = {part.number: part for part in own if part.number is not None}
    firsts = {first_part(part.id) for part in own}
    known = {number for id in beside.known if first_part(id) in firsts and (number := part_number(id)) < MOST_NUMBER}
    newest = max({*there, *known}, default=0)
    run: list[int] = []
    for number in range(1, newest + 2):
        if number not in there and number <= newest:
            run.append(number)
        elif run:
            yield tuple(run), there.get(run[0] - 1), there.get(number)
            run = []


def _why(numbers: Sequence[int], elsewhere: Sequence[int], first: str, *, is_end: bool) -> str:
    why = f"{_parts(numbers)} of the drive of {first} {'are' if len(numbers) > 1 else 'is'} not in this report"
    if not elsewhere:
        return f"{why}: not readable, deleted, or not among its files."
    end = " When it ended, and whether anything was recorded behind it, is not known." if is_end else ""
    which = "" if len(elsewhere) == len(numbers) else f" of {_parts(elsewhere).lower()}"
    return f"{why}: the file{which} is being recorded, in the trash, or beside the others.{end}"


def _parts(numbers: Sequence[int]) -> str:
    more = f" and {len(numbers) - MOST_NAMED} more" if len(numbers) > MOST_NAMED else ""
    return f"{'Parts' if len(numbers) > 1 else 'Part'} {', '.join(map(str, numbers[:MOST_NAMED]))}{more}"


def _damaged(recording: Recording) -> Iterator[Unrecorded]:
    """What of the files cannot be read."""
    origin_ns = round(recording.start_s * 1e9)
    for file in recording.files:
        why = f"{file.path.name} is damaged there."
        for span in file.damage.lost:
            if is_likely(span, origin_ns, file.end_ns):
                from_s, to_s = (ns / 1e9 - recording.start_s for ns in span)
                yield Unrecorded(from_s=from_s, to_s=to_s, why=why)
            else:
                yield Unrecorded(from_s=None, to_s=None, why=f"{file.path.name} is damaged.")


def _cut(recording: Recording) -> list[Unrecorded]:
    """What was in the ends that files lack. What the log had there is in no later part."""
    filled = [file for file in recording.files if any(channel.count for channel in file.channels)]
    found = []
    for file in filled:
        if not file.damage.is_cut:
            continue
        later_ns = min(
            (one.start_ns for one in filled if one.start_ns >= file.end_ns and one is not file), default=None
        )
        found.append(
            Unrecorded(
                from_s=file.end_ns / 1e9 - recording.start_s,
                to_s=None if later_ns is None else later_ns / 1e9 - recording.start_s,
                why=f"{file.path.name} was never closed, and what followed in it is missing.",
            )
        )
    return found

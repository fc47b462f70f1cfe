"""The marks of one vehicle: placed, changed and removed, each logged, and recorded at its own moment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from monitor.alarm import Refused
from server.bus.bus import SessionBus
from server.control.authorization import Caller
from server.control.duty import acting_as
from server.protocol.alarm_state import Note
from server.protocol.drive_commands import MarkCommand, PlaceMark, RemoveMark
from server.protocol.marks import DriveMark, MarkList, MarkSource
from server.recording.controller import SessionRecording
from server.recording.marks.media import MediaName, name_of
from server.recording.marks.rows import CHANGES, MOST_CATEGORY, MOST_WORDS, entry, row_of
from server.recording.recorder_queue import Attachment
from server.recording.recording_clock import STEP_MS, ClockHistory
from server.system.clean_text import clean
from server.vehicle.car_marks import CarMarks

MOST = 2000  # marks of one drive, by people
MOST_OF_CAR = 500  # by the car's own button
KNOWN = 2 * MOST  # marks that are known by their ids, those of earlier drives and removed ones among them
OLDEST_MS = 30 * 24 * 3600 * 1000  # a mark that waited longer on a phone has lost its moment
LATE_MS = 60_000  # the event of a mark that comes so late names that
_PORTION = 500


@dataclass(frozen=True, slots=True)
class _Known:
    row: DriveMark
    drive: int  # 0: of an earlier one
    is_removed: bool = False
    moment_s: float | None = None  # by the session's clock, which is never set; None: of before the server started


@dataclass(frozen=True, slots=True)
class _Moment:
    """When a mark was made, by the session's clock."""

    at_s: float
    note: str
    is_arrival: bool = False  # its own time cannot be


@dataclass(frozen=True, slots=True, kw_only=True)
class MarksPlace:
    """Where what is no part of a recording is stored."""

    on_late: Callable[[int], None]  # with the moment [ms since 1970] of a mark that none covers
    on_described: Callable[[int, str], None]  # with that of an intervention that somebody described, and its id
    media: Path | None  # the folder of voice notes and photos; None: there are none


NO_PLACE = MarksPlace(on_late=lambda _: None, on_described=lambda *_: None, media=None)


class Marks:
    """Of one vehicle. `wall_ms`: time of day in ms since 1970."""

    def __init__(
        self,
        note: Note,
        recording: SessionRecording,
        *,
        wall_ms: Callable[[], int],
        place: MarksPlace,
        history: ClockHistory | None = None,
    ) -> None:
        """`history`: the server's clock; None: it is never set."""
        self._note = note
        self._recording = recording
        self._wall_ms = wall_ms
        self._history = history or ClockHistory(lambda: wall_ms() / 1000, wall_ms)
        self._on_late = place.on_late
        self._media = place.media
        self._known: dict[str, _Known] = {}  # the newest last
        self._drive = 1
        self.count = 0  # of this drive
        self._by_car = 0  # of those
        self._texts_by_car: dict[str, None] = {}  # texts with which its button marked, whatever became of these marks

    # -- orders ------------------------------------------------------------------------------------------------------

    def execute(self, command: MarkCommand, *, by: str, source: MarkSource) -> None:
        """Raises Refused."""
        if isinstance(command, RemoveMark):
            self._remove(command.mark, by=by)
            return
        text = None if command.words is None else clean(command.words, MOST_WORDS).strip()
        category = None if command.category is None else clean(command.category, MOST_CATEGORY).strip()
        known = self._known.get(command.mark)
        if known is not None:
            if not known.is_removed:  # what was taken back stays so, though it is sent again
                self._change(known, command, text=text, category=category, by=by)
            return
        if self.count - self._by_car >= MOST:
            raise Refused(f"This drive has {MOST} marks, which is the most there can be: take one back first.")
        found = self._moment(command)
        marked_ms = self._history.placed(found.at_s).ms
        row: DriveMark = {
            "mark": command.mark, "marked_ms": marked_ms, "category": category or None, "words": text or "",
            "voice": False, "photo": False, "source": source, "by": by,
        }  # fmt: skip
        self._put(row, "mark", f"Mark{_described(row)}.{found.note}", by=by, moment_s=found.at_s)

    def place(self, mark: str, text: str, suffix: str = "") -> None:
        """The car's own button."""
        if self._by_car >= MOST_OF_CAR:
            raise Refused(f"This drive has {MOST_OF_CAR} marks of the car, which is the most there can be.")
        row: DriveMark = {
            "mark": mark, "marked_ms": self._wall_ms(), "category": None,
            "words": _cleaned(text), "voice": False, "photo": False, "source": "car", "by": None,
        }  # fmt: skip
        moment_s = self._history.look()
        self._put(row, "mark", f"Mark by the car{_described(row)}.{suffix}", by=None, moment_s=moment_s)
        self._texts_by_car[row["words"]] = None

    def button(self, now_s: float, *, read_s: Callable[[float], float | None]) -> CarMarks:
        """The car's own button; `now_s`: of the clock by which its messages come. `read_s`: as `CarMarks` has it."""
        return CarMarks(
            self.place,
            lambda text: self._note("mark_refused", text),
            is_known=lambda text: _cleaned(text) in self._texts_by_car,
            read_s=read_s,
            now_s=now_s,
        )

    def answer_file(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Whether a mark takes a file, or, where `file` names one, that it is in the folder by now."""
        caller = Caller.of(message)
        file = name_of(str(message.get("file")))
        try:
            row = self.need(str(message.get("mark")))
            if file is None or self._media is None:
                return row
            with acting_as(caller.name, caller.person):
                return self._attach(file, self._media / file.file, by=caller.name)
        except Refused as why:
            return {"ok": False, "reason": why.reason}

    def _attach(self, file: MediaName, path: Path, *, by: str | None) -> DriveMark:
        """Raises Refused."""
        old = self.need(file.mark)
        moment_s = self._known[file.mark].moment_s
        is_voice = file.kind == "voice"
        row: DriveMark = {**old, "voice": is_voice or old["voice"], "photo": old["photo"] or not is_voice}
        if row != old:
            what = "A voice note was added" if is_voice else "A photo was added"
            self._put(row, "mark_changed", f"{what} to a mark{_described(row)}.", by=by, moment_s=moment_s)
        row, is_over = self._placed(row, moment_s)
        at_ns = row["marked_ms"] * 1_000_000
        if is_over or not self._recording.attach(
            Attachment(path=path, name=file.attachment, media_type=file.media_type, at_ns=at_ns)
        ):
            self._on_late(row["marked_ms"])
        return row

    def need(self, mark: str) -> DriveMark:
        """A mark that is known. Raises Refused."""
        known = self._known.get(mark)
        if known is None:
            raise Refused("This mark is not known here: send the mark first.")
        if known.is_removed:
            raise Refused("This mark was taken back.")
        return known.row

    def _remove(self, mark: str, *, by: str) -> None:
        known = self._known.get(mark)
        if known is None:
            raise Refused("There is no such mark.")
        if not known.is_removed:
            text = f"A mark was taken back{_described(known.row)}."
            self._put(known.row, "mark_removed", text, by=by, moment_s=known.moment_s)

    def _change(self, known: _Known, command: PlaceMark, *, text: str | None, category: str | None, by: str) -> None:
        old, moment_s, note = known.row, known.moment_s, ""
        marked_ms = old["marked_ms"]
        if command.at_ms is not None and not (found := self._moment(command)).is_arrival:
            moment_s, note = found.at_s, found.note  # else it is as it was when it came first
            marked_ms = _kept_ms(marked_ms, self._history.placed(moment_s).ms, least_ms=1)
        new: DriveMark = {
            **old,
            "marked_ms": marked_ms,
            "words": old["words"] if text is None else text,
            "category": old["category"] if category is None else category or None,
        }
        if new != old:
            self._put(new, "mark_changed", f"A mark was changed{_described(new)}.{note}", by=by, moment_s=moment_s)

    def _moment(self, command: PlaceMark) -> _Moment:
        """The moment that counts, and a note on it."""
        now_s, now_ms, at_ms = self._history.look(), self._wall_ms(), command.at_ms
        if at_ms is None:
            return _Moment(now_s, "")
        at_s = self._history.moment_s(at_ms, command.age_ms)
        if at_s is None:
            ahead = f" Its time was {_span(at_ms - now_ms)} ahead of the server's clock: the time it arrived counts."
            return _Moment(now_s, ahead, is_arrival=True)
        late_ms = (now_s - at_s) * 1000
        if late_ms > OLDEST_MS:
            old = f" Its time was {_span(late_ms)} ago, which cannot be: the time it arrived counts."
            return _Moment(now_s, old, is_arrival=True)
        return _Moment(at_s, f" It arrived {_span(late_ms)} after its moment." if late_ms > LATE_MS else "")

    def _put(self, row: DriveMark, change: str, text: str, *, by: str | None, moment_s: float | None) -> None:
        is_removed = change == "mark_removed"
        before = self._known.get(row["mark"])
        drive = self._drive if before is None else before.drive
        row, is_over = self._placed(row, moment_s)
        self._keep(row["mark"], _Known(row, drive, is_removed, moment_s))
        if is_removed:
            self._note("mark_removed", text, by=by, mark=row["mark"])
        else:
            self._note(change, text, by=by, **{name: value for name, value in row.items() if name != "by"})  # type: ignore[arg-type]
        at_ms = row["marked_ms"] if change == "mark" else max(row["marked_ms"], self._wall_ms())
        if is_over or not self._recording.mark(entry(row, change), row["marked_ms"], at_ms):
            self._on_late(row["marked_ms"])

    def _placed(self, row: DriveMark, moment_s: float | None) -> tuple[DriveMark, bool]:
        """A mark by the clock of the recording that covers it, which may have been set since; whether that is over."""
        if moment_s is None:
            return row, False
        placed = self._history.placed(moment_s)
        return {**row, "marked_ms": _kept_ms(row["marked_ms"], placed.ms, least_ms=STEP_MS)}, placed.is_over

    # -- what there is -----------------------------------------------------------------------------------------------

    def rows(self) -> MarkList:
        """The marks of this drive."""
        rows = [one.row for one in self._known.values() if one.drive == self._drive and not one.is_removed]
        return {"marks": sorted(rows, key=lambda row: row["marked_ms"])}

    def begin_drive(self) -> None:
        """Another drive begins; the marks of the one before can still be changed."""
        self._drive += 1
        self._count()

    def restore(self, bus: SessionBus, vehicle: str) -> None:
        """At the start: the marks of the drive that went on when the server ended, and those before, from the log."""
        began = _drive_began(bus, vehicle)
        for event in logged(bus, vehicle):
            if not isinstance(mark := event.get("mark"), str):
                continue  # damaged: it names no mark
            row, before = row_of(event), self._known.get(mark)
            if before is not None and event["change"] == "mark_removed":
                self._known[mark] = replace(before, is_removed=True)
            elif row is not None:
                drive = before.drive if before is not None else self._drive if event["n"] > began else 0
                self._known[row["mark"]] = _Known(row, drive)
                if event["change"] == "mark" and row["source"] == "car":
                    self._texts_by_car[row["words"]] = None
        self._count()

    def _keep(self, mark: str, known: _Known) -> None:
        self._known[mark] = known
        while len(self._known) > KNOWN:
            old = next((one for one, kept in self._known.items() if kept.drive != self._drive or kept.is_removed), None)
            if old is None:
                break
            del self._known[old]
        self._count()

    def _count(self) -> None:
        rows = [one.row for one in self._known.values() if one.drive == self._drive and not one.is_removed]
        self.count, self._by_car = len(rows), sum(row["source"] == "car" for row in rows)


def logged(bus: SessionBus, vehicle: str) -> list[dict[str, Any]]:
    """The newest events of marks in the log, in their order; waits for the disk."""
    found = [event for change in CHANGES for event in _newest(bus, vehicle, change)]
    return sorted(found, key=lambda event: event["n"])


def _newest(bus: SessionBus, vehicle: str, change: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    before: int | None = None
    while len(found) < KNOWN and (events := bus.past_events(vehicle, change=change, before=before, limit=_PORTION)):
        found += events
        before = events[-1]["n"]
    return found


def _drive_began(bus: SessionBus, vehicle: str) -> int:
    """Number of the event with which the newest drive began; 0: none is known."""
    before: int | None = None
    while events := bus.past_events(vehicle, change="started", before=before, limit=_PORTION):
        for event in events:
            if event.get("resumes") is not True:
                return int(event["n"])
        before = events[-1]["n"]
    return 0


def _cleaned(text: str) -> str:
    return clean(text, MOST_WORDS).strip()


def _described(row: DriveMark) -> str:
    """For the text of an event."""
    category = f", {row['category']}" if row["category"] else ""
    return f"{category}: {row['words']}" if row["words"] else category


def _kept_ms(before_ms: int, after_ms: int, *, least_ms: int) -> int:
    """A time of day that is only changed by so much."""
    return after_ms if abs(after_ms - before_ms) > least_ms else before_ms


def _span(ms: float) -> str:
    s = round(ms / 1000)
    if s < 120:
        return f"{s} s"
    return f"{s // 60} min" if s < 7200 else f"{s // 3600} h" if s < 172_800 else f"{s // 86_400} days"

"""The marks of one vehicle: how many, of which drive, and what the log gives back after the end of the server."""

from __future__ import annotations

from typing import Any, cast

import pytest

from monitor.alarm import Refused
from server.bus.journal import Journal
from server.protocol.drive_commands import PlaceMark, RemoveMark
from server.vehicle.car_marks import ButtonSubscription
from server.vehicle.marks import MOST, MOST_OF_CAR, Marks, MarksPlace

NOW_MS = 1_700_000_000_000


class World:
    """A log, a recording that covers what is later than `since_ms`, and the clock."""

    def __init__(self) -> None:
        self.journal = Journal(None)
        self.now_ms = NOW_MS
        self.since_ms = NOW_MS
        self.recorded: list[tuple[dict[str, Any], int]] = []
        self.late: list[int] = []

    def note(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None:
        event = {"at_ms": self.now_ms, "alarm": None, "change": change, "text": text, "by": by, **more}
        self.journal.append("car", [event])

    def mark(self, event: dict[str, Any], marked_ms: int, at_ms: int) -> bool:
        if marked_ms < self.since_ms:
            return False
        self.recorded.append((event, at_ms))
        return True

    def past_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        return self.journal.find(vehicle, **filters)

    def marks(self) -> Marks:
        place = MarksPlace(on_late=self.late.append, on_described=lambda *_: None, media=None)
        marks = Marks(self.note, cast("Any", self), wall_ms=lambda: self.now_ms, place=place)
        marks.restore(cast("Any", self), "car")
        return marks


def placed(marks: Marks, mark: str, **fields: Any) -> None:
    marks.execute(PlaceMark(kind="mark", mark=mark, **fields), by="Ana", source="page")


def ids(marks: Marks) -> list[str]:
    return [row["mark"] for row in marks.rows()["marks"]]


def test_a_drive_has_so_many_and_no_more() -> None:
    world = World()
    marks = world.marks()
    for number in range(MOST):
        placed(marks, f"m-{number}")
    with pytest.raises(Refused, match="2000 marks, which is the most there can be: take one back first"):
        placed(marks, "more")
    placed(marks, "m-7", words="changed")
    marks.execute(RemoveMark(kind="remove_mark", mark="m-8"), by="Ana", source="page")
    placed(marks, "more")
    assert marks.count == MOST
    marks.begin_drive()
    assert (marks.count, ids(marks)) == (0, [])
    placed(marks, "m-7", words="changed again")
    assert marks.count == 0, "it is of the drive before"
    for number in range(MOST):
        placed(marks, f"n-{number}")
    assert marks.count == MOST


def test_a_car_that_never_stops_leaves_room_for_people() -> None:
    world = World()
    marks = world.marks()
    for number in range(MOST_OF_CAR):
        marks.place(f"car-{number}", "")
    for again in (marks, world.marks()):
        with pytest.raises(Refused, match="500 marks of the car, which is the most there can be"):
            again.place("car-more", "")
    for number in range(MOST):
        placed(marks, f"m-{number}")
    with pytest.raises(Refused, match="2000 marks"):
        placed(marks, "more")
    assert marks.count == MOST + MOST_OF_CAR
    marks.begin_drive()
    marks.place("car-again", "")
    assert marks.count == 1


def test_the_log_gives_back_this_drive_and_knows_the_ones_before() -> None:
    world = World()
    world.note("started", "")
    marks = world.marks()
    placed(marks, "old")
    world.note("started", "")
    marks.begin_drive()
    for mark in ("a", "b", "c"):
        placed(marks, mark, at_ms=NOW_MS - 5000.0)
    placed(marks, "b", words="changed", at_ms=NOW_MS - 9000.0)
    marks.execute(RemoveMark(kind="remove_mark", mark="c"), by="Ana", source="page")
    before = marks.rows()
    for _ in range(2):
        again = world.marks()
        assert again.rows() == before
        assert ids(again) == ["b", "a"]
        events = world.journal.last("car")
        for mark in ("old", "a", "c"):
            placed(again, mark)
        assert world.journal.last("car") == events, "nothing is new"
        world.note("started", "", resumes=True)


def test_a_mark_is_recorded_at_its_moment_or_told_to_be_late() -> None:
    world = World()
    marks = world.marks()
    world.now_ms += 10_000
    placed(marks, "in", at_ms=NOW_MS + 1000.0)
    placed(marks, "late", at_ms=NOW_MS - 1000.0)
    placed(marks, "in", words="more")
    assert [(event["mark"], event["change"], at_ms) for event, at_ms in world.recorded] == [
        ("in", "mark", NOW_MS + 1000),
        ("in", "mark_changed", NOW_MS + 10_000),
    ]
    assert world.late == [NOW_MS - 1000]


def test_what_the_button_said_before_is_known_after_a_restart() -> None:
    """A bridge gives a latched message to each new connection, also one whose mark was changed or taken back."""
    world = World()
    marks = world.marks()
    marks.place("car-1", " door ")
    marks.place("car-2", "gate")
    placed(marks, "car-1", words="changed")
    marks.execute(RemoveMark(kind="remove_mark", mark="car-2"), by="Ana", source="page")
    button = world.marks().button(0.0, read_s=lambda sent_s: sent_s)
    before = world.journal.last("car")
    for n, words in enumerate(("door", "gate", "gate  ", "door\t")):
        assert not button.receive({"data": words}, 10.3 + n * 0.01, ButtonSubscription(10.0))
    events = world.past_events("car", change="mark_refused")
    assert len(events) == 1
    assert world.journal.last("car") == before + 1


def test_a_damaged_event_of_the_log_loses_no_mark() -> None:
    world = World()
    marks = world.marks()
    for mark in ("a", "b"):
        placed(marks, mark, words=mark)
    before = marks.rows()
    for damaged in (["a"], {"a": 1}, None, 7, "no id: §"):
        for change in ("mark", "mark_changed", "mark_removed"):
            world.note(change, "", mark=damaged, marked_ms=NOW_MS)
    world.note("mark_changed", "", mark="a", marked_ms="soon")  # of a known mark: it stays as it was
    assert world.marks().rows() == before

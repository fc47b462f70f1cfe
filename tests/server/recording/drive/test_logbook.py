"""The logbook from the figures of drives."""

from __future__ import annotations

import time
from typing import Any

import orjson
import pytest

from server.recording.drive.logbook import DAY_MS, WEEK_MS, drives_of, logbook, weeks_of

LATE = '{"marks":[],"removed":[],"described":[]}'  # nothing came
MONDAY = 1_700_438_400_000  # 20 November 2023


def row(n: int, at_ms: int, *, session: str | None = None, km: float = 10.0, **more: Any) -> tuple[Any, ...]:
    share = {"autonomous": 0.8, "manual": 0.2, "unknown": 0.0}
    figures = {
        "distance_m": km * 1000,
        "driven_s": 600.0,
        "blind_s": 0.0,
        "modes": {mode: {"m": km * 1000 * part, "s": 600 * part} for mode, part in share.items()},
        "alarms": 1,
        "interventions": 0,
        "marks": 0,
        "departure": "signed",
        "components": {"Laser": 1},
        "people": ["A. K."],
    }
    return (f"r{n}", "car", at_ms, "", "[]", session, 1, orjson.dumps(figures | more).decode(), LATE, None, None)


def test_parts_of_a_session_are_one_drive() -> None:
    rows = [row(1, MONDAY, session="s", departure="none"), row(2, MONDAY + 9, session="s"), row(3, MONDAY + 99)]
    first, second = drives_of(rows)
    assert (first["id"], first["parts"], first["distance_m"], first["alarms"]) == ("r1", 2, 20_000, 2)
    assert (first["departure"], first["components"], second["parts"]) == ("signed", {"Laser": 2}, 1)


def test_a_drive_goes_on_after_a_restart_of_the_server() -> None:
    rows = [
        row(1, MONDAY, session="a"),
        row(2, MONDAY + 700_000, session="b", resumes=True),
        row(3, MONDAY + 1_400_000, session="b"),
        row(4, MONDAY + 2_100_000, session="c", resumes=True),
        row(5, MONDAY + 20 * 3_600_000, session="d", resumes=True),
        ("r6", "other", *row(6, MONDAY + 2_200_000, session="e", resumes=True)[2:]),
    ]
    drives = drives_of(rows)
    assert [(drive["id"], drive["parts"], drive["distance_m"]) for drive in drives] == [
        ("r1", 4, 40_000),
        ("r6", 1, 10_000),  # of another car
        ("r5", 1, 10_000),  # too long after
    ]


@pytest.mark.parametrize("what", ["interventions", "alarms"])
@pytest.mark.parametrize("counts", [(3, None), (None, 3)], ids=["first", "last"])
def test_a_part_that_does_not_know_makes_no_rate_better(what: str, counts: tuple[int | None, int | None]) -> None:
    rows = [row(n, MONDAY + n, session="s", **{what: count}) for n, count in enumerate(counts)]
    found = logbook(drives_of([*rows, row(9, MONDAY + 99, **{what: 2})]), now_ms=MONDAY)
    drive = found["drives"][-1]
    assert (drive["interventions"] if what == "interventions" else drive["alarms"]) is None
    assert (found["totals"]["interventions"], found["totals"]["alarms"])[what == "alarms"] == {
        "interventions": 25.0,
        "alarms": 20.0,
    }[what]


@pytest.mark.parametrize(
    ("states", "whole"),
    [
        (("signed", "open"), "open"),
        (("signed", "open", "none"), "open"),
        (("open", "signed", None), "signed"),
        (("none", None), "none"),
        ((None, "none"), "none"),
        ((None, None), None),
    ],
    ids=["reopened", "silent", "log-lost", "none", "none-later", "not-known"],
)
def test_the_newest_part_with_a_check_shows_whether_it_was_checked(
    states: tuple[str | None, ...], whole: object
) -> None:
    (drive,) = drives_of([row(n, MONDAY + n, session="s", departure=state) for n, state in enumerate(states)])
    assert drive["departure"] == whole


def test_rates_count_only_drives_that_know() -> None:
    rows = [row(1, MONDAY, interventions=3), row(2, MONDAY, interventions=None, alarms=None, km=90)]
    found = logbook(drives_of(rows), now_ms=MONDAY)
    assert (found["totals"]["interventions"], found["totals"]["alarms"]) == (37.5, 10.0), "3 on 8 km driven by itself"
    assert found["totals"]["distance_m"] == 100_000
    assert found["weeks"][0]["interventions"] == 37.5


def test_a_week_without_a_drive_ends_the_line() -> None:
    counts = [1, 2, 9, 4, 5, 6, None, 8]
    rows = [
        row(n, MONDAY + n * WEEK_MS, km=125.0, interventions=count)
        for n, count in enumerate(counts)
        if count is not None
    ]
    weeks = weeks_of(drives_of(rows))
    assert [week["interventions"] for week in weeks] == counts
    assert [week["interventions_median"] for week in weeks] == [1, 1.5, 2, 3, 4, 5, None, 8]
    assert [week["drives"] for week in weeks] == [1, 1, 1, 1, 1, 1, 0, 1]


def test_one_person_and_missing_checks() -> None:
    rows = [
        row(1, MONDAY, people=["B"], departure="none"),
        row(2, MONDAY, departure="open"),
        row(3, MONDAY, departure=None),
    ]
    found = logbook(drives_of(rows), person="B", now_ms=MONDAY)
    assert (found["totals"]["drives"], found["people"]) == (1, ["A. K.", "B"])
    whole = logbook(drives_of(rows), now_ms=MONDAY)["totals"]
    assert (whole["checks_missing"], whole["checks_known"]) == (2, 2)


def test_what_came_later_counts_without_reading_the_recording_again() -> None:
    marks = [{"mark": name, "marked_ms": 5} for name in ("a", "b")]
    late = {"marks": [{"mark": "c", "marked_ms": 6}], "removed": ["a"], "described": [{"intervention": "i1"}]}
    before = row(1, MONDAY, interventions=2, undescribed=2, marks=2)
    (drive,) = drives_of([(*before[:8], orjson.dumps(late), orjson.dumps(marks), '["i1", "i2"]')])
    assert (drive["marks"], drive["undescribed"]) == (2, 1)
    (drive,) = drives_of([(*before[:8], orjson.dumps({**late, "removed": []}), orjson.dumps(marks), None)])
    assert (drive["marks"], drive["undescribed"]) == (3, 2)
    (drive,) = drives_of([row(1, MONDAY)])
    assert drive["undescribed"] is None, "figures of before say nothing of it"


def test_the_newest_signed_check_of_each_car() -> None:
    check = {"at_ms": MONDAY + 7, "by": "A. K.", "failed": 2, "items": ["Tyres"]}
    rows = [
        row(1, MONDAY, check={**check, "at_ms": 5}),
        row(2, MONDAY + 10, check=check, km=1.0),
        row(3, MONDAY + 20, departure="none", km=2.0),
        row(4, MONDAY + 30, departure=None, distance_m=None),
        row(5, MONDAY + 40, departure="open", km=4.0),
        ("r6", "other", *row(6, MONDAY, departure="none", distance_m=None)[2:]),
    ]
    drives = drives_of(rows)
    mine, other = logbook(drives[:1], every=drives, now_ms=MONDAY)["checks"]
    assert mine == {
        "vehicle": "car", "signed_ms": MONDAY + 7, "by": "A. K.", "failed": 2, "failed_items": ["Tyres"],
        "distance_m": 7000.0, "unmeasured": 1, "drives": 3, "not_known": 1, "recurring": [],
    }  # fmt: skip
    assert (other["signed_ms"], other["distance_m"], other["drives"], other["failed"]) == (None, None, 1, 0)


def every(item: str, *, days: int | None = None, km: float | None = None, is_done: bool = True) -> dict[str, Any]:
    return {"item": item, "title": item, "every_days": days, "every_km": km, "is_done": is_done}


def checked(n: int, day: int, *items: dict[str, Any], km: float | None = 10.0) -> tuple[Any, ...]:
    at_ms = MONDAY + day * DAY_MS
    check = {"at_ms": at_ms, "by": "A. K.", "failed": 0, "items": [], "recurring": list(items)}
    return row(n, at_ms, km=km or 0.0, **({"distance_m": None} if km is None else {}), check=check)


def due_on(day: float, *rows: tuple[Any, ...]) -> dict[str, tuple[Any, ...]]:
    drives = drives_of(rows)
    (check,) = logbook([], every=drives, now_ms=MONDAY + round(day * DAY_MS))["checks"]
    return {
        one["item"]: (one["due_days"], one["due_km"], one["is_least"], one["is_overdue"]) for one in check["recurring"]
    }


def test_an_item_is_due_so_long_and_so_far_after_the_check_in_which_it_was_done() -> None:
    first = checked(1, 0, every("brakes", days=30), every("laser", km=35), every("tyres", days=9, km=500))
    later = checked(2, 8, every("brakes", days=30, is_done=False), every("laser", km=35, is_done=False), km=30.0)
    both = (first, later)
    assert due_on(8.5, first) == {
        "tyres": (0, 490.0, False, False), "laser": (None, 25.0, False, False), "brakes": (21, None, False, False),
    }  # fmt: skip
    assert due_on(30, *both) == {"laser": (None, -5.0, False, True), "brakes": (0, None, False, False)}
    assert due_on(30.01, *both)["brakes"] == (-1, None, False, True)
    assert due_on(41.5, *both)["brakes"] == (-12, None, False, True)
    again = checked(3, 31, every("brakes", days=30), every("laser", km=35))
    assert due_on(32, *both, again) == {"laser": (None, 25.0, False, False), "brakes": (29, None, False, False)}


def test_what_was_never_done_is_overdue_and_comes_first() -> None:
    found = due_on(1, checked(1, 0, every("new", days=300, is_done=False), every("old", days=1)))
    assert list(found) == ["new", "old"]
    assert found["new"] == (None, None, False, True)


def test_a_distance_that_is_not_known_makes_nothing_certain() -> None:
    unknown = checked(1, 0, every("laser", km=35), km=None)
    assert due_on(1, unknown) == {"laser": (None, None, True, False)}
    assert due_on(1, unknown, row(2, MONDAY + 5, km=40, departure="none")) == {"laser": (None, -5.0, True, True)}


def test_the_newest_list_decides_which_items_there_are() -> None:
    rows = (checked(1, 0, every("gone", days=1), every("kept", days=1)), checked(2, 5, every("kept", days=9)))
    assert due_on(6, *rows) == {"kept": (8, None, False, False)}


@pytest.mark.field
def test_nothing_and_very_much() -> None:
    assert logbook([], now_ms=MONDAY)["weeks"] == []
    rows = [row(n, MONDAY + n * 3_600_000) for n in range(5000)]
    began_s = time.perf_counter()
    found = logbook(drives_of(rows), now_ms=MONDAY)
    assert time.perf_counter() - began_s < 5
    assert (found["totals"]["drives"], len(found["drives"])) == (5000, 200)

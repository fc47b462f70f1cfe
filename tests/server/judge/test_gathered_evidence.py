"""A recording is looked into before it is judged: in a few places, within bounds, and without a trace."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

import pytest

from server.judge.sources.evidence import PLACES, WINDOW_S, gather
from tests.server.judge.test_sources import FIX, LASERS, ODOM, odometry, scan, shown

Row = tuple[float, str, str, Any]


class Drive:
    """Rows of a drive, which counts what is read of it."""

    start_s = 1000.0

    def __init__(self, rows: list[Row], breaks_at_s: float = 1e9) -> None:
        self.all = rows
        self.duration_s = rows[-1][0] - self.start_s
        self.rejected = {"/bad": 2}
        self.read = 0
        self.breaks_at_s = breaks_at_s

    def rows(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Row]:
        self.rejected["/bad"] += 1
        for row in self.all:
            if row[0] - self.start_s > self.breaks_at_s:
                raise OSError("the file ends here")
            if row[0] - self.start_s >= start_s:
                self.read += 1
                yield row


def stands_then_moves(stands_s: float, length_s: float, mps: float, twist_mps: float) -> Drive:
    rows = []
    for n in range(int(length_s * 10)):
        at_s = n / 10
        moves = at_s > stands_s
        way_m = max(0.0, at_s - stands_s) * mps
        rows.append((1000.0 + at_s, "odom", ODOM, odometry(way_m, twist_mps if moves else 0.0)))
    return Drive(rows)


def looked_into(drive: Drive) -> Any:
    return gather(drive, {"odom": "/odom"}, shown({"/odom": ODOM}))


@pytest.mark.parametrize("stands_s", [0.0, 5.0, 60.0, 900.0, 1700.0])
def test_a_car_that_stands_for_long_is_looked_at_further_on(stands_s: float) -> None:
    drive = stands_then_moves(stands_s, 2000.0, 3.0, 0.0)
    assert looked_into(drive).of("/odom").is_twist_empty
    filled = stands_then_moves(stands_s, 2000.0, 3.0, 3.0)
    assert not looked_into(filled).of("/odom").is_twist_empty


def test_it_ends_as_soon_as_it_knows_enough() -> None:
    drive = stands_then_moves(2.0, 2000.0, 3.0, 3.0)
    looked_into(drive)
    assert drive.read == 22


def test_it_is_bounded_however_much_there_is() -> None:
    drive = stands_then_moves(1e9, 5000.0, 0.0, 0.0)
    assert not looked_into(drive).of("/odom").is_twist_empty
    assert drive.read <= len(PLACES) * (WINDOW_S * 10 + 2)


def test_what_cannot_be_decoded_is_not_counted_twice() -> None:
    drive = stands_then_moves(2.0, 100.0, 3.0, 3.0)
    looked_into(drive)
    assert drive.rejected == {"/bad": 2}


def test_a_damaged_recording_shows_what_can_be_read() -> None:
    drive = stands_then_moves(2.0, 100.0, 3.0, 0.0)
    drive.breaks_at_s = 9.0
    assert looked_into(drive).of("/odom").is_twist_empty


def test_of_topics_that_do_not_compete_nothing_is_kept() -> None:
    rows = [(1000.0 + n, topic, kind, scan(topic)) for n in range(9) for topic, kind in {**LASERS, "/fix": FIX}.items()]
    evidence = gather(Drive(rows), {topic: topic for topic in [*LASERS, "/fix"]}, shown(LASERS))
    assert [evidence.of(topic).frame for topic in [*LASERS, "/fix"]] == ["/front/scan", "/rear/scan", None]

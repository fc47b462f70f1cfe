"""A link whose delay crosses its limit again and again, each time for less than the alarm's delay: it hides nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.inhibition import UNSEEN_S
from tests.monitor.drive import Drive

FLICKERS_S, LATE_S = 1.5, 0.8  # period, and how much of it the link counts as late: less than the alarm waits


def flickering(drive: Drive, until_s: float, off_s: float = FLICKERS_S - LATE_S) -> None:
    while drive.now_s < until_s:
        drive.link = replace(drive.link, late_s=1.2)
        drive.state.link(drive.link)
        drive.to(drive.now_s + LATE_S)
        drive.link = replace(drive.link, late_s=0.4)
        drive.state.link(drive.link)
        drive.to(drive.now_s + off_s)


@pytest.mark.parametrize(
    ("silent", "alarm"), [({"position"}, "signal_stale.position"), (set(Drive().hz), "car_silent")], ids=["one", "all"]
)
def test_a_silence_is_announced_while_the_link_flickers(silent: set[str], alarm: str) -> None:
    drive = Drive().to(0.5).open().to(20.0)
    flickering(drive, 40.0)
    assert drive.announced == [], "neither the link nor anything else is wrong for long enough"
    drive.silent |= silent
    flickering(drive, 60.0)
    assert alarm in drive.announced
    first_s = next(at_s for at_s, change, name in drive.log if name == alarm and change == "raised")
    assert first_s - 40.0 < 2.0 + UNSEEN_S


@pytest.mark.parametrize("off_s", [3.1, 3.5, 6.0, 8.0])
@pytest.mark.parametrize(
    ("slow", "alarm"), [(("brake",), "signal_slow.brake"), (tuple(Drive().hz), "all_slow")], ids=["one", "all"]
)
def test_slow_signals_are_announced_while_the_link_flickers_seldom(
    slow: tuple[str, ...], alarm: str, off_s: float
) -> None:
    drive = Drive().to(0.5).open().to(60.0)
    flickering(drive, 90.0, off_s)
    assert drive.announced == []
    for name in slow:
        drive.hz[name] *= 0.5
    flickering(drive, 180.0, off_s)
    assert alarm in drive.announced
    assert not {"link_late", "link_late_moving"} & set(drive.announced)


def test_what_a_late_link_explains_stays_hidden_once_the_link_is_announced() -> None:
    drive = Drive().to(0.5).open().to(20.0)
    drive.link = replace(drive.link, late_s=1.5)
    drive.silent.add("position")
    drive.state.link(drive.link)
    drive.to(60.0)
    assert drive.announced == ["link_late"]

"""What is chosen for a replay, and what the operator chose since the drive was recorded."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.judge.active_settings import SettingsOverride
from server.judge.drive import Drive
from server.judge.recorded_events import RecordedEvents
from server.recording.read.read import open_recording
from tests.reports.cases import made

FRONT, BACK = "/front_2d_lidar/scan", "/back_2d_lidar/scan"


@pytest.fixture(scope="module")
def two_lasers() -> Path:
    return made("case_03_back_laser_first.py") / "03-back-laser-first" / "object-ahead"


def scan_topic(path: Path, *, recorded: str | None = None, now: str = "", chosen: str | None = None) -> str | None:
    """The topic of the laser in a replay with these settings."""
    choices = SettingsOverride(topics={} if chosen is None else {"scan": chosen})
    with open_recording([path]) as recording:
        drive = Drive(recording, RecordedEvents(settings=recorded), fallback=now, choices=choices)
        source = drive.epochs[0].sources.get("scan")
        assert (source is None) == bool(drive.epochs[0].questions)
        return None if source is None else source.topic


def picks(topic: str) -> str:
    return f'[topics]\nscan = "{topic}"\n'


def test_a_choice_for_the_replay_comes_first(two_lasers: Path) -> None:
    assert scan_topic(two_lasers) is None
    assert scan_topic(two_lasers, chosen=FRONT) == FRONT
    assert scan_topic(two_lasers, recorded=picks(BACK), now=picks(BACK), chosen=FRONT) == FRONT


def test_what_was_left_open_follows_the_settings_of_now_and_what_was_recorded_stays(two_lasers: Path) -> None:
    assert scan_topic(two_lasers, recorded="", now=picks(FRONT)) == FRONT
    assert scan_topic(two_lasers, recorded=picks(BACK), now=picks(FRONT)) == BACK
    assert scan_topic(two_lasers, recorded="", now=picks("/gone")) is None


def test_each_laser_is_shown_with_what_it_saw(two_lasers: Path) -> None:
    with open_recording([two_lasers]) as recording:
        drive = Drive(recording, RecordedEvents())
        offers = drive.offers(drive.epochs[0])["scan"]
    assert {one["topic"] for one in offers} == {FRONT, BACK}
    assert all(len(one["ranges_m"]) == 72 and one["frame"] for one in offers)

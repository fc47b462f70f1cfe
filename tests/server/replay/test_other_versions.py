"""The alarms of a recording of another version: what Files counts, the replay, the report and the log show."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.analysis.recorded_log import read_recorded_log
from server.protocol.drive_trends import Wanted
from server.recording.catalog.survey import survey
from server.recording.drive.alarms import alarms_of
from server.recording.drive.drive_events import read_drive_events
from server.recording.read.read import open_recording
from server.replay.playback import Playback
from tests.server.recording.made import BEGAN_MS, record
from tests.server.replay.test_playback import NAMES, NEVER, reach

TEXTS = {"title": "Wheel lost", "text": "rear left, limit none"}
NEWER = {
    "alarm": "wheel_lost", "change": "raised", "priority": "extreme", "place": "ceiling", "sound": "siren",
    "announces": True, "state": "UNACKED", "occurrence": 1, **TEXTS,
}  # fmt: skip
OLDER = {"alarm": "wheel_lost", "change": "raised", "priority": "critical", **TEXTS}
KNOWN = {
    "alarm": "not_moving",
    "change": "raised",
    "priority": "critical",
    **TEXTS,
}  # another priority and another text


@pytest.fixture(params=[NEWER, OLDER, KNOWN], ids=["newer", "older", "known"])
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    event = {"n": 1, "at_ms": BEGAN_MS, "by": None, **request.param}
    return record(tmp_path / "car" / "car_1.mcap", own=[event])


@pytest.fixture
def playback(path: Path) -> Iterator[Playback]:
    found = Playback(open_recording([path]), lambda: open_recording([path]), settings="", now_s=100.0, at_s=4.0)
    reach(found)
    found.index.work(NEVER)
    yield found
    found.close()


def test_files_and_replay_count_the_same_alarms(path: Path, playback: Playback) -> None:
    assert survey(path)["alarms"] == {"critical": 1, "warning": 0, "advisory": 0}
    [alarm] = playback.frame(**NAMES)["alarms"]
    assert (alarm["title"], alarm["trip_text"], alarm["priority"]) == (TEXTS["title"], TEXTS["text"], "critical")
    assert (alarm["state"], alarm["active"]) == ("UNACKED", True)
    assert (alarm["place"], alarm["sound"]) == ("dialog", "high")
    [mark] = playback.index.as_json()["marks"]
    assert (mark["title"], mark["text"], mark["priority"]) == (TEXTS["title"], TEXTS["text"], "critical")


def test_the_marks_of_the_trends_name_it(playback: Playback) -> None:
    wanted = Wanted.of({"from_s": 0.0, "to_s": 20.0, "buckets": 10, "signals": ["speed"]})
    marks = playback._drive_trends(wanted)["marks"]
    assert [(mark["title"], mark["priority"]) for mark in marks] == [(TEXTS["title"], "critical")]


def test_report_and_log_name_it(path: Path) -> None:
    with open_recording([path]) as recording:
        log = read_recorded_log(recording)
        assert log is not None
        assert [(one.title, one.priority, one.trip_text) for one in log.episodes] == [
            (TEXTS["title"], "critical", TEXTS["text"])
        ]
        assert [(one.title, one.priority) for one in log.entries] == [(TEXTS["title"], "critical")]
        assert log.load.announced == 1
        events = read_drive_events(recording)
    assert events is not None
    assert [(one.title, one.priority) for one in alarms_of(events)] == [(TEXTS["title"], "critical")]

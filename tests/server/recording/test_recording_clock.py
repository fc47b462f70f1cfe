"""The clock of a recording goes on where the server's is set, and entries have its times."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.judge.active_settings import ActiveSettings
from server.judge.settings import SettingsFile
from server.recording.controller import SessionRecording
from server.recording.event_channels import read_recorded_events
from server.recording.folder import RecordingsFolder
from server.recording.read.read import open_recording
from server.recording.recording_clock import RecordingClock

DAY_MS = 86_400_000


class Clocks:
    def __init__(self, wall_ms: int = 1_790_000_000_000) -> None:
        self.now_s, self.wall_ms = 100.0, wall_ms
        self.clock = RecordingClock(lambda: self.now_s, lambda: self.wall_ms)
        self.clock.start()

    def passes(self, seconds: float) -> None:
        self.now_s += seconds
        self.wall_ms += round(seconds * 1000)


@pytest.mark.parametrize("by_ms", [5_000, -5_000, 230 * DAY_MS, -230 * DAY_MS])
def test_times_go_on_and_entries_follow_them(by_ms: int) -> None:
    clocks = Clocks()
    clocks.passes(10.0)
    before_ms = clocks.wall_ms
    clocks.wall_ms += by_ms
    clocks.passes(1.0)
    assert clocks.clock.ms() == before_ms + 1000
    kept = {"hold_ms": 5000, "text": "x", "is_on": True}
    fields = {**kept, "at_ms": clocks.wall_ms - 200, "fix": {"heard_ms": clocks.wall_ms}}
    assert clocks.clock.entry(fields) == {**kept, "at_ms": before_ms + 800, "fix": {"heard_ms": before_ms + 1000}}


def test_times_from_before_the_clock_was_set_by_days_stay() -> None:
    clocks = Clocks()
    old_ms = clocks.wall_ms
    clocks.wall_ms += 3 * DAY_MS
    assert clocks.clock.moment_ms(old_ms) == old_ms


def test_a_clock_that_is_slewed_changes_no_entry() -> None:
    clocks = Clocks()
    clocks.passes(60.0)
    clocks.wall_ms += 400
    fields = {"at_ms": clocks.wall_ms}
    assert clocks.clock.entry(fields) is fields


def test_another_recording_begins_at_the_time_of_day() -> None:
    clocks = Clocks()
    clocks.wall_ms += DAY_MS
    clocks.clock.start()
    assert clocks.clock.ms() == clocks.wall_ms


@pytest.mark.parametrize("by_ms", [-3_600_000, 40 * DAY_MS])
async def test_the_parts_of_a_recording_have_one_clock(tmp_path: Path, by_ms: int) -> None:
    clocks = Clocks()
    recording = SessionRecording(
        "car",
        RecordingsFolder(tmp_path),
        ActiveSettings(SettingsFile(None)),
        now=lambda: clocks.now_s,
        wall_ms=lambda: clocks.wall_ms,
    )
    speed = {"linear": {"x": 4.2, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
    recording.ros_version = 2
    recording.prepare()
    recording.link_opened("ws://car:9090")
    recording.take("/vel", "geometry_msgs/msg/Twist", speed, clocks.now_s, 100)
    clocks.passes(4.0)
    recording.take("/vel", "geometry_msgs/msg/Twist", speed, clocks.now_s, 100)
    recording.link_lost()
    clocks.wall_ms += by_ms
    clocks.passes(6.0)
    recording.link_opened("ws://car:9090")
    recording.take("/vel", "geometry_msgs/msg/Twist", speed, clocks.now_s, 100)
    recording.own("alarms", {"change": "paused", "at_ms": clocks.wall_ms, "by": "Ann"})
    clocks.passes(1.0)
    recording.take("/vel", "geometry_msgs/msg/Twist", speed, clocks.now_s, 100)
    await recording.stop()
    with open_recording(sorted(tmp_path.rglob("*.mcap"))) as source:
        assert [at_s - source.start_s for at_s, *_ in source.rows()] == pytest.approx([0.0, 4.0, 10.0, 11.0], abs=0.01)
        assert source.start_s == pytest.approx(1_790_000_000.0, abs=0.01)
        assert not source.clock_steps
        assert [round(at_s, 1) for at_s, _ in read_recorded_events(source).events] == [10.0]
        assert [row["at_ms"] for _, row in source.own("/catgraph/alarms")] == [1_790_000_010_000]

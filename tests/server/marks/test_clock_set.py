"""A mark was made before the server's clock was set, and is delivered after it: its moment stays right."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.judge.active_settings import ActiveSettings
from server.judge.settings import SettingsFile
from server.protocol.drive_commands import PlaceMark
from server.recording.controller import SessionRecording
from server.recording.folder import RecordingsFolder
from server.recording.recorder_thread import Status
from server.recording.recording_clock import ClockHistory
from server.vehicle.marks import Marks, MarksPlace

BEGIN_MS = 1_790_000_000_000
DAY_MS = 86_400_000
STEPS_MS = [-3_000, -40_000, -3_600_000, -230 * DAY_MS, 3_000, 40_000, 3_600_000, 230 * DAY_MS]
SPEED = {"linear": {"x": 4.2, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}


class Writer:
    """Takes what a recorder would write."""

    def __init__(self) -> None:
        self.status = Status()
        self.marks: list[tuple[float, float]] = []  # each row: its time, and that of the moment, from BEGIN_MS on [s]

    def own(self, channel: str, mark: dict[str, Any], at_ns: int) -> None:
        if channel == "marks":
            self.marks.append(
                (round(at_ns / 1e9 - BEGIN_MS / 1000, 1), round((mark["marked_ms"] - BEGIN_MS) / 1000, 1))
            )

    def __getattr__(self, name: str) -> Any:
        return lambda *_, **__: None


class World:
    """A recording, marks, and a clock that is set."""

    def __init__(self, folder: Path) -> None:
        self.now_s, self.ahead_ms = 100.0, 0
        self.events: list[dict[str, Any]] = []
        self.late: list[int] = []
        self.recording = SessionRecording(
            "car",
            RecordingsFolder(folder),
            ActiveSettings(SettingsFile(None)),
            now=lambda: self.now_s,
            wall_ms=self.wall_ms,
        )
        self.recording.ros_version = 2
        self.writer = self.recording._parts.recorder = Writer()  # type: ignore[assignment]
        self.marks = Marks(
            lambda change, text, **more: self.events.append({"change": change, "text": text, **more}),
            self.recording,
            wall_ms=self.wall_ms,
            place=MarksPlace(on_late=self.late.append, on_described=lambda *_: None, media=None),
            history=self.recording.history,
        )

    def wall_ms(self) -> int:
        return BEGIN_MS + round((self.now_s - 100.0) * 1000) + self.ahead_ms

    def passes(self, seconds: float) -> None:
        for _ in range(round(seconds * 2)):
            self.now_s += 0.5
            self.recording.take("/vel", "geometry_msgs/msg/Twist", SPEED, self.now_s, 100)
            self.recording.tick(self.now_s)

    def set_clock(self, by_ms: int) -> None:
        self.ahead_ms += by_ms

    def deliver(self, mark: str, at_ms: float, *, age_ms: float | None = None, **fields: Any) -> None:
        self.marks.execute(
            PlaceMark(kind="mark", mark=mark, at_ms=at_ms, age_ms=age_ms, **fields), by="Ana", source="page"
        )


def begun(tmp_path: Path) -> World:
    made = World(tmp_path)
    made.recording.link_opened("ws://car:9090")
    made.recording.take("/vel", "geometry_msgs/msg/Twist", SPEED, made.now_s, 100)
    return made


@pytest.mark.parametrize("by_ms", STEPS_MS)
@pytest.mark.parametrize("has_age", [True, False])
def test_a_mark_of_before_the_step_is_recorded_at_its_moment(tmp_path: Path, by_ms: int, has_age: bool) -> None:
    world = begun(tmp_path)
    world.passes(30.0)
    at_ms, marked_s = world.wall_ms() - 1000, world.now_s - 1.0
    world.set_clock(by_ms)
    world.passes(1.5)
    world.deliver("m", at_ms, age_ms=(world.now_s - marked_s) * 1000 if has_age else None)
    assert world.events[-1]["marked_ms"] == world.wall_ms() - 2500
    assert world.writer.marks == [(29.0, 29.0)]
    assert world.late == []


@pytest.mark.parametrize("by_ms", [-3_000, -40_000, 40_000])
@pytest.mark.parametrize("marked_s", [28.0, 58.0])
def test_a_phone_that_was_away_knows_the_clock_of_before_and_its_own(
    tmp_path: Path, by_ms: int, marked_s: float
) -> None:
    """Where the times of both clocks overlap, the age of the mark decides: also of one that was made after the step."""
    world = begun(tmp_path)
    world.passes(30.0)
    world.set_clock(by_ms)
    world.passes(40.0)
    world.deliver("m", BEGIN_MS + marked_s * 1000, age_ms=(70.0 - marked_s) * 1000 + 300)
    assert world.writer.marks == [(marked_s, marked_s)]


@pytest.mark.parametrize("by_ms", STEPS_MS)
def test_a_mark_of_after_the_step_is_recorded_at_its_moment(tmp_path: Path, by_ms: int) -> None:
    world = begun(tmp_path)
    world.passes(30.0)
    world.set_clock(by_ms)
    world.passes(10.0)
    world.deliver("m", world.wall_ms() - 2000)
    assert world.writer.marks == [(38.0, 38.0)]


def test_the_clock_is_set_more_than_once(tmp_path: Path) -> None:
    world = begun(tmp_path)
    sent = []
    for by_ms in (-20_000, 50_000, -7_000, 90 * DAY_MS):
        world.passes(10.0)
        sent.append((world.wall_ms() - 500, world.now_s - 0.5))
        world.set_clock(by_ms)
    world.passes(10.0)
    for number, (at_ms, marked_s) in enumerate(sent):
        world.deliver(f"m-{number}", at_ms, age_ms=(world.now_s - marked_s) * 1000)
    assert world.writer.marks == [(at_s, at_s) for at_s in (9.5, 19.5, 29.5, 39.5)]


def test_words_that_come_after_the_step_leave_the_moment(tmp_path: Path) -> None:
    world = begun(tmp_path)
    world.passes(10.0)
    at_ms = world.wall_ms()
    world.deliver("m", at_ms)
    world.set_clock(600_000)
    world.passes(10.0)
    world.deliver("m", at_ms, age_ms=10_000.0, words="a pallet")
    assert world.writer.marks == [(10.0, 10.0), (20.0, 10.0)]


@pytest.mark.parametrize("by_ms", [-60_000, 60_000, -3 * DAY_MS])
@pytest.mark.parametrize("is_recording_again", [False, True])
def test_a_mark_of_a_recording_that_is_over_has_the_time_of_that_recording(
    tmp_path: Path, by_ms: int, is_recording_again: bool
) -> None:
    world = begun(tmp_path)
    world.passes(20.0)
    world.set_clock(by_ms)
    world.passes(20.0)
    at_ms = world.wall_ms() - 1000  # by the clock that was set; the recording goes on by the one of before
    world.recording.order(False, by="Ana")
    world.passes(5.0)
    if is_recording_again:
        world.recording.order(True, by="Ana")
        world.passes(5.0)
    age_ms = world.wall_ms() - at_ms
    world.deliver("m", at_ms, age_ms=age_ms)
    assert world.late == [BEGIN_MS + 39_000]
    assert world.events[-1]["marked_ms"] == BEGIN_MS + 39_000
    assert world.writer.marks == []


def test_a_time_ahead_of_every_clock_is_none() -> None:
    now = [100.0, 5_000_000]
    history = ClockHistory(lambda: float(now[0]), lambda: int(now[1]))
    history.look()
    now[:] = [110.0, 4_000_000]
    assert history.moment_s(4_000_000) == pytest.approx(110.0)
    assert history.moment_s(5_000_500) == pytest.approx(100.5)  # of a page that was away when the clock was set back
    assert history.moment_s(5_010_900) == pytest.approx(110.9)
    assert history.moment_s(5_012_000) is None


def test_a_computer_that_slept_gives_the_moment_of_before() -> None:
    """Its monotonic clock stood still, which the age does not show."""
    now = [100.0, 5_000_000]
    history = ClockHistory(lambda: float(now[0]), lambda: int(now[1]))
    history.look()
    now[:] = [101.0, 8_600_000]
    assert history.moment_s(4_999_000, age_ms=3_601_000) == pytest.approx(99.0)


def test_what_is_known_of_a_clock_is_bounded() -> None:
    now = [100.0, 5_000_000]
    history = ClockHistory(lambda: float(now[0]), lambda: int(now[1]))
    for _ in range(1000):
        now[0] += 1.0
        now[1] += 100_000
        history.recording_started()
    assert len(history._clocks) <= 50
    assert len(history._recordings) <= 50

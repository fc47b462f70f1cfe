"""The clock of the computer is set while it records: one note, no alarm, no work; a true silence stays one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest

from server.judge.drive import Drive
from server.judge.offline import Observer, OfflineRun
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import open_recording
from server.replay.playback import Playback
from tests.reports.cases import judged, made, raised
from tests.server.recording.stepped import CONTAINERS, LENGTH_S, Container, Step, write

FOLDER = "12-clock-set-during-recording"
DAY_S = 86_400.0
FRAME_S = 0.1


def step_notes(notes: Sequence[str]) -> list[str]:
    return [note for note in notes if "clock was set" in note]


class Ticks(Observer):
    """Counts what is judged."""

    def __init__(self) -> None:
        self.count = 0

    def ticked(self, run: OfflineRun, now_s: float) -> None:
        self.count += 1


def ticks_of(path: Path) -> int:
    with open_recording([path]) as recording:
        ticks = Ticks()
        run = OfflineRun(recording, Drive(recording, read_recorded_events(recording)), observer=ticks)
        run.advance(recording.duration_s)
        return ticks.count


def played(path: Path, is_over: Callable[[Playback], bool], at_s: float = 0.0) -> tuple[Playback, float]:
    """Plays in real time, and how long that takes [s]."""
    playback = Playback(open_recording([path]), lambda: open_recording([path]), settings="", now_s=0.0, at_s=at_s)
    now_s = 0.0
    playback.play(now_s)
    while not is_over(playback):
        now_s += FRAME_S
        playback.work(now_s, lambda: False)
        assert now_s < 300.0, "the replay stands still"
    return playback, now_s


@pytest.mark.parametrize("name", ["ahead.bag", "epoch.bag"])
def test_the_reported_drive_has_a_note_and_no_alarm_of_it(name: str) -> None:
    path = made("case_12_clock_set_during_recording.py") / FOLDER / name
    report = judged(path)
    assert report.recording.duration_s == pytest.approx(40.0, abs=0.2)
    assert report.recording.start_s == pytest.approx(1_790_000_000.0 - 10.0, abs=0.2)
    assert len(step_notes(report.run.notes)) == 1
    # It stands for ten seconds, and is driven too fast at one speed; nothing of this is the clock's.
    assert set(raised(report)) == {"not_moving", "speed_limit", "signal_frozen.speed"}
    assert ticks_of(path) <= 40.0 * 20 + 10


@pytest.mark.parametrize("name", ["ahead.bag", "epoch.bag"])
def test_a_replay_plays_over_the_step_at_once(name: str) -> None:
    path = made("case_12_clock_set_during_recording.py") / FOLDER / name
    playback, took_s = played(path, lambda one: not one.is_playing)
    assert took_s == pytest.approx(40.0, abs=1.0)
    assert playback.seeks <= 1
    assert len(step_notes(playback.timeline()["notes"])) == 1
    assert playback.position()["start_ms"] == pytest.approx(1_790_000_000_000 - 10_000, abs=200)
    playback.close()


STEPS: list[list[Step]] = [
    [(12.0, 230 * DAY_S)],
    [(25.0, -40.0)],
    [(35.0, -1.5)],
    [(8.0, 3 * DAY_S), (22.0, -7200.0), (41.0, -3 * DAY_S)],
    [(0.0, -1.69e9), (24.0, 1.69e9)],
    [(18.0, 45.0)],
]


@pytest.fixture(scope="module")
def without_a_step(tmp_path_factory: pytest.TempPathFactory) -> dict[str, float]:
    return raised(judged(write(tmp_path_factory.mktemp("plain"), "bag")))


@pytest.mark.parametrize(("container", "steps"), list(zip(cycle(CONTAINERS), STEPS, strict=False)))
def test_alarms_are_those_of_the_drive_without_a_step(
    tmp_path: Path, container: Container, steps: list[Step], without_a_step: dict[str, float]
) -> None:
    report = judged(write(tmp_path, container, steps=steps))
    assert "speed_limit" in without_a_step
    assert raised(report) == pytest.approx(without_a_step, abs=0.3)
    assert report.run.to_s == pytest.approx(LENGTH_S, abs=0.3)
    assert len(step_notes(report.run.notes)) == sum(after_s > 0.0 for after_s, _ in steps)


def silent_alarms(**how: Any) -> dict[str, float]:
    return {name: at_s for name, at_s in raised(judged(write(**how))).items() if "stale" in name or "silent" in name}


@pytest.mark.parametrize("silence_s", [30.0, 1200.0])
def test_a_silence_is_alarmed_with_and_without_a_step(tmp_path: Path, silence_s: float) -> None:
    silent_s = (35.0, silence_s)
    expected = silent_alarms(folder=tmp_path / "a", container="bag", silent_s=silent_s)
    assert expected
    assert silent_alarms(folder=tmp_path / "b", container="bag", silent_s=silent_s, steps=[(15.0, -90.0)]) == (
        pytest.approx(expected, abs=0.3)
    )


def test_a_silence_of_20_minutes_costs_less_than_two_minutes_of_driving(tmp_path: Path) -> None:
    path = write(tmp_path, "bag", silent_s=(35.0, 1200.0))
    assert ticks_of(path) <= (LENGTH_S + 120.0) * 20


def test_a_replay_shows_ten_seconds_of_an_empty_hour_and_says_so(tmp_path: Path) -> None:
    path = write(tmp_path, "bag", silent_s=(35.0, 3600.0))
    playback, took_s = played(path, lambda one: not one.is_playing, at_s=30.0)
    assert took_s == pytest.approx(LENGTH_S - 30.0 + 12.0, abs=2.0)
    assert playback.is_settled
    assert [note for note in playback.timeline()["notes"] if "passes over" in note] == [
        "Nothing was recorded for 60 min from 34.9 s on: playing passes over it."
    ]
    playback.close()


def test_a_replay_plays_a_short_silence(tmp_path: Path) -> None:
    path = write(tmp_path, "bag", silent_s=(35.0, 30.0))
    playback, took_s = played(path, lambda one: not one.is_playing, at_s=30.0)
    assert took_s == pytest.approx(LENGTH_S, abs=1.0)  # with the 30 s, from 30 s on
    playback.close()

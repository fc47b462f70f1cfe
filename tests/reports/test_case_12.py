"""The clock of the computer is set while it records: one note, no alarm, no work; a true silence stays one."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable, Sequence
from datetime import datetime
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any

import pytest

from server.cli.main import main
from server.judge.drive import Drive
from server.judge.offline import Observer, OfflineRun
from server.recording.catalog.survey import survey
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import open_recording
from server.replay.playback import Playback
from tests.reports.cases import judged, made, raised
from tests.server.recording.bags import BEGIN_S
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


@pytest.mark.parametrize("steps", [[(8.0, 240.0), (33.0, -240.0)], [(8.0, -240.0), (33.0, 240.0)]])
def test_a_clock_that_is_set_and_set_back_raises_nothing_though_no_sensor_shows_it(
    tmp_path: Path, steps: list[Step]
) -> None:
    expected = raised(judged(write(tmp_path / "plain", "bag", has_own_clock=False)))
    report = judged(write(tmp_path / "stepped", "bag", steps=steps, has_own_clock=False))
    assert raised(report) == pytest.approx(expected, abs=0.3)
    assert report.run.to_s == pytest.approx(LENGTH_S, abs=0.3)
    assert len(step_notes(report.run.notes)) == 2


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


def test_a_replay_shows_ten_seconds_of_an_empty_hour_and_reports_it(tmp_path: Path) -> None:
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


def test_a_replay_beside_another_one_keeps_its_pace(tmp_path: Path) -> None:
    path = write(tmp_path, "bag", silent_s=(35.0, 300.0))
    playback = Playback(open_recording([path]), lambda: open_recording([path]), settings="", now_s=0.0, at_s=34.0)
    playback.passes_gaps = False
    while playback.is_seeking:
        playback.work(0.0, lambda: False)
    playback.play(0.0)
    for now_s in (10.0, 20.0, 60.0):
        playback.work(now_s, lambda: False)
        assert playback.at_s == pytest.approx(34.0 + now_s, abs=0.1)
    playback.close()


def test_the_list_has_the_length_that_was_driven(tmp_path: Path) -> None:
    found = survey(write(tmp_path, "bag", steps=[(25.0, 230 * DAY_S)]))
    assert found["length_s"] == pytest.approx(LENGTH_S, abs=0.2)
    assert found["started_ms"] == pytest.approx((BEGIN_S + 230 * DAY_S) * 1000, abs=300)
    assert found["distance_m"] == pytest.approx(LENGTH_S * 7e-5 * 111_200.0, rel=0.1)


@pytest.mark.parametrize(("format", "container"), [("csv", "plain"), ("gpx", "bag"), ("bag", "bag"), ("ros2", "db3")])
def test_exports_go_on_and_say_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], format: str, container: Container
) -> None:
    path, out = write(tmp_path, container, steps=[(25.0, 230 * DAY_S), (40.0, -70.0)]), tmp_path / "exported"
    assert main(["export", str(path), "--format", format, "--out", str(out)]) == 0  # nothing is left out
    output = capsys.readouterr()
    assert (output.out + output.err).count("clock was set") == 2
    match format:
        case "csv":
            with zipfile.ZipFile(out) as packed:
                lines = packed.read("speed.csv").decode().splitlines()[1:]
                assert packed.read("README.txt").decode().count("clock was set") == 2
            times_s = [float(line.split(",")[1]) for line in lines]
        case "gpx":
            found = re.findall("<trkpt.*?<time>(.*?)</time>", out.read_text(), re.DOTALL)
            times_s = [datetime.fromisoformat(one).timestamp() for one in found]
        case _:
            if format == "ros2":
                with zipfile.ZipFile(out) as packed:
                    packed.extractall(tmp_path / "bag")
                out = next((tmp_path / "bag").iterdir())
            with open_recording([out]) as recording:
                assert not recording.clock_steps
                times_s = [at_s for at_s, *_ in recording.rows()]
    assert len(times_s) > 200
    assert times_s[-1] - times_s[0] == pytest.approx(LENGTH_S, abs=0.5)
    assert all(0.0 <= later - before < 1.0 for before, later in pairwise(times_s))

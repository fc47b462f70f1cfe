"""A recording is surveyed for its units before it is judged: wherever a run begins, the unit is the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from server.judge import recording_survey
from server.judge.active_settings import SettingsOverride
from server.judge.drive import Drive as JudgedDrive
from server.judge.offline import OfflineRun
from server.judge.recorded_events import RecordedEvents
from server.judge.sources.evidence import Evidence
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import open_recording
from tests.reports.cases import judged
from tests.server.recording.bags import Drive, Row, write_ros1

FLOAT, TWIST, WRENCH = "std_msgs/msg/Float32", "geometry_msgs/msg/Twist", "geometry_msgs/msg/Wrench"


def driving(folder: Path, type: str, factor: float, *, begins_s: float = 5.0) -> Path:
    """Stands, then drives north at 8 m/s for 20 s, the speed published times `factor`."""
    rows: list[Row] = []
    for n in range(round((begins_s + 20.0) * 20)):
        at_s = n / 20
        mps, way = (8.0, 8.0 * (at_s - begins_s)) if at_s >= begins_s else (0.0, 0.0)
        speed = {"linear": {"x": mps * factor}} if type == TWIST else {"data": mps * factor}
        pose = {"pose": {"position": {"x": way}, "orientation": {"w": 1.0}}}
        rows.append((at_s, "/speed", type, speed))
        rows.append((at_s, "/odom", "nav_msgs/msg/Odometry", {"pose": pose}))
    return write_ros1(folder / "drive.bag", Drive(messages=rows))


@pytest.mark.parametrize("type", [FLOAT, TWIST])
@pytest.mark.parametrize("factor", [1.0, 3.6])
def test_a_speed_is_right_from_its_first_value_on(tmp_path: Path, type: str, factor: float) -> None:
    report = judged(driving(tmp_path, type, factor))
    extent = report.run.snapshot.extents["speed"]
    assert (extent.lowest, extent.highest) == pytest.approx((0.0, 8.0))


@pytest.mark.parametrize("from_s", [0.0, 6.0, 24.0])
def test_a_run_has_the_unit_wherever_it_begins(tmp_path: Path, from_s: float) -> None:
    with open_recording([driving(tmp_path, FLOAT, 3.6)]) as recording:
        drive = JudgedDrive(recording, read_recorded_events(recording))
        run = OfflineRun(recording, drive, from_s=from_s)
        run.advance(from_s + 0.9)
        reading = run.run_state.state.get("speed")
        assert reading is not None
        assert reading.value.speed_mps == pytest.approx(8.0 if from_s > 5.0 else 0.0)


class _Unread:
    """A recording whose messages must not be read."""

    start_s, duration_s, ros_version = 0.0, 10.0, 1
    notes: list[str]

    def __init__(self, types: dict[str, str]) -> None:
        self.topics: Any = {name: type("Info", (), {"type": kind})() for name, kind in types.items()}
        self.notes, self.rejected = [], {"/other": 3}
        self.was_read = False

    def rows(self, start_s: float = 0.0, topics: Any = None) -> Iterator[Any]:
        self.was_read = True
        self.rejected["/other"] += 3
        return iter(())


NOTHING = RecordedEvents()
CATVEHICLE = {"/catvehicle/vel": TWIST, "/catvehicle/brake": WRENCH, "/catvehicle/accelerator": WRENCH}


@pytest.mark.parametrize(
    ("types", "was_read"),
    [
        (CATVEHICLE | {"/catvehicle/odom": "nav_msgs/msg/Odometry"}, False),
        ({"/odom": "nav_msgs/msg/Odometry", "/fix": "sensor_msgs/msg/NavSatFix"}, False),
        ({"/vel": TWIST}, False),
        ({"/vel": TWIST, "/odom": "nav_msgs/msg/Odometry"}, True),
        ({"/brake": FLOAT}, True),
        ({"/battery_state": "sensor_msgs/msg/BatteryState"}, True),
    ],
)
def test_only_what_is_in_doubt_is_read_and_counted_once(types: dict[str, str], was_read: bool) -> None:
    source: Any = _Unread({name: kind.replace("/msg/", "/") for name, kind in types.items()})
    drive = JudgedDrive(source, NOTHING, fallback="", evidence=Evidence())
    assert source.was_read is False
    assert isinstance(drive.unit_evidence, dict)
    assert source.was_read is was_read
    assert source.rejected == {"/other": 3}


def test_the_operators_choice_counts_before_the_values(tmp_path: Path) -> None:
    rows: list[Row] = [(n / 20, "/brake", FLOAT, {"data": 0.5}) for n in range(100)]
    path = write_ros1(tmp_path / "brake.bag", Drive(messages=rows))
    for unit, percent in (("share", 50.0), ("percent", 0.5)):
        with open_recording([path]) as recording:
            override = SettingsOverride(units={"brake": unit})
            run = OfflineRun(recording, JudgedDrive(recording, read_recorded_events(recording), override=override))
            run.advance(1.0)
            reading = run.run_state.state.get("brake")
            assert reading is not None
            assert reading.value.percent == pytest.approx(percent)


@pytest.mark.parametrize(("most", "from_row"), [(2, 0), (3, 0), (3, 2), (3, 5), (5, 1)])
def test_what_was_read_before_counts_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int, from_row: int
) -> None:
    """Two wrong values of a battery are glitches, and four of them are percent."""
    monkeypatch.setattr(recording_survey, "MOST_VALUES", most)
    battery, levels = "sensor_msgs/msg/BatteryState", [0.9, 1.4, 1.3, 0.5, 0.6, 0.5, 0.4, 0.3]
    rows: list[Row] = [
        (float(n), "/battery_state", battery, {"present": True, "percentage": level}) for n, level in enumerate(levels)
    ]
    with open_recording([write_ros1(tmp_path / "battery.bag", Drive(messages=rows))]) as recording:
        drive = JudgedDrive(recording, read_recorded_events(recording))
        run = OfflineRun(recording, drive, from_s=max(0.0, from_row - 0.5))
        units = run.run_state.reception.units
        (evidence,) = units._surveyed.values()
        assert not evidence.is_whole
        run.advance(100.0)
        decision = units.decision("fuel", "/battery_state")
        assert decision is not None
        assert decision.unit is None
        assert evidence.count == len(levels) - max(0, from_row - most)
        assert evidence.beyond["share"] == 2


def test_a_way_that_was_read_before_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first 200 messages of a speed in km/h: 2.5 s of the way, which shows nothing yet."""
    monkeypatch.setattr(recording_survey, "MOST_VALUES", 300)
    with open_recording([driving(tmp_path, FLOAT, 3.6)]) as recording:
        run = OfflineRun(recording, JudgedDrive(recording, read_recorded_events(recording)))
        (evidence,) = run.run_state.reception.units._surveyed.values()
        assert evidence.until_s == pytest.approx(7.45)
        before, ways = evidence.count, evidence.ways
        assert ways is not None
        way = ways._way
        run.advance(7.45)
        assert (evidence.count, ways._way) == (before, way)
        run.advance(20.0)
        assert evidence.count > before
        reading = run.run_state.state.get("speed")
        assert reading is not None
        assert reading.value.speed_mps == pytest.approx(8.0)

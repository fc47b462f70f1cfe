"""A recording is surveyed for its units before it is judged: wherever a run begins, the unit is the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from server.judge.drive import Drive as JudgedDrive
from server.judge.offline import OfflineRun
from server.judge.settings_override import SettingsOverride
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


NOTHING: Any = type("Recorded", (), {"events": (), "settings": None, "notes": (), "has_alarms": False})()
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

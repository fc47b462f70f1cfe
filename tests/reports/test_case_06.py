"""A driver whose beam count is one off the formula in every scan: noted once; a change or a larger difference warns."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from server.analysis.report import Report
from tests.reports.cases import judged, made, raised
from tests.server.recording.bags import Drive, Row, write_ros1

NOTES = {
    "ydlidar-x4": "always one beam less than its angles give, as its driver counts",
    "velodyne_laserscan": "always one beam less than its angles give, as its driver counts",
    "ld19-varying": "up to one beam more or less than its angles give, as its driver counts",
    "rplidar-s3-varying": None,
}


@pytest.fixture(scope="module")
def scans() -> Path:
    return made("case_06_ydlidar_off_by_one.py") / "06-ydlidar-off-by-one"


ASSUMED = "assumed to look ahead: no transform of its frame laser, and no setting"


def note_of(report: Report) -> str | None:
    note = next(row.note for row in report.signals() if row.name == "scan")
    assert note is not None
    assert note.startswith(ASSUMED), "there are no transforms"
    return note.removeprefix(ASSUMED).removeprefix("; ") or None


@pytest.mark.parametrize("name", NOTES)
def test_the_count_of_a_driver_is_noted_once_and_warns_never(scans: Path, name: str) -> None:
    report = judged(scans / f"{name}.bag")
    assert "scan_shape" not in raised(report)
    assert note_of(report) == NOTES[name]


def scan(at_s: float, beams: int, *, degrees: float = 1.0) -> Row:
    """A half circle, of which 181 beams are right."""
    fields = {
        "angle_min": -math.pi / 2,
        "angle_max": math.pi / 2,
        "angle_increment": math.radians(degrees),
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": [5.0] * beams,
    }
    return (at_s, "/scan", "sensor_msgs/msg/LaserScan", fields)


COUNTS: dict[str, tuple[list[int], float | None]] = {
    "as it should be": ([181] * 100, None),
    "one less": ([180] * 100, None),
    "one more": ([182] * 100, None),
    "two less": ([179] * 100, 0.0),
    "two more": ([183] * 100, 0.0),
    "one less from the fifth second on": ([181] * 50 + [180] * 50, 5.0),
    "one less, and then right": ([180] * 50 + [181] * 50, 5.0),
    "one less, and then one more": ([180] * 50 + [182] * 50, 5.0),
    "one less, and then two": ([180] * 50 + [179] * 50, 5.0),
    "as the driver likes": ([180, 181, 182, 181] * 25, None),
    "once one less": ([181] * 50 + [180] + [181] * 49, None),
}


@pytest.mark.parametrize(("counts", "from_s"), COUNTS.values(), ids=COUNTS)
def test_a_change_of_the_count_warns_and_a_larger_difference(
    tmp_path: Path, counts: list[int], from_s: float | None
) -> None:
    rows = [scan(number / 10, beams) for number, beams in enumerate(counts)]
    found = raised(judged(write_ros1(tmp_path / "scans.bag", Drive(messages=rows)))).get("scan_shape")
    assert found == (None if from_s is None else pytest.approx(from_s + 0.5, abs=0.25))

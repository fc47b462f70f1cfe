"""However long the drive: an export holds a little of it at a time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from server.recording.export.formats import FORMATS
from tests.server.recording.export.hour import drive

MOST_MB = 150
_MEASURED = (
    # VmHWM is of this program alone; ru_maxrss begins with what its parent took before it.
    "import sys; from server.cli.main import main; code = main(sys.argv[1:]); "
    "print(code, next(int(row.split()[1]) // 1024 for row in open('/proc/self/status') if row.startswith('VmHWM')))"
)


def peak_mb(source: Path, format: str, folder: Path, *options: str) -> int:
    """What `catgraph export` takes at its most."""
    out = folder / f"out.{format}"
    done = subprocess.run(
        [sys.executable, "-c", _MEASURED, "export", str(source), "--format", format, "--out", str(out), *options],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[4])},
        capture_output=True,
        text=True,
        check=True,
    )
    code, peak = done.stdout.split()[-2:]
    assert code == "0", done.stderr
    assert out.stat().st_size > 1000
    out.unlink()
    return int(peak)


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_longer_drive_takes_no_more(tmp_path: Path) -> None:
    """Four minutes against half a minute: held in memory they would be 25 MB more as they lie, and many times that
    unpacked."""
    short = drive(tmp_path / "short.mcap", 30.0, lap_s=15.0)
    long = drive(tmp_path / "long.mcap", 240.0, lap_s=15.0)
    for format, growth_mb in (("bag", 8), ("csv", 8), ("html", 25)):  # the curves of a page are kept as they are drawn
        before, after = peak_mb(short, format, tmp_path), peak_mb(long, format, tmp_path)
        assert after - before <= growth_mb, (format, before, after)
        assert after <= MOST_MB, (format, after)


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_an_hour_exports_to_everything_with_little_memory(tmp_path: Path) -> None:
    hour = drive(tmp_path / "hour.mcap", 3600.0)
    peaks = {
        name: peak_mb(hour, name, tmp_path) for name in FORMATS if name not in ("ros2", "forms")
    }  # forms of this drive are empty
    peaks |= {f"bag, {packed}": peak_mb(hour, "bag", tmp_path, "--compression", packed) for packed in ("bz2", "lz4")}
    peaks["clip"] = peak_mb(hour, "mcap", tmp_path, "--at", "3000")
    print(f"peak MB of an hour of driving ({hour.stat().st_size / 1e6:.0f} MB): {peaks}")
    assert max(peaks.values()) <= MOST_MB, peaks


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_an_hour_of_ros_2_becomes_a_bag_with_little_memory(tmp_path: Path) -> None:
    hour = drive(tmp_path / "hour.mcap", 3600.0, version=2)
    peaks = {name: peak_mb(hour, name, tmp_path) for name in ("bag", "ros2", "csv")}
    print(f"peak MB of an hour of driving, ROS 2 ({hour.stat().st_size / 1e6:.0f} MB): {peaks}")
    assert max(peaks.values()) <= MOST_MB, peaks

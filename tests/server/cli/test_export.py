"""`catgraph export`, as somebody types it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import orjson
import pytest
from mcap.reader import make_reader

from server.cli.main import main
from server.recording.export import ExportRefused, make_export
from server.recording.export.formats import FORMATS
from server.recording.read.read import open_recording
from tests.interrupted import INTERRUPTED
from tests.server.recording.bags import Drive, write_ros2
from tests.server.recording.made import BEGAN_MS, record
from tests.tree import PROJECT

ID = "car_20260921T141320Z"


@pytest.fixture
def drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return record(tmp_path / "in" / f"{ID}.mcap", alarms=[(5.0, "critical")])


@pytest.mark.parametrize("format", sorted({*FORMATS} - {"ros2"}))
def test_every_format_lands_beside_you_under_the_recording_s_name(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], format: str
) -> None:
    assert main(["export", str(drive), "--format", format]) == 0
    out = tmp_path / f"{ID}.{FORMATS[format].extension}"
    assert out.stat().st_size > 500
    printed = capsys.readouterr()
    assert printed.out.startswith(f"{out.name} (")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["in", out.name])
    assert main(["export", str(drive), "--format", format]) == 2
    assert capsys.readouterr().err == f"catgraph export: {out.name} exists already: choose another file with --out.\n"
    assert main(["export", str(drive), "--format", format, "--out", out.name]) == 0  # who names it means it


def test_a_ros_2_bag_is_made_of_a_drive_from_ros_2_and_of_no_other(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(drive), "--format", "ros2"]) == 2
    printed = capsys.readouterr().err
    assert printed == ("catgraph export: This drive was recorded from ROS 1: export a ROS 1 bag.\n")
    bag = write_ros2(tmp_path / "drive", Drive(messages=[(0.0, "/n", "std_msgs/msg/Int32", {"data": 7})]))
    assert main(["export", str(bag), "--format", "ros2"]) == 0
    assert zipfile.ZipFile(tmp_path / "drive.ros2.zip").namelist() == ["drive/drive.mcap", "drive/metadata.yaml"]


@pytest.mark.parametrize(
    ("when", "count"),
    [
        ("5", 41),
        ("5.04", 40),
        ("an_critical", 41),
        (None, 201),
        ("2026-09-21T14:13:25Z", 41),
        ("2026-09-21T16:13:25+02:00", 41),
    ],
)
def test_the_time_around_a_moment(drive: Path, tmp_path: Path, when: str | None, count: int) -> None:
    assert BEGAN_MS == 1_790_000_000_000  # 2026-09-21 14:13:20 UTC
    moment = [] if when is None else ["--at", when, "--before", "1", "--after", "3"]
    assert main(["export", str(drive), "--format", "bag", "--without-own", "--out", "out.bag", *moment]) == 0
    with open_recording([tmp_path / "out.bag"]) as bag:
        assert bag.topics["/catvehicle/vel"].count == count
        assert not any(topic.startswith("/catgraph") for topic in bag.topics)


def test_a_clip_is_a_recording(drive: Path, tmp_path: Path) -> None:
    assert main(["export", str(drive), "--format", "mcap", "--at", "an_critical"]) == 0
    with open_recording([tmp_path / f"{ID}_clip.mcap"]) as clip:
        assert clip.metadata["clip_of"] == ID


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--format", "mcap"], "--format mcap cuts out the time around a moment: name it with --at."),
        (["--format", "bag", "--at", "nobody"], "--at nobody: that is no moment, and no alarm of that name"),
        (["--format", "bag", "--at", "nan"], "--at nan: that is no moment."),
        (
            ["--format", "bag", "--at", "2026-09-21T14:13:25"],
            "add the time zone, as 2026-09-21T14:13:25Z for UTC.",
        ),
        (
            ["--format", "bag", "--at", "1000"],
            "Nothing was recorded from 2026-09-21 14:29:30 to 2026-09-21 14:30:30 UTC.",
        ),
        (["--format", "bag", "--out", "nowhere/x.bag"], "nowhere/x.bag cannot be written: nowhere does not exist."),
        (["--format", "bag", "--out", f"in/{ID}.mcap"], "is the recording itself"),
    ],
)
def test_what_cannot_be_done_is_reported(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], reason: str
) -> None:
    before = drive.read_bytes()
    assert main(["export", str(drive), *arguments]) == 2
    assert reason in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["in"]
    assert drive.read_bytes() == before


def test_no_recording_and_no_position(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(tmp_path / "nope.mcap"), "--format", "bag", "--out", str(tmp_path / "x")]) == 2
    assert "nope.mcap does not exist" in capsys.readouterr().err
    still = record(tmp_path / "still.mcap", at=None)
    assert main(["export", str(still), "--format", "gpx", "--out", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err == (
        "catgraph export: No position was recorded in this drive: there is no track to export.\n"
    )


def test_what_is_damaged_is_left_out_and_reported(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoilt = bytearray(drive.read_bytes())
    with drive.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    spoilt[summary.chunk_indexes[3].chunk_start_offset + 100] ^= 0xFF
    (tmp_path / "spoilt.mcap").write_bytes(spoilt)
    assert main(["export", str(tmp_path / "spoilt.mcap"), "--format", "bag"]) == 1
    assert "spoilt.mcap is damaged" in capsys.readouterr().err
    assert (tmp_path / "spoilt.bag").exists()
    half = drive.read_bytes()[: len(spoilt) // 2]
    (tmp_path / "half.mcap").write_bytes(half)
    assert main(["export", str(tmp_path / "half.mcap"), "--format", "csv"]) == 1
    assert "half.mcap was never closed" in capsys.readouterr().err


async def test_for_a_mail_it_is_made_into_a_folder(drive: Path, tmp_path: Path) -> None:
    (tmp_path / "into").mkdir()
    reported: list[float] = []
    made = await make_export([drive], "csv", tmp_path / "into", reported.append)
    assert made.path == tmp_path / "into" / f"{ID}.csv.zip"
    assert reported == sorted(reported)
    with pytest.raises(ExportRefused, match="does not exist"):
        await make_export([tmp_path / "nope.mcap"], "csv", tmp_path / "into")
    with pytest.raises(ValueError, match="no format"):
        await make_export([drive], "exe", tmp_path / "into")


def test_the_worker_ends_with_the_server_and_sweeps_up(tmp_path: Path) -> None:
    """Its input closes when the server is gone, by whatever way it went."""
    long = record(tmp_path / "in" / "long.mcap", seconds=900.0)
    worker = subprocess.Popen(
        [sys.executable, "-m", "server", "export", "--background", str(long), "--format", "html", "--out", "out.html"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(PROJECT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert worker.stdin is not None
    assert worker.stdout is not None
    with worker.stdin, worker.stdout:
        assert "progress" in orjson.loads(worker.stdout.readline())
        assert os.getpriority(os.PRIO_PROCESS, worker.pid) > os.getpriority(os.PRIO_PROCESS, 0)
        worker.stdin.close()
        assert worker.wait(20) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


@pytest.mark.field
def test_interrupted_it_leaves_nothing(tmp_path: Path) -> None:
    long = record(tmp_path / "in" / "long.mcap", seconds=900.0)
    process = subprocess.Popen(
        [sys.executable, "-m", "server", "export", str(long), "--format", "html", "--out", "out.html"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(PROJECT)},
        stderr=subprocess.DEVNULL,
    )
    until_s = time.monotonic() + 20
    while not list(tmp_path.glob(".export-*")):
        assert time.monotonic() < until_s
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    assert process.wait(20) in INTERRUPTED
    assert [path.name for path in tmp_path.iterdir()] == ["in"]

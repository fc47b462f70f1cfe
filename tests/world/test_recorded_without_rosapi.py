"""A drive that is recorded from a bridge without rosapi, which names no types, reads as any other."""

from __future__ import annotations

import asyncio
import csv
import io
import time
import zipfile
from pathlib import Path

import pytest

from server.analysis import summary
from server.analysis.rehearse import rehearse
from server.analysis.report import Report
from server.judge.drive import Drive
from server.judge.offline import OfflineRun
from server.recording.event_channels import read_recorded_events
from server.recording.export.formats.bag import write_bag
from server.recording.export.formats.csv_zip import write_csv_zip
from server.recording.read.read import open_recording
from server.replay import replay_frames
from tests.server.cars import twist
from tests.server.recording.export.ours import OurFile
from tests.server.vehicle.keeping_bridge import KeepingBridge, Topic, monitored
from tests.server.vehicle.test_compared_cars import fix
from tests.server.vehicle.test_sources import odometry, of_laser

pytestmark = [pytest.mark.virtual_time, pytest.mark.slow]

TOPICS = {
    "/catvehicle/vel": Topic("geometry_msgs/Twist"),
    "/odom": Topic("nav_msgs/Odometry"),
    "/scan": Topic("sensor_msgs/LaserScan"),
    "/fix": Topic("sensor_msgs/NavSatFix"),
    "/fuel": Topic("std_msgs/Float32"),
    "/catvehicle/control_mode": Topic("std_msgs/String", is_latched=True),
}
SECONDS, HZ = 12.0, 10.0


async def recorded(folder: Path) -> tuple[Path, dict[str, int]]:
    """The recording of a drive towards a wall, and how many messages of each topic were published while it ran."""
    bridge, sent = KeepingBridge(TOPICS, has_rosapi=False), dict.fromkeys(TOPICS, 0)
    async with monitored(bridge, folder):
        begins_s = time.monotonic()
        bridge.publish("/catvehicle/control_mode", {"data": "auto"})
        while (at_s := time.monotonic() - begins_s) < SECONDS:
            for topic, message in {
                "/catvehicle/vel": twist(4.0),
                "/odom": odometry(4.0 * at_s, 4.0),
                "/scan": of_laser("laser", max(2.0, 60.0 - 5.0 * at_s))
                | {"ranges": [max(2.0, 60.0 - 5.0 * at_s)] * 181},
                "/fix": fix(4.0 * at_s, at_s),
                "/fuel": {"data": 60.0},
            }.items():
                bridge.publish(topic, message)
                sent[topic] += at_s > 1.0
            await asyncio.sleep(1 / HZ)
    [path] = folder.rglob("*.mcap")
    return path, sent


async def test_it_is_checked_replayed_reported_and_exported(tmp_path: Path) -> None:
    path, sent = await recorded(tmp_path / "recordings")
    with open_recording([path]) as recording:
        assert (recording.notes, recording.damage) == ([], [])
        assert {topic: info.type for topic, info in recording.topics.items()} == {
            topic: row.type for topic, row in TOPICS.items()
        }
        assert all(recording.topics[topic].count >= count > 0 for topic, count in sent.items() if "mode" not in topic)
        run = rehearse(recording)
        report = summary.text(Report(files=[str(path)], recording=recording, run=run))
        replayed = OfflineRun(recording, Drive(recording, read_recorded_events(recording)), from_s=6.0)
        replayed.advance(8.0)
        shown = replay_frames.frame(replayed, vehicle="car", name="x", settings_version=1, track_number=1)
        tables = write_csv_zip(recording, tmp_path / "drive.zip")
        bag = write_bag(recording, tmp_path / "drive.bag")
    assert "obstacle" in [one.alarm_id for one in run.episodes]
    assert "Odometry        /odom  " in report
    for signal in ("speed", "position", "odometry", "scan", "fuel"):
        assert shown["signals"][signal]["freshness"] == "fresh"
    assert tables.notes == []
    with zipfile.ZipFile(tmp_path / "drive.zip") as packed:
        rows = list(csv.reader(io.StringIO(packed.read("speed.csv").decode(), newline="")))
    assert len(rows) == recording.topics["/catvehicle/vel"].count + 1
    for topic in TOPICS:  # a bag holds no JSON, and a type by its fields alone may be of another precision
        assert any(note.startswith(f"{topic} ") and "recorded as JSON" in note for note in bag.notes)


@pytest.mark.parametrize("is_typed_first", [False, True])
def test_a_topic_whose_type_is_known_for_a_part_of_the_drive_is_read_whole(
    tmp_path: Path, is_typed_first: bool
) -> None:
    file = OurFile(tmp_path / "drive.mcap")
    for n in range(10):
        kind = "std_msgs/msg/Float64" if (n < 5) == is_typed_first else ""
        file.write(10**9 * (n + 1), "/speed", kind, "", "json", b'{"data": 4.5}')
    with open_recording([file.close()]) as recording:
        assert (recording.topics["/speed"].type, recording.topics["/speed"].count) == ("std_msgs/Float64", 10)
        assert recording.notes == []
        assert [message["data"] for _, _, _, message in recording.rows()] == [4.5] * 10

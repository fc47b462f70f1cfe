"""A small disk that fills up, and one that can only be read: reported clearly, and nothing that was kept is lost.

The disks are real: mounted for the test, which needs a user who may.
"""

from __future__ import annotations

import asyncio
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.recording import recover, space
from server.recording.folder import RecordingsFolder
from server.recording.read.read import open_recording
from server.recording.space import Allowance
from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.server.recording.made import recover_all
from tests.server.recording.mcap.test_write import written
from tests.server.recording.test_controller import watched
from tests.server.recording.test_recorder import RecorderUser
from tests.server.small_disk import fill, small_disk

SIZE = 2_000_000


@pytest.fixture
def disk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    """A disk of 2 MB, or as the test wants."""
    with small_disk(tmp_path / "recordings", getattr(request, "param", SIZE)) as root:
        yield root


def remount(disk: Path, how: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{how}", str(disk)], check=True)


async def test_a_disk_that_fills_up_ends_the_recording_and_it_is_completed_when_there_is_room_again(
    disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recover, "TRY_AGAIN_S", 0.2)
    user = RecorderUser(disk)
    part = user.part()
    user.recorder.begin(part)
    for n in range(500):
        user.say(n)
    await user.until(lambda: user.recorder.status.messages == 500)
    other = fill(disk)
    n = 500
    while user.recorder.status.state == "recording":
        user.say(n)
        n += 1
        await asyncio.sleep(0.001)
    await user.until(lambda: user.recorder.status.state != "saving")  # it tries to complete what it has
    status = user.recorder.status
    assert status.state == "stopped"
    assert status.trouble == "Recording stopped: the disk is full."
    left = part.path.with_name(f"{part.id}.mcap.writing")
    assert left.exists(), "there was no room for its index"
    with open_recording([left]) as recording:  # even so it can be read
        kept = recording.count
        assert [m.message["linear"]["x"] for m in recording.messages()] == [float(i) for i in range(kept)]
    assert kept >= 500
    other.unlink()
    await user.until(lambda: bool(user.finished))
    assert user.finished == [part.path]
    with open_recording([part.path]) as recording:
        assert recording.count == kept
        assert recording.metadata["ended"] == "recovered"
    assert not left.exists()
    await user.stop()


async def test_with_a_little_room_left_it_is_closed_as_any_other(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit that is left free is what the index needs."""
    monkeypatch.setattr(space, "LOOK_S", 0.05)
    user = RecorderUser(disk)
    user.recorder.allowance = Allowance(quota=0, min_free=100_000)
    user.recorder.begin(user.part())
    user.say(0)
    await user.until(lambda: user.recorder.status.messages == 1)
    fill(disk, leave=90_000)
    await user.until(lambda: user.recorder.status.state == "stopped")
    trouble = user.recorder.status.trouble or ""
    assert trouble.startswith("The disk has ")
    assert trouble.endswith("left, and recording stops at 100 kB. What was recorded is saved.")
    await user.until(lambda: bool(user.finished))
    with open_recording(user.finished) as recording:
        assert recording.metadata["ended"] == "closed"
        assert recording.count == 1
    await user.stop()


def test_what_was_left_waits_for_room_to_be_recovered(disk: Path) -> None:
    folder = disk / "car"
    written(folder / "car_1.mcap", 1, n=400).abandon()
    other = fill(disk)
    left = folder / "car_1.mcap.writing"
    before = left.read_bytes()
    done = recover.recover(left)
    assert done.is_settled is False
    assert done.sentence == "car_1 cannot be recovered now: the disk is full. It is kept as it is."
    assert [path.name for path in folder.iterdir()] == ["car_1.mcap.writing"]
    assert left.read_bytes() == before
    other.unlink()
    assert recover.recover(left).messages > 1000
    assert [path.name for path in folder.iterdir()] == ["car_1.mcap"]


@pytest.mark.parametrize("disk", [200_000_000], indirect=True)
async def test_a_disk_that_can_only_be_read_is_reported_and_monitoring_continues(disk: Path, bridge: RosBridge) -> None:
    (disk.parent / "settings").mkdir()
    (disk.parent / "settings" / "car.toml").write_text("[limits.recording]\nmin_free_gb = 0.05\n")
    async with driving(bridge), watched(bridge, disk.parent) as (_, one):
        state = await one.state(lambda s: s["recording"]["messages"] > 5, within_s=10.0)
        first = state["recording"]["name"]
        assert (await one.ask(kind="record", on=False))["ok"]
        await one.state(lambda s: s["recording"]["state"] == "off")
        await asyncio.to_thread(remount, disk, "ro")
        try:
            refused = await one.ask(kind="record", on=True)
            assert refused["reason"] == "Recording cannot begin: the folder for recordings is read-only."
            state = await one.state(lambda s: any(a["id"] == "recording_stopped" for a in s["alarms"]))
            assert state["session"]["phase"] == "monitoring"
            # A busy machine may be late with one state; a car that is no longer received is never fresh again.
            state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
            count = state["signals"]["speed"]["count"]
            await one.state(lambda s: s["signals"]["speed"]["count"] > count + 10)
        finally:
            await asyncio.to_thread(remount, disk, "rw")
        assert (await one.ask(kind="record", on=True))["ok"], "and the disk is mended"
        await one.state(lambda s: s["recording"]["messages"] > 5, within_s=10.0)
    names = sorted(path.name for path in disk.rglob("*.mcap"))
    assert len(names) == 2
    assert names[0] == f"{first}.mcap"


def test_a_read_only_disk_keeps_what_was_left(disk: Path) -> None:
    folder = disk / "car"
    written(folder / "car_1.mcap", 1).abandon()
    remount(disk, "ro")
    (done,) = recover_all(RecordingsFolder(disk))
    assert done.is_settled is False
    assert done.sentence == (
        "car_1 cannot be recovered now: the folder for recordings is read-only. It is kept as it is."
    )
    assert (folder / "car_1.mcap.writing").exists()

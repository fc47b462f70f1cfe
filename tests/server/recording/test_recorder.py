"""The recorder's thread: what is handed over is on the disk, in order; what is not is counted and reported."""

from __future__ import annotations

import asyncio
import os
import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from server.judge.message import RosVersion
from server.recording import chain_neighbours, recorder_queue, space
from server.recording.chain_neighbours import read_first_metadata
from server.recording.folder import RecordingsFolder
from server.recording.read.read import open_recording
from server.recording.recorder import Recorder
from server.recording.recorder_queue import Part
from server.recording.space import Allowance, amount
from tests.server.recording.chained import closed

AT_NS = 1_700_000_000_000_000_000
PLENTY = Allowance(quota=0, min_free=0)
V = {"x": 1.0, "y": 0.0, "z": 0.0}


class RecorderUser:
    """The loop, as a recorder is used by it."""

    def __init__(self, root: Path, allowance: Allowance = PLENTY) -> None:
        self.folder = RecordingsFolder(root)
        self.finished: list[Path] = []
        loop = asyncio.get_running_loop()
        self.recorder = Recorder(
            self.folder, call=loop.call_soon_threadsafe, on_finished=self.finished.append, allowance=allowance
        )

    def part(self, n: int = 1, version: RosVersion = 1) -> Part:
        id = self.folder.new_id("car", 1_700_000_000_000 + n * 1000)
        return Part(path=self.folder.place("car", id), version=version, metadata={"part": str(n)})

    def say(self, n: int, topic: str = "/vel", type: str | None = "geometry_msgs/Twist", message: Any = None) -> None:
        content = {"linear": V | {"x": float(n)}, "angular": V} if message is None else message
        self.recorder.take(topic, type, content, AT_NS + n * 1_000_000, 100, n / 1000)

    async def end(self, **ended: str) -> None:
        done = asyncio.Event()
        self.recorder.end(then=done.set, **ended)
        async with asyncio.timeout(10):
            await done.wait()

    async def stop(self) -> None:
        done = asyncio.Event()
        self.recorder.stop(then=done.set)
        async with asyncio.timeout(10):
            await done.wait()

    async def until(self, holds: Callable[[], bool]) -> None:
        async with asyncio.timeout(10):
            while not holds():
                await asyncio.sleep(0.01)


async def test_what_was_handed_over_before_the_end_is_in_the_file(tmp_path: Path) -> None:
    user = RecorderUser(tmp_path / "recordings")
    user.recorder.begin(user.part())
    for n in range(1000):
        user.say(n)
        if n % 100 == 0:
            user.recorder.own("alarms", {"n": n}, AT_NS + n * 1_000_000)
    user.say(1000, "/odd", "his_msgs/Odd", {"a": [None, "é"]})
    user.say(1001, "/vel", "geometry_msgs/Twist", {"linear": "no vector"})
    user.say(1002, "/untyped", None, {"b": 1})
    await user.end(ended="closed", why="enough")
    (path,) = user.finished
    assert user.recorder.status.state == "off"
    assert user.recorder.status.misfits == 3  # two of types that nobody knows, and one that is not of its type
    assert user.recorder.status.messages == 1003
    assert user.recorder.dropped == 0
    with open_recording([path]) as recording:
        assert recording.metadata == {"part": "1", "ended": "closed", "why": "enough"}
        messages = list(recording.messages())
        assert [m.message["linear"]["x"] for m in messages[:1000]] == [float(n) for n in range(1000)]
        assert [(m.topic, m.message) for m in messages[1000:]] == [
            ("/odd", {"a": [None, "é"]}),
            ("/vel", {"linear": "no vector"}),
            ("/untyped", {"b": 1}),
        ]
        own = list(recording.own("/catgraph/alarms"))
        assert [entry for _, entry in own] == [{"time_ms": AT_NS // 1_000_000 + n, "n": n} for n in range(0, 1000, 100)]
    await user.stop()


async def test_parts_follow_each_other_and_share_nothing(tmp_path: Path) -> None:
    user = RecorderUser(tmp_path)
    for n in (1, 2):
        user.recorder.begin(user.part(n))
        for i in range(n * 10):
            user.say(i)
        user.recorder.end(ended="closed")
        user.say(99)  # between two parts nothing is recorded
    await user.stop()
    assert [path.name for path in user.finished] == ["car_20231114T221321Z.mcap", "car_20231114T221322Z.mcap"]
    for n, path in enumerate(user.finished, 1):
        with open_recording([path]) as recording:
            assert (recording.metadata["part"], recording.count) == (str(n), n * 10)


async def test_a_definition_that_the_bridge_gave_counts_from_then_on(tmp_path: Path) -> None:
    user = RecorderUser(tmp_path)
    user.recorder.begin(user.part())
    user.say(1, "/a", "my_msgs/A", {"x": 1.5})
    user.recorder.learn({"my_msgs/A": "float32 x\n"})
    user.say(2, "/a", "my_msgs/A", {"x": 2.5})
    await user.stop()
    with open_recording(user.finished) as recording:
        assert recording.topics["/a"].definition == "float32 x\n"
        assert [m.message for m in recording.messages()] == [{"x": 1.5}, {"x": 2.5}]


@pytest.mark.field
async def test_it_is_on_the_disk_within_half_a_second_without_a_request(tmp_path: Path) -> None:
    user = RecorderUser(tmp_path)
    part = user.part()
    user.recorder.begin(part)
    user.say(1)
    await user.until(lambda: user.recorder.status.state == "recording")
    user.say(2)
    handed_s = time.monotonic()
    await user.until(lambda: user.recorder.status.messages == 2)
    assert time.monotonic() - handed_s < 0.5
    with open_recording([part.path.with_name(f"{part.id}.mcap.writing")]) as recording:
        assert recording.count == 2
    await user.stop()


async def test_what_does_not_fit_the_queue_is_dropped_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_queue, "MAX_QUEUED", 10)
    user = RecorderUser(tmp_path)
    for n in range(15):  # nobody takes from the queue yet: the disk of a thread that hangs looks the same
        user.say(n)
    assert (user.recorder.queued, user.recorder.dropped, user.recorder.dropped_at_s) == (10, 5, 0.014)
    user.recorder.own("alarms", {"n": 1}, AT_NS)
    assert (user.recorder.queued, user.recorder.dropped) == (11, 5), "there is room left for what is ours"


async def test_large_messages_fill_the_queue_by_their_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_queue, "MAX_QUEUED_BYTES", 350)
    user = RecorderUser(tmp_path)
    for n in range(6):
        user.say(n)
    assert (user.recorder.queued, user.recorder.dropped) == (4, 2)
    user.recorder.begin(user.part())
    await user.until(lambda: user.recorder.queued == 0)
    user.say(7)
    assert user.recorder.dropped == 2, "what was taken from it is no load any more"
    await user.stop()


@pytest.mark.parametrize(
    ("allowance", "why"),
    [
        (Allowance(quota=0, min_free=1 << 62), r"The disk has .* left, and recording stops at 4611686018 GB\."),
        (Allowance(quota=1000, min_free=0), r"Recordings take 1\.5 kB, all of the 1\.0 kB that are allowed\."),
    ],
)
async def test_where_there_is_no_room_nothing_is_begun(tmp_path: Path, allowance: Allowance, why: str) -> None:
    (tmp_path / "bus").mkdir()
    (tmp_path / "bus" / "old.mcap").write_bytes(bytes(1500))
    user = RecorderUser(tmp_path, allowance)
    user.recorder.begin(user.part())
    user.say(1)
    await user.until(lambda: user.recorder.status.state == "stopped")
    assert user.recorder.status.trouble is not None
    assert re.fullmatch(why, user.recorder.status.trouble)
    await user.stop()
    assert user.finished == []
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["bus", "old.mcap"], "and nothing is deleted for it"


async def test_at_the_limit_it_stops_and_what_was_recorded_is_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(space, "LOOK_S", 0.1)
    user = RecorderUser(tmp_path)
    user.recorder.begin(user.part())
    user.say(1)
    await user.until(lambda: user.recorder.status.messages == 1)
    assert user.finished == []
    user.recorder.allowance = Allowance(quota=1, min_free=0)
    await user.until(lambda: bool(user.finished))
    status = user.recorder.status
    assert status.state == "stopped"
    assert status.trouble is not None
    assert status.trouble.startswith("Recordings take ")
    assert status.trouble.endswith("What was recorded is saved.")
    user.say(2)
    user.recorder.allowance = PLENTY
    user.recorder.begin(user.part(2))
    user.say(3)
    await user.stop()
    with open_recording([user.finished[0]]) as recording:
        assert recording.count == 1
        assert recording.metadata["why"] == status.trouble
    with open_recording([user.finished[1]]) as recording:
        assert [m.message["linear"]["x"] for m in recording.messages()] == [3.0]


@pytest.mark.field
async def test_after_it_stopped_by_itself_nothing_piles_up(tmp_path: Path) -> None:
    """The loop passes on what comes until somebody ends the part."""
    user = RecorderUser(tmp_path, Allowance(quota=0, min_free=1 << 62))
    user.recorder.begin(user.part())
    await user.until(lambda: user.recorder.status.state == "stopped" and user.recorder.queued == 0)
    await asyncio.sleep(0.1)  # the thread waits again
    for n in range(100):
        user.say(n)
    await user.until(lambda: user.recorder.queued == 0)
    assert user.recorder.dropped == 0
    await user.stop()


async def test_a_folder_that_is_none_is_reported(tmp_path: Path) -> None:
    (tmp_path / "recordings").write_text("a file")
    user = RecorderUser(tmp_path / "recordings")
    user.recorder.begin(replace(user.part(), path=tmp_path / "recordings" / "car" / "a.mcap"))
    await user.until(lambda: user.recorder.status.state == "stopped")
    assert user.recorder.status.trouble == "Recording cannot begin: the folder for recordings is not a folder."
    await user.stop()


async def test_a_file_whose_name_is_no_text_stops_no_recording(tmp_path: Path) -> None:
    """Metadata cannot name it: the recording before that one is named."""
    user = RecorderUser(tmp_path / "recordings")
    part = user.part()
    closed(part.path.with_name("car_20210101T000000Z.mcap"), [[1]])
    closed(part.path.with_name(os.fsdecode(b"car_20220101T000000Z\xe9.mcap")), [[1]])
    user.recorder.begin(part)
    user.say(1)
    await user.end(ended="closed")
    await user.stop()
    (path,) = user.finished
    assert read_first_metadata(path)["previous"] == "car_20210101T000000Z"


async def test_a_fault_of_the_search_for_the_recording_before_stops_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path) -> None:
        raise ValueError("a file of an unforeseen kind")

    monkeypatch.setattr(chain_neighbours, "newest_head", fail)
    user = RecorderUser(tmp_path / "recordings")
    user.recorder.begin(user.part())
    user.say(1)
    await user.end(ended="closed")
    await user.stop()
    (path,) = user.finished
    assert "previous" not in read_first_metadata(path)


async def test_a_file_that_is_taken_away_while_it_is_written_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(space, "LOOK_S", 0.1)
    user = RecorderUser(tmp_path)
    part = user.part()
    user.recorder.begin(part)
    await user.until(lambda: user.recorder.status.state == "recording")
    part.path.with_name(f"{part.id}.mcap.writing").unlink()
    await user.until(lambda: user.recorder.status.state == "stopped")
    assert user.recorder.status.trouble == "Recording stopped: the folder or the file was removed."
    assert user.finished == []
    await user.stop()


@pytest.mark.parametrize(
    ("size", "text"),
    [(0, "0 bytes"), (999, "999 bytes"), (1000, "1.0 kB"), (1_250_000, "1.2 MB"), (99_400_000, "99.4 MB"),
     (340_000_000, "340 MB"), (1_200_000_000, "1.2 GB"), (2e12, "2000 GB")],
)  # fmt: skip
def test_amounts_are_shown_in_usual_units(size: float, text: str) -> None:
    assert amount(size) == text

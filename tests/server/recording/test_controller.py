"""Recording of a real car on a real bridge: with monitoring and by hand, over a lost link, and what a kill leaves."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from server.analysis.recorded_log import read_recorded_log
from server.app.config import Config
from server.judge.active_settings import ActiveSettings
from server.judge.settings import SettingsFile
from server.recording.controller import SessionRecording
from server.recording.folder import RecordingsFolder
from server.recording.mcap.chunks import Walk
from server.recording.read.read import open_recording
from server.recording.recorded_topics import choose
from server.recording.standing import read_standing
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.page.processes import Process
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import Viewer, viewer

SOON_S = 20.0  # on two busy cores


@contextlib.asynccontextmanager
async def watched(bridge: RosBridge, data: Path) -> AsyncIterator[tuple[str, Viewer]]:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=data)  # type: ignore[attr-defined]
    async with serving(config) as base, viewer(base, name="Ann") as one:
        yield base, one


def recording_is(state: str, **more: Any) -> Any:
    return lambda s: s["recording"]["state"] == state and all(s["recording"][k] == v for k, v in more.items())


def files(data: Path) -> list[str]:
    return sorted(path.name for path in (data / "recordings").rglob("*.mcap*") if path.suffix != ".json")


def metadata_so_far(path: Path) -> Mapping[str, str]:
    """The metadata of the file that is being written."""
    with path.open("rb") as file:
        walk = Walk(file, path.stat().st_size)
        for _ in walk.chunks():
            pass
    return walk.metadata[-1].metadata


async def listed(base: str) -> list[str]:
    async with http_client(base_url=base) as client:
        return [row["id"] for row in (await client.get("/api/recordings")).json()["recordings"]]


async def test_it_begins_with_monitoring_and_holds_what_the_car_and_the_operator_sent(
    bridge: RosBridge, tmp_path: Path
) -> None:
    bridge.advertise("/rosout_like", "std_msgs/String")
    bridge.advertise("/camera", "sensor_msgs/CompressedImage")
    bridge.advertise("/custom", "my_msgs/Odd", definition="float32 x\nstring y\n")
    async with watched(bridge, tmp_path) as (base, one), driving(bridge, speed=lambda n: n / 10, scans=True) as sent:
        state = await one.state(lambda s: s["recording"]["messages"] > 20, within_s=SOON_S)
        assert state["recording"]["state"] == "recording"
        assert state["recording"]["left_out"] == ["/camera"]
        assert state["recording"]["left_out_count"] == 1
        assert state["recording"]["reason"] is None
        assert state["link"]["topics_subscribed"] == 2, "what is received for the recorder alone counts for nobody else"
        received = state["session"]["received"]
        recorded_only = [bridge.graph.find(topic) for topic in ("/custom", "/rosout_like")]
        async with asyncio.timeout(10):  # definitions are requested first
            while not all(topic is not None and topic.subscribers for topic in recorded_only):
                await asyncio.sleep(0.02)
        for n in range(5):
            bridge.publish("/rosout_like", {"data": f"line {n}"})
            bridge.publish("/custom", {"x": n, "y": "é"})
            await asyncio.sleep(0.02)
        state = await one.state(lambda s: s["session"]["received"] > received + 10, SOON_S)
        assert state["session"]["rejected"] == 0
        name = state["recording"]["name"]
        (writing,) = (tmp_path / "recordings").rglob("*.writing")
        async with asyncio.timeout(SOON_S):  # a kill leaves what is in the file by now
            while metadata_so_far(writing).get("left_out") != "/camera":
                await asyncio.sleep(0.1)
        assert (await one.ask(kind="set", values={"speed_limit.max_mps": 12.0}))["ok"]
        assert (await one.ask(kind="pause"))["ok"]
        refused = await one.ask(kind="record", on=True)
        assert refused == {**refused, "ok": False, "reason": "It is already being recorded."}
        await one.ask(kind="position", phone="abcd-1", handheld=True, why="denied")
        assert (await one.ask(kind="disconnect"))["ok"]
        await one.state(recording_is("off"), SOON_S)
        assert await listed(base) == [name]
        assert len(sent) > 20
    assert files(tmp_path) == [f"{name}.mcap"]
    path = RecordingsFolder(tmp_path / "recordings").path_of(name)
    assert path is not None
    with open_recording([path]) as recording:
        assert {topic: info.type for topic, info in recording.topics.items()} == {
            "/catvehicle/vel": "geometry_msgs/Twist",
            "/scan": "sensor_msgs/LaserScan",
            "/rosout_like": "std_msgs/String",
            "/custom": "my_msgs/Odd",
        }
        assert recording.topics["/custom"].definition == "float32 x\nstring y\n"
        messages = list(recording.messages())
        speeds = [m.message["linear"]["x"] for m in messages if m.topic == "/catvehicle/vel"]
        first = round(speeds[0] * 10)
        assert speeds == [n / 10 for n in range(first, first + len(speeds))], "every message, in order"
        assert [m.message["data"] for m in messages if m.topic == "/rosout_like"] == [f"line {n}" for n in range(5)]
        assert [m.message for m in messages if m.topic == "/custom"][4] == {"x": 4.0, "y": "é"}
        metadata = recording.metadata
        assert metadata["vehicle"] == "car"
        assert metadata["address"] == bridge.address  # type: ignore[attr-defined]
        assert (metadata["part"], metadata["ended"], metadata["why"]) == ("1", "closed", "Monitoring was stopped.")
        assert (metadata["left_out"], metadata["left_out_count"]) == ("/camera", "1")
        changes = [entry["change"] for _, entry in recording.own("/catgraph/alarms")]
        assert [c for c in changes if c in ("started", "connected", "paused")] == ["started", "connected", "paused"]
        assert "settings" in changes[changes.index("connected") : changes.index("paused")]
        assert all(entry["n"] > 0 for _, entry in recording.own("/catgraph/alarms"))
        operator = [(s["kind"], s["by"], s["ok"]) for _, s in recording.own("/catgraph/operator")]
        assert operator == [("set", "Ann", True), ("pause", "Ann", True), ("record", "Ann", False)]
        assert [(s["by"], s["why"]) for _, s in recording.own("/catgraph/phone")] == [("Ann", "denied")]
        versions = [s["in_force"]["speed_limit.max_mps"] for _, s in recording.own("/catgraph/settings")]
        assert (versions[0], versions[-1]) == (11.0, 12.0)
        assert [s["phase"] for _, s in recording.own("/catgraph/link")] == ["monitoring"]


async def test_case_04_a_lost_link_saves_and_lists_what_was_recorded_and_its_return_goes_on_in_a_second_part(
    bridge: RosBridge, tmp_path: Path
) -> None:
    async with watched(bridge, tmp_path) as (base, one), driving(bridge):
        state = await one.state(lambda s: s["recording"]["messages"] > 10, within_s=SOON_S)
        name = state["recording"]["name"]
        await bridge.kill()
        state = await one.state(recording_is("held"), SOON_S)
        assert state["session"]["phase"] == "lost"
        assert state["recording"]["saved"]["name"] == name
        assert "saved" in state["recording"]["reason"]
        assert files(tmp_path) == [f"{name}.mcap"]
        assert await listed(base) == [name]
        refused = await one.ask(kind="record", on=True)
        assert refused["reason"] == "No car is connected, so there is nothing to record."
        await bridge.revive()
        state = await one.state(
            lambda s: s["recording"]["state"] == "recording" and s["recording"]["messages"] > 5, within_s=SOON_S
        )
        assert state["recording"]["name"] == f"{name}_p2"
        assert state["recording"]["part"] == 2
    assert files(tmp_path) == [f"{name}.mcap", f"{name}_p2.mcap"], "the end of the server completes the second"
    sessions = set()
    for n, file in enumerate(files(tmp_path), 1):
        with open_recording([tmp_path / "recordings" / "car" / file]) as recording:
            assert recording.metadata["part"] == str(n)
            assert recording.count > 5
            sessions.add(recording.metadata["session"])
    assert len(sessions) == 1


async def test_a_second_part_tells_which_alarms_stand_when_it_begins(bridge: RosBridge, tmp_path: Path) -> None:
    async with watched(bridge, tmp_path) as (_, one), driving(bridge):
        assert (await one.ask(kind="set", values={"speed_limit.max_mps": 3.0}))["ok"]
        await one.state(lambda s: any(a["id"] == "speed_limit" for a in s["alarms"]), within_s=SOON_S)
        await bridge.kill()
        await one.state(recording_is("held"), SOON_S)
        await bridge.revive()
        await one.state(lambda s: s["recording"]["part"] == 2 and s["recording"]["messages"] > 5, within_s=SOON_S)
    first, second = files(tmp_path)
    with open_recording([tmp_path / "recordings" / "car" / first]) as recording:
        assert read_standing(recording.metadata) == []
        (raised,) = (
            entry
            for _, entry in recording.own("/catgraph/alarms")
            if (entry["alarm"], entry["change"]) == ("speed_limit", "raised")
        )
    with open_recording([tmp_path / "recordings" / "car" / second]) as recording:
        stood = {event["alarm"]: event for event in read_standing(recording.metadata)}
        assert stood["speed_limit"]["occurrence"] == raised["occurrence"]
        numbers = {entry["n"] for _, entry in recording.own("/catgraph/alarms")}
        assert not numbers & {event["n"] for event in stood.values()}, "none is recorded twice"
        recorded = read_recorded_log(recording)
        assert recorded is not None
        assert [e.raised_s for e in recorded.episodes if e.alarm_id == "speed_limit"] == [0.0]


@pytest.mark.field
async def test_alarms_of_before_a_restart_stand_when_a_recording_begins(bridge: RosBridge, tmp_path: Path) -> None:
    address = bridge.address  # type: ignore[attr-defined]
    arguments = ("serve", "--port", "0", "--data", str(tmp_path), f"--vehicle=car={address}")
    async with driving(bridge):
        process = await Process(*arguments).start()
        async with viewer(process.address) as one:
            assert (await one.ask(kind="set", values={"speed_limit.max_mps": 3.0}))["ok"]
            state = await one.state(lambda s: any(a["id"] == "speed_limit" for a in s["alarms"]), within_s=SOON_S)
            (alarm,) = (a for a in state["alarms"] if a["id"] == "speed_limit")
        await process.kill()
        await asyncio.sleep(1.1)  # names are made of seconds
        process = await Process(*arguments).start()
        async with viewer(process.address) as one:
            state = await one.state(lambda s: s["recording"]["messages"] > 20, within_s=SOON_S)
            name = state["recording"]["name"]
            assert [a["occurrence"] for a in state["alarms"] if a["id"] == "speed_limit"] == [alarm["occurrence"]]
            assert (await one.ask(kind="disconnect"))["ok"]
            await one.state(recording_is("off"), SOON_S)
        await process.kill()
    with open_recording([tmp_path / "recordings" / "car" / f"{name}.mcap"]) as recording:
        stood = {event["alarm"]: event["occurrence"] for event in read_standing(recording.metadata)}
    assert stood["speed_limit"] == alarm["occurrence"]


@pytest.mark.field
async def test_a_link_that_returns_too_late_begins_another_recording(bridge: RosBridge, tmp_path: Path) -> None:
    async with watched(bridge, tmp_path) as (_, one), driving(bridge):
        assert (await one.ask(kind="set", values={"recording.hold_s": 0.0}))["ok"]
        state = await one.state(lambda s: s["recording"]["messages"] > 5, within_s=SOON_S)
        name = state["recording"]["name"]
        await bridge.kill()
        await one.state(recording_is("off"), SOON_S)
        await asyncio.sleep(1.1)  # names are made of seconds
        await bridge.revive()
        state = await one.state(lambda s: s["recording"]["messages"] > 5, within_s=SOON_S)
        assert state["recording"]["part"] == 1
        assert state["recording"]["name"] > name


@pytest.mark.field
async def test_by_hand_it_begins_and_ends_and_stays_ended(bridge: RosBridge, tmp_path: Path) -> None:
    async with watched(bridge, tmp_path) as (base, one), driving(bridge):
        state = await one.state(lambda s: s["recording"]["messages"] > 5, within_s=SOON_S)
        first = state["recording"]["name"]
        assert (await one.ask(kind="record", on=False))["ok"]
        state = await one.state(recording_is("off"), SOON_S)
        assert state["recording"]["reason"] == "Recording was stopped by Ann."
        assert await listed(base) == [first]
        assert (await one.ask(kind="record", on=False))["reason"] == "Nothing is being recorded."
        await bridge.kill()
        await one.state(lambda s: s["session"]["phase"] == "lost", SOON_S)
        await bridge.revive()
        state = await one.state(lambda s: s["session"]["phase"] == "monitoring", within_s=SOON_S)
        await asyncio.sleep(0.5)
        state = await one.state()
        assert state["recording"]["state"] == "off", "what a person ended does not begin by itself"
        async with http_client(base_url=base) as client:
            answer = await client.post("/api/record", json={"on": True})
            assert answer.status_code == 200
            answer = await client.post("/api/record", json={"on": True})
            assert (answer.status_code, answer.json()["detail"]) == (409, "It is already being recorded.")
        state = await one.state(lambda s: s["recording"]["messages"] > 5, within_s=SOON_S)
        assert state["recording"]["name"] != first
    with open_recording([RecordingsFolder(tmp_path / "recordings").path_of(first) or Path()]) as recording:
        assert recording.metadata["why"] == "Recording was stopped by Ann."


async def test_where_it_cannot_record_it_reports_that_and_monitors_all_the_same(
    bridge: RosBridge, tmp_path: Path
) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "car").write_text("in the way")
    async with watched(bridge, tmp_path) as (_, one), driving(bridge):
        state = await one.state(recording_is("stopped"), within_s=SOON_S)
        assert state["recording"]["reason"] == "Recording cannot begin: the folder for recordings is not a folder."
        state = await one.state(lambda s: any(a["id"] == "recording_stopped" for a in s["alarms"]), SOON_S)
        assert state["session"]["phase"] == "monitoring"
        assert state["signals"]["speed"]["freshness"] == "fresh"
        refused = await one.ask(kind="record", on=True)
        assert refused["ok"] is False
        assert refused["reason"] == "Recording cannot begin: the folder for recordings is not a folder."


async def test_a_server_that_keeps_nothing_reports_that(server: str, bridge: RosBridge) -> None:
    async with viewer(server) as one, driving(bridge):
        state = await one.state(lambda s: s["session"]["phase"] == "monitoring", within_s=SOON_S)
        assert state["recording"]["state"] == "off"
        assert "stores nothing" in state["recording"]["reason"]
        assert "stores nothing" in (await one.ask(kind="record", on=True))["reason"]


async def test_what_a_killed_server_left_is_recovered_and_listed_at_the_next_start(
    bridge: RosBridge, tmp_path: Path
) -> None:
    address = bridge.address  # type: ignore[attr-defined]
    arguments = ("serve", "--port", "0", "--data", str(tmp_path), f"--vehicle=car={address}")
    async with driving(bridge):
        process = await Process(*arguments).start()
        async with viewer(process.address) as one:
            state = await one.state(lambda s: s["recording"]["messages"] > 20, within_s=SOON_S)
        await process.kill()
    name = state["recording"]["name"]
    assert files(tmp_path) == [f"{name}.mcap.writing"]
    process = await Process("serve", "--port", "0", "--data", str(tmp_path), "--vehicle=car=ws://127.0.0.1:1").start()
    try:
        async with asyncio.timeout(10):
            while await listed(process.address) != [name]:
                await asyncio.sleep(0.05)
        async with http_client(base_url=process.address) as client:
            log = (await client.get("/api/log.json", params={"change": "recovered"})).json()
    finally:
        await process.kill()
    assert files(tmp_path) == [f"{name}.mcap"]
    assert log[0]["text"].startswith(f"{name} is truncated: ")
    with open_recording([tmp_path / "recordings" / "car" / f"{name}.mcap"]) as recording:
        assert recording.count > 20
        assert recording.metadata["ended"] == "recovered"


@pytest.mark.parametrize(
    ("also", "expected", "left_out"),
    [
        ("none", {}, ()),
        ("light", {"/a": "x/A", "/untyped": ""}, ("/catgraph/alarms", "/cloud")),
        ("all", {"/a": "x/A", "/cloud": "sensor_msgs/msg/PointCloud2", "/untyped": ""}, ("/catgraph/alarms",)),
    ],
)
def test_which_topics_are_recorded_besides(also: Any, expected: dict[str, str], left_out: tuple[str, ...]) -> None:
    offered = {
        "/vel": "geometry_msgs/msg/Twist",
        "/a": "x/A",
        "/cloud": "sensor_msgs/msg/PointCloud2",
        "/new": "y/New",
        "/untyped": "",
        "/catgraph/alarms": "std_msgs/msg/String",
    }
    requested = {"geometry_msgs/msg/Twist", "x/A", "sensor_msgs/msg/PointCloud2", "std_msgs/msg/String"}
    assert choose(offered, without={"/vel"}, also=also, requested=requested) == (expected, left_out)


@pytest.mark.world(n=4)
async def test_a_version_of_ros_that_becomes_known_later_begins_another_part(tmp_path: Path) -> None:
    """A rosapi that answers late: what came before must not decide how all that follows is kept."""
    clock = {"s": 0.0}
    recording = SessionRecording(
        "car",
        RecordingsFolder(tmp_path),
        ActiveSettings(SettingsFile(None)),
        now=lambda: clock["s"],
        wall_ms=lambda: 1_700_000_000_000 + round(clock["s"] * 1000),
    )
    recording.prepare()
    recording.link_opened("ws://car:9090")
    speed = {"linear": {"x": 4.2, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
    recording.take("/vel", None, speed, clock["s"], 100)
    recording.ros_version = 2
    clock["s"] = 0.1
    recording.tick(clock["s"])
    recording.take("/vel", "geometry_msgs/msg/Twist", speed, clock["s"], 100)
    clock["s"] = 0.2
    recording.tick(clock["s"])
    await recording.stop()
    first, second = sorted(tmp_path.rglob("*.mcap"))
    with open_recording([first]) as source:
        assert source.ros_version == 1
    with open_recording([second]) as source:
        assert source.ros_version == 2

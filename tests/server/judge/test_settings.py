"""Settings: validated, ranged, versioned, kept whole; profiles recognised; import and export."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest
import websockets

from server.app.config import Config
from server.judge import profiles
from server.judge.active_settings import ActiveSettings
from server.judge.profiles import GENERIC
from server.judge.settings import BadSetting, Settings, SettingsFile, change, differences, from_toml, salvage, to_toml
from server.judge.topics import candidates
from server.rosbridge_server.server import RosBridge
from server.vehicle.queries import refusal
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.cars import driving, twist
from tests.server.conftest import serving
from tests.server.viewer import viewer

LIMIT = "speed_limit.max_mps"


@pytest.mark.parametrize(
    "values",
    [
        {LIMIT: 0.4},
        {LIMIT: 40.1},
        {LIMIT: float("nan")},
        {LIMIT: float("inf")},
        {LIMIT: "9"},
        {LIMIT: True},
        {LIMIT: 10**400},
        {LIMIT: -1e308},
        {LIMIT: [9.0]},
        {"speed_limit": 1.0},
        {"nothing.here": 1.0},
        {"": 1.0},
    ],
    ids=str,
)
def test_what_cannot_be_set_is_refused_with_its_field(values: dict[str, float | None]) -> None:
    with pytest.raises(BadSetting) as refused:
        change(Settings(), GENERIC, values=values)
    assert refused.value.field in (*values, "speed_limit")
    assert str(refused.value)


@pytest.mark.parametrize("value", [0.5, 40.0, 9.0])
def test_the_ends_of_the_range_can_be_set(value: float) -> None:
    settings = change(Settings(), GENERIC, values={LIMIT: value})
    assert settings.limits(GENERIC).speed_limit.max_mps == value
    assert settings.version == 1


def test_the_default_is_not_kept_and_null_goes_back_to_it() -> None:
    settings = change(Settings(), GENERIC, values={LIMIT: 9.0})
    assert change(settings, GENERIC, values={LIMIT: None}).values == {}
    assert change(settings, GENERIC, values={LIMIT: 11.0}).values == {}


def test_toml_there_and_back() -> None:
    settings = change(Settings(), GENERIC, values={LIMIT: 9.25, "gauge.speed_max_mps": 20.0}, topics={"scan": "/other"})
    assert from_toml(to_toml(settings)) == settings


@pytest.mark.parametrize(
    "text",
    [
        "[limits",
        "limits = 3",
        "[limits]\nspeed_limit = 3",
        "[limits.speed_limit]\nmax_mps = 99",
        '[limits.speed_limit]\nmax_mps = "x"',
        "[limits.nothing]\nhere = 1",
        "[topics]\nscan = 7",
        '[topics]\nnothing = "/x"',
        'profile = "no such car"',
        'version = "one"',
        "[surprise]\nx = 1",
        "x = 1\n" * 20000,
        "\x00",
        "[limits.speed_limit]\nmax_mps = nan",
        "[limits.speed_limit]\nmax_mps = -inf",
        "[limits.speed_limit]\nmax_mps = " + "9" * 5000,
        "[limits.speed_limit]\nmax_mps = " + "9" * 400,
        "[limits.speed_limit]\nmax_mps = 2026-01-02",
        "[limits.speed_limit]\nmax_mps = {x = 1}",
        "[limits.speed_limit]\nfrom_a_newer_version = 1.0",
        "version = 99999999999999999999999",
        "version = true",
        "version = -1",
        'profile = ["x"]',
        '[topics]\nscan = ""',
        '[topics]\nscan = "a\\nb"',
        '[topics]\nscan = "' + "x" * 301 + '"',
        "x = " + "[" * 30000,
        '"a.b" = 1',
        "limits = []",
    ],
    ids=range(30),
)
def test_a_file_that_cannot_be_used_says_why_in_one_sentence(text: str) -> None:
    with pytest.raises(BadSetting) as refused:
        from_toml(text, known_profiles=profiles.load())
    assert 5 < len(str(refused.value)) < 300
    assert "\n" not in str(refused.value)


def test_what_is_kept_is_found_again_and_nothing_else_lies_around(tmp_path: Path) -> None:
    file = SettingsFile(tmp_path / "settings" / "car.toml")
    settings = change(Settings(), GENERIC, values={LIMIT: 9.0})
    file.write(settings)
    assert SettingsFile(tmp_path / "settings" / "car.toml").read() == settings
    assert [path.name for path in (tmp_path / "settings").iterdir()] == ["car.toml"]


def test_a_broken_file_is_set_aside_and_the_defaults_hold(tmp_path: Path) -> None:
    (tmp_path / "car.toml").write_text("[limits.speed_limit]\nmax_mps = 4000")
    file = SettingsFile(tmp_path / "car.toml")
    assert file.read() == Settings()
    assert file.complaint
    assert (tmp_path / "car.unusable.toml").exists()


def test_of_a_file_of_another_version_the_rest_is_in_force_and_nothing_is_lost(tmp_path: Path) -> None:
    """Unknown keys of a newer version, ranges that changed, a kind of car that is gone: the other limits hold."""
    path = tmp_path / "car.toml"
    text = (
        'version = 7\nprofile = "no such car"\nfrom_tomorrow = 1\n[topics]\nscan = "/other"\nsonar = "/x"\n'
        "[limits.speed_limit]\nmax_mps = 9.0\nboost_mps = 3.0\n[limits.obstacle]\nstandoff_m = 4000.0\n"
    )
    path.write_text(text)
    file = SettingsFile(path)
    found = file.read()
    assert found == Settings(version=7, values={LIMIT: 9.0}, topics={"scan": "/other"})
    assert file.complaint is not None
    for part in ("car.unusable.toml", "no such car", "from_tomorrow", "sonar", "boost_mps", "Obstacle distance"):
        assert part in file.complaint
    assert (tmp_path / "car.unusable.toml").read_text() == text
    again = SettingsFile(path)
    assert again.read() == found
    assert again.complaint is None


def test_many_things_left_out_make_a_short_complaint(tmp_path: Path) -> None:
    rows = "\n".join(f"unknown_{i} = 1.0" for i in range(200))
    (tmp_path / "car.toml").write_text(f"[limits.speed_limit]\n{rows}\nmax_mps = 9.0")
    file = SettingsFile(tmp_path / "car.toml")
    assert file.read().values == {LIMIT: 9.0}
    assert file.complaint is not None
    assert "195 more" in file.complaint
    assert len(file.complaint) < 600


@pytest.mark.parametrize(
    "text", ["[limits", "limits = 3", "\x00", "x = " + "[" * 30000, 'version = "one"', "topics = 1"]
)
def test_where_nothing_can_be_saved_the_defaults_hold(text: str) -> None:
    assert salvage(text, profiles.load())[0] == Settings()


def test_bytes_that_are_no_text_are_set_aside(tmp_path: Path) -> None:
    (tmp_path / "car.toml").write_bytes(b"\xff\xfe\x00")
    file = SettingsFile(tmp_path / "car.toml")
    assert file.read() == Settings()
    assert (tmp_path / "car.unusable.toml").read_bytes() == b"\xff\xfe\x00"
    assert file.complaint


@pytest.mark.field
def test_a_file_far_too_large_is_not_read_whole(tmp_path: Path) -> None:
    with open(tmp_path / "car.toml", "wb") as file:
        file.truncate(2**33)  # 8 GiB, sparse
    began_s = time.monotonic()
    assert SettingsFile(tmp_path / "car.toml").read() == Settings()
    assert time.monotonic() - began_s < 2.0


def _a_file_in_the_way(tmp_path: Path) -> Path:
    (tmp_path / "settings").write_text("no folder")
    return tmp_path / "settings" / "car.toml"


def _read_only(tmp_path: Path) -> Path:
    return Path("/sys/catgraph/car.toml")


@pytest.mark.parametrize("place", [_a_file_in_the_way, _read_only])
def test_a_folder_that_takes_nothing_is_told_and_nothing_is_in_force(tmp_path: Path, place: Any) -> None:
    tuning = ActiveSettings(SettingsFile(place(tmp_path)))
    with pytest.raises(OSError, match=r"\w") as refused:
        tuning.change(values={LIMIT: 9.0}, topics={}, profile=None, version=None)
    assert tuning.limits.speed_limit.max_mps == 11.0
    assert tuning.settings == Settings()
    answer = refusal(refused.value)
    assert answer["ok"] is False
    assert answer["reason"].startswith("The settings cannot be kept: ")


def test_a_name_that_no_disk_takes_stops_no_start(tmp_path: Path) -> None:
    file = SettingsFile(tmp_path / ("x" * 300 + ".toml"))
    assert file.read() == Settings()
    assert file.complaint
    assert "cannot be read" in file.complaint


def test_killed_while_writing_the_old_or_the_new_is_found_never_a_broken_one(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    whole = [
        Settings(version=n, values={LIMIT: 5.0 + n}, topics=dict.fromkeys(("scan", "speed"), f"/topic/{n}" * 20))
        for n in range(1, 5)
    ]
    for delay_ms in range(30):
        child = os.fork()
        if child == 0:
            try:
                file = SettingsFile(path)
                while True:
                    for settings in whole:
                        file.write(settings)
            finally:
                os._exit(1)
        while delay_ms == 0 and not path.exists():
            time.sleep(0.001)
        time.sleep(0.003 + delay_ms / 1000)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        found = SettingsFile(path)
        assert found.read() in whole
        assert found.complaint is None
        assert not (tmp_path / "car.unusable.toml").exists()
    SettingsFile(path).write(whole[0])  # what the killed one left is no hindrance
    assert SettingsFile(path).read() == whole[0]


def test_a_default_of_the_new_kind_of_car_is_not_kept() -> None:
    tuning = ActiveSettings(SettingsFile(None))
    lines = tuning.change(values={LIMIT: 9.0}, topics={}, profile="catvehicle", version=0)
    assert lines == [
        "Tyre angle per unit of steering: 0 → -0.00536 rad",
        "Speed limit: 11 → 9 m/s",
        "Profile: catvehicle",
    ]
    assert tuning.as_json()["profile"] == {
        "name": "catvehicle", "title": "CATVehicle", "chosen": "catvehicle", "recognised": "Any car",
    }  # fmt: skip
    with pytest.raises(BadSetting) as refused:
        tuning.change(values={}, topics={}, profile="\ud800", version=None)
    assert str(refused.value) == "There is no profile named ?."


def test_thresholds_are_made_once_and_again_with_each_change_and_each_kind_of_car() -> None:
    tuning = ActiveSettings(SettingsFile(None))
    first = tuning.limits
    assert tuning.limits is first
    tuning.change(values={LIMIT: 9.0}, topics={}, profile=None, version=None)
    assert (first.speed_limit.max_mps, tuning.limits.speed_limit.max_mps) == (11.0, 9.0)
    tuning.change(values={LIMIT: None}, topics={}, profile=None, version=None)
    assert tuning.limits.speed_limit.max_mps == 11.0
    before = tuning.limits
    assert tuning.recognise(REAL, 1)  # whose profile may have defaults of its own
    assert tuning.limits is not before


def test_the_topics_that_can_carry_a_signal_are_those_of_a_type_it_reads() -> None:
    found = candidates(
        {
            "/odom": "nav_msgs/msg/Odometry",
            "/b": "geometry_msgs/msg/Twist",
            "/a": "geometry_msgs/msg/Twist",
            "/text": "std_msgs/msg/String",
            "/unknown": "",
        }
    )
    assert [row["topic"] for row in found["speed"]] == ["/a", "/b", "/odom"]
    assert found["odometry"] == [{"topic": "/odom", "type": "nav_msgs/msg/Odometry"}]
    assert found["scan"] == []


def test_differences_are_told_in_the_operators_words() -> None:
    settings = change(Settings(), GENERIC, values={LIMIT: 9.0}, topics={"scan": "/other"})
    assert differences(Settings(), settings, GENERIC) == ["Speed limit: 11 → 9 m/s", "Topic of Laser: /other"]


REAL = {"/catvehicle/vel": "geometry_msgs/Twist", "/catVehicle/brake": "geometry_msgs/Wrench"}


@pytest.mark.parametrize(
    ("topics", "ros", "name"),
    [
        (REAL, 1, "catvehicle"),
        (REAL, 2, "catvehicle"),
        ({"/catvehicle/vel": "geometry_msgs/Twist", "/catvehicle/odom": "nav_msgs/Odometry"}, 1, "catvehicle-sim"),
        ({"/odom": "nav_msgs/msg/Odometry"}, 2, "ros2-generic"),
        ({"/odom": "nav_msgs/Odometry"}, 1, "generic"),
        ({}, None, "generic"),
    ],
)
def test_a_car_is_recognised_by_what_it_offers(topics: dict[str, str], ros: int | None, name: str) -> None:
    assert profiles.choose(profiles.load(), topics, ros).name == name


async def test_a_change_counts_at_once_is_logged_and_survives_a_restart(bridge: RosBridge, tmp_path: Path) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    async with (
        serving(config) as server,
        driving(bridge, speed=lambda n: 5.0),
        viewer(server, have_event=0) as one,
        http_client(base_url=server) as client,
    ):
        await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        before = (await client.get("/api/settings")).json()
        assert before["schema"][LIMIT]["unit"] == "m/s"
        answer = await client.patch("/api/settings", json={"values": {LIMIT: 4.0}, "version": before["version"]})
        assert answer.status_code == 200
        assert answer.json()["values"][LIMIT] == 4.0
        await one.state(lambda s: any(alarm["id"] == "speed_limit" for alarm in s["alarms"]))
        stale = await client.patch("/api/settings", json={"values": {LIMIT: 9.0}, "version": before["version"]})
        assert stale.status_code == 409
        refused = await client.patch("/api/settings", json={"values": {LIMIT: 400.0}})
        assert refused.status_code == 422
        assert refused.json()["field"] == LIMIT
        assert any(event["change"] == "settings" and "Speed limit: 11 → 4" in event["text"] for event in one.events)
        toml = (await client.get("/api/settings.toml")).text
    async with serving(config) as server, http_client(base_url=server) as client:
        assert (await client.get("/api/settings")).json()["values"][LIMIT] == 4.0
        await client.patch("/api/settings", json={"values": {LIMIT: None}})
        assert (await client.get("/api/settings")).json()["values"][LIMIT] == 11.0
        assert (await client.put("/api/settings.toml", content=toml)).json()["values"][LIMIT] == 4.0
        assert (await client.put("/api/settings.toml", content=b"\xff\xfe")).status_code == 422
        assert (await client.put("/api/settings.toml", content=b"x" * 70_000)).status_code == 413


async def test_of_two_pages_that_change_at_once_one_is_told_to_look_again(server: str) -> None:
    async with viewer(server) as one, viewer(server) as two:
        version = (await one.state())["session"]["settings_version"]
        answers = await asyncio.gather(
            one.ask(kind="set", values={LIMIT: 8.0}, version=version),
            two.ask(kind="set", values={LIMIT: 7.0}, version=version),
        )
        assert sorted(answer["ok"] for answer in answers) == [False, True]
        won = next(answer for answer in answers if answer["ok"])
        lost = next(answer for answer in answers if not answer["ok"])
        assert won["version"] == version + 1
        assert lost["conflict"] is True
        assert lost["reason"].endswith("Check them again.")
        limit = 8.0 if answers[0]["ok"] else 7.0
        for page in (one, two):
            state = await page.state(lambda s: s["session"]["settings_version"] == version + 1)
            assert state["limits"][LIMIT] == limit
        again = await two.ask(kind="set", values={LIMIT: 6.0}, version=version + 1)
        assert (again["ok"], again["version"]) == (True, version + 2)


@pytest.mark.parametrize(
    "body",
    [
        '{"values": {"speed_limit.max_mps": NaN}}',
        '{"values": {"speed_limit.max_mps": 1e999}}',
        '{"values": {"speed_limit.max_mps": "9"}}',
        '{"values": {"speed_limit.max_mps": true}}',
        '{"values": {"speed_limit.max_mps": [9]}}',
        '{"values": {"\\ud800": 9}}',
        '{"values": [9]}',
        '{"topics": {"speed": "\\ud800"}}',
        '{"topics": {"speed": 7}}',
        '{"topics": {"\\ud800": "/x"}}',
        '{"profile": "\\ud800"}',
        '{"profile": 7}',
        '{"version": "1"}',
        '{"from_a_newer_version": 1}',
        "[]",
        "{",
    ],
)
async def test_hostile_changes_are_refused_in_words_and_the_state_goes_on(server: str, body: str) -> None:
    async with http_client(base_url=server) as client:
        answer = await client.patch("/api/settings", content=body, headers={"content-type": "application/json"})
        assert answer.status_code in (409, 422)
        assert answer.json()["detail"]
        after = (await client.get("/api/settings")).json()
        assert (after["version"], after["changed"], after["topics"]) == (0, [], {})
        assert (await client.get("/api/state")).status_code == 200


async def test_candidates_come_from_what_the_car_offers(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one, http_client(base_url=server) as client:
        await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        found = (await client.get("/api/signals")).json()["candidates"]
        vel = {"topic": "/catvehicle/vel", "type": "geometry_msgs/Twist", "why": "its name", "frame": None}
        assert found["speed"] == [vel]
        assert [(one["topic"], one["type"]) for one in found["scan"]] == [("/scan", "sensor_msgs/LaserScan")]
        assert found["fuel"] == []


async def test_before_a_car_is_connected_no_topic_is_known() -> None:
    async with serving(Config(vehicles=(Vehicle(name="car"),))) as server, http_client(base_url=server) as client:
        assert (await client.get("/api/signals")).json()["candidates"] is None


@pytest.mark.field
async def test_a_picked_topic_replaces_the_found_one(bridge: RosBridge, server: str) -> None:
    bridge.advertise("/other/vel", "geometry_msgs/TwistStamped")
    async with driving(bridge), viewer(server) as one:
        await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        assert (await one.ask(kind="set", topics={"speed": "/other/vel"}))["ok"]
        bridge.publish("/other/vel", {"header": {"stamp": {"secs": 1, "nsecs": 0}}, "twist": twist(7.5)})
        state = await one.state(lambda s: s["signals"]["speed"]["topic"] == "/other/vel", within_s=8)
        assert state["signals"]["speed"]["type"] == "geometry_msgs/TwistStamped"
        for _ in range(20):
            bridge.publish("/other/vel", {"header": {"stamp": {"secs": 1, "nsecs": 0}}, "twist": twist(7.5)})
        await one.state(lambda s: s["signals"]["speed"]["value"]["speed_mps"] == 7.5)
        assert (await one.ask(kind="set", topics={"speed": None}))["ok"]
        await one.state(lambda s: s["signals"]["speed"]["topic"] == "/catvehicle/vel")


async def test_a_picked_topic_is_subscribed_though_the_bridge_tells_no_topics() -> None:
    received: list[dict[str, Any]] = []

    async def bare(socket: websockets.ServerConnection) -> None:
        """A rosbridge without rosapi: every service fails; the one topic it has is published once it is wanted."""
        async for text in socket:
            message = json.loads(text)
            received.append(message)
            if message["op"] == "call_service":
                answer = {"op": "service_response", "id": message["id"], "service": message["service"], "values": ""}
                await socket.send(json.dumps(answer | {"result": False}))
            if message["op"] == "subscribe" and message["topic"] == "/my/vel":
                await socket.send(json.dumps({"op": "publish", "topic": "/my/vel", "msg": twist(7.5)}))

    def topics(op: str) -> set[str]:
        return {message["topic"] for message in received if message["op"] == op}

    async with websockets.serve(bare, "127.0.0.1", 0) as bridge:
        port = next(iter(bridge.sockets)).getsockname()[1]
        config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),))
        async with serving(config) as server, viewer(server) as one:
            await one.state(lambda s: "/catvehicle/vel" in topics("subscribe"), within_s=15)
            assert (await one.ask(kind="set", topics={"speed": "/my/vel"}))["ok"]
            await one.state(lambda s: (s["signals"]["speed"]["value"] or {}).get("speed_mps") == 7.5, within_s=15)
            assert "/catvehicle/vel" in topics("unsubscribe")
            assert "/gps_fix" not in topics("unsubscribe")


async def test_the_log_is_paged_filtered_and_exported(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one, http_client(base_url=server) as client:
        for _ in range(3):
            await one.ask(kind="pause")
            await one.ask(kind="resume")
        first = (await client.get("/api/log", params={"limit": 4})).json()
        assert [event["n"] for event in first["events"]] == sorted((e["n"] for e in first["events"]), reverse=True)
        second = (await client.get("/api/log", params={"limit": 4, "before": first["next_before"]})).json()
        assert second["events"][0]["n"] == first["events"][-1]["n"] - 1
        paused = (await client.get("/api/log", params={"change": "paused"})).json()
        assert [event["change"] for event in paused["events"]] == ["paused"] * 3
        everything = (await client.get("/api/log.json")).json()
        assert [event["n"] for event in everything] == list(range(1, first["last"] + 1))
        rows = (await client.get("/api/log.csv")).text.splitlines()
        assert rows[0].startswith("n,time,change")
        assert len(rows) == len(everything) + 1


def test_a_unit_is_of_its_topic() -> None:
    settings = change(Settings(), GENERIC, topics={"brake": "/a"}, units={"brake": "share"})
    assert settings.units == {"brake": "share"}
    assert change(settings, GENERIC, topics={"speed": "/v"}).units == {"brake": "share"}
    assert change(settings, GENERIC, topics={"brake": "/a"}).units == {"brake": "share"}
    assert change(settings, GENERIC, topics={"brake": "/b"}).units == {}
    assert change(settings, GENERIC, topics={"brake": None}).units == {}

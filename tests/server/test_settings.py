"""Settings: validated, ranged, versioned, kept whole; profiles recognised; import and export."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from server import profiles
from server.bridge.server import RosBridge
from server.config import Config, Vehicle
from server.profiles import GENERIC
from server.settings import BadSetting, Settings, SettingsFile, change, differences, from_toml, to_toml
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
    ],
    ids=range(13),
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
        httpx.AsyncClient(base_url=server) as client,
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
    async with serving(config) as server, httpx.AsyncClient(base_url=server) as client:
        assert (await client.get("/api/settings")).json()["values"][LIMIT] == 4.0
        await client.patch("/api/settings", json={"values": {LIMIT: None}})
        assert (await client.get("/api/settings")).json()["values"][LIMIT] == 11.0
        assert (await client.put("/api/settings.toml", content=toml)).json()["values"][LIMIT] == 4.0
        assert (await client.put("/api/settings.toml", content=b"\xff\xfe")).status_code == 422
        assert (await client.put("/api/settings.toml", content=b"x" * 70_000)).status_code == 413


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


async def test_the_log_is_paged_filtered_and_exported(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one, httpx.AsyncClient(base_url=server) as client:
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

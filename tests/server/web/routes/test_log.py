"""The alarm log over HTTP, and who stands in it: paged, filtered, exported; names cleaned; settings from → to."""

from __future__ import annotations

import asyncio
import csv
import io
from typing import Any

import pytest
import pytest_asyncio

from server.app.config import Config
from server.bus.event_table import COLUMNS
from server.control import display_name
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import viewer

LIMIT = "speed_limit.max_mps"


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("Pixel 7 · a3f2", "Pixel 7 · a3f2"),
        ("  two\t words\n\n here ", "two words here"),
        ("x" * 500, "x" * 40),
        ("\u202egnp.exe", "gnp.exe"),
        ("a\x00b\x1b[31mc", "a b [31mc"),
        ("Jos\u00e9 \u5b57", "Jos\u00e9 \u5b57"),
        ("", None),
        (" \u200b\u2066 ", None),
        (None, None),
        (7, None),
        (["Ann"], None),
        ("\ud800", None),
    ],
    ids=repr,
)
def test_a_name_is_one_short_line_of_letters_that_are_seen(given: object, kept: str | None) -> None:
    assert display_name.clean(given) == kept


@pytest.mark.parametrize(
    ("agent", "name"),
    [
        ("curl/8.5.0", "api · curl"),
        ("python-httpx/0.28.1", "api · python-httpx"),
        ("Mozilla/5.0 (X11; Linux x86_64)", "api · Mozilla"),
        ("", "api"),
        (None, "api"),
        ("\x00/1", "api"),
        ("y" * 900, "api · " + "y" * 34),
    ],
)
def test_a_program_is_called_by_its_product(agent: str | None, name: str) -> None:
    assert display_name.of_program(agent) == name


async def who(server: str, change: str) -> list[Any]:
    async with http_client(base_url=server) as client:
        return [event["by"] for event in (await client.get("/api/log", params={"change": change})).json()["events"]]


@pytest.mark.virtual_time
async def test_whoever_gives_an_order_is_named_by_the_connection_not_by_the_order(
    bridge: RosBridge,
    server: str,
) -> None:
    async with driving(bridge), viewer(server, name="Ann\u202e") as ann, viewer(server) as nameless:
        await ann.state(lambda s: s["session"]["phase"] == "monitoring")
        async with asyncio.timeout(20):
            while await who(server, "settings") != [None]:  # what kind of car it is
                await asyncio.sleep(0.05)
        assert (await ann.ask(kind="pause", by="somebody else"))["ok"]
        await ann.send({"kind": "hello", "name": "Ann B"})  # renamed while connected
        assert (await ann.ask(kind="resume"))["ok"]
        assert (await nameless.ask(kind="pause"))["ok"]
        assert await who(server, "paused") == ["operator", "Ann"]
        assert await who(server, "resumed") == ["Ann B"]
        async with http_client(base_url=server) as client:
            await client.post("/api/resume", headers={"X-Catgraph-Name": "test rig  7"})
            await client.post("/api/pause", headers={"User-Agent": "curl/8.5.0"})
            await client.patch("/api/settings", json={"values": {LIMIT: 9.0}})
            await client.post("/api/disconnect")
        assert (await who(server, "resumed"))[0] == "test rig 7"
        assert (await who(server, "paused"))[0] == "api · curl"
        assert await who(server, "settings") == ["api · python-httpx", None]
        assert await who(server, "stopped") == ["api · python-httpx"]


@pytest.mark.virtual_time
async def test_an_alarm_tells_who_acknowledged_and_who_shelved_it(
    bridge: RosBridge,
    server: str,
) -> None:
    async with viewer(server, name="Ann") as one:
        async with driving(bridge):
            await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        state = await one.state(lambda s: any(a["id"] == "car_silent" and a["state"] == "UNACKED" for a in s["alarms"]))
        silent = next(a for a in state["alarms"] if a["id"] == "car_silent")
        assert silent["acknowledged_by"] is None
        assert (await one.ask(kind="acknowledge", alarm="car_silent", occurrence=silent["occurrence"]))["ok"]
        state = await one.state(lambda s: any(a["id"] == "car_silent" and a["state"] == "ACKED" for a in s["alarms"]))
        assert next(a for a in state["alarms"] if a["id"] == "car_silent")["acknowledged_by"] == "Ann"


@pytest.mark.virtual_time
async def test_the_log_alone_says_what_was_judged_by_at_every_moment(bridge: RosBridge) -> None:
    """Folding the settings events of the log gives the settings in force, whatever was changed and by whom."""
    bridge.advertise("/catvehicle/brake", "geometry_msgs/Wrench")  # so that it is taken for a CATVehicle
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    async with serving(config) as base, driving(bridge), http_client(base_url=base) as client:
        async with viewer(base, name="Ann") as one:
            await one.state(lambda s: s["session"]["profile"] == "CATVehicle")
            await one.ask(kind="set", values={LIMIT: 4.0, "speed_limit.deadband_mps": 0.2})
            await one.ask(kind="set", values={LIMIT: 5.0}, topics={"fuel": "/tank"})
            await one.ask(kind="set", profile="generic")
            await one.ask(kind="set", values={LIMIT: None}, topics={"fuel": None})
            toml = '[limits.speed_limit]\nmax_mps = 7.5\n[topics]\nscan = "/other"\n'
            assert (await one.ask(kind="import", toml=toml))["ok"]
        now = (await client.get("/api/settings")).json()
        log = (await client.get("/api/log.json")).json()
    in_force: dict[str, Any] = {}
    versions = []
    for event in log:
        if event["change"] == "started":
            settings = dict(event["settings"])
            in_force = settings | {f"topics.{name}": topic for name, topic in settings.pop("topics").items()}
            in_force.pop("topics", None)
        elif event["change"] == "settings":
            for name, (old, new) in event["changes"].items():
                assert in_force.get(name) == old
                in_force[name] = new
            versions.append(event["settings_version"])
    assert {name: value for name, value in in_force.items() if "." in name and not name.startswith("topics.")} == now[
        "values"
    ]
    assert in_force["profile"] == now["profile"]["name"]
    assert in_force["topics.scan"] == "/other"
    assert in_force["topics.fuel"] is None
    assert versions == sorted(versions)
    assert versions[-1] == now["version"]


@pytest_asyncio.fixture
async def speeding(bridge: RosBridge) -> Any:
    """A log with a speed alarm, its acknowledgement and its end in it."""
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    speeds = {"now": 12.6}
    async with (
        serving(config) as base,
        driving(bridge, speed=lambda n: speeds["now"]),
        viewer(base, name='=cmd|"/c calc"!A1') as one,
    ):
        state = await one.state(lambda s: any(a["id"] == "speed_limit" for a in s["alarms"]))
        found = next(a for a in state["alarms"] if a["id"] == "speed_limit")
        await one.ask(kind="acknowledge", alarm="speed_limit", occurrence=found["occurrence"])
        speeds["now"] = 2.0
        await one.state(lambda s: not any(a["id"] == "speed_limit" for a in s["alarms"]), within_s=8)
        yield base


async def test_every_transition_has_its_values_and_limits_in_every_export(speeding: str) -> None:
    async with http_client(base_url=speeding) as client:
        only = {"alarm": "speed_limit"}
        log = (await client.get("/api/log.json", params=only)).json()
        text = (await client.get("/api/log.csv", params=only)).text
        page = (await client.get("/api/log", params=only | {"limit": 2})).json()
        rest = (await client.get("/api/log", params=only | {"limit": 2, "before": page["next_before"]})).json()
        later = (await client.get("/api/log.json", params={"since_ms": log[-1]["at_ms"]})).json()
        earlier = (await client.get("/api/log.csv", params={"until_ms": log[0]["at_ms"], "change": "started"})).text
        everything = (await client.get("/api/log.csv")).text
    assert [event["change"] for event in log] == ["raised", "acknowledged", "cleared"]
    assert [event["state"] for event in log] == ["UNACKED", "ACKED", "NORMAL"]
    assert log[0]["measured"] == {"label": "Speed", "value": 12.6, "unit": "m/s"}
    assert log[0]["limit"] == {"label": "Limit", "value": 11.0, "unit": "m/s"}
    assert [event["settings_version"] for event in log] == [0, 0, 0]
    assert page["events"][::-1] == log[1:]
    assert rest["events"] == log[:1]
    assert rest["next_before"] is None
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0]) == list(COLUMNS)
    assert [(row["change"], row["state"]) for row in rows] == [
        ("raised", "UNACKED"), ("acknowledged", "ACKED"), ("cleared", "NORMAL")
    ]  # fmt: skip
    assert (rows[0]["measured"], rows[0]["limit"], rows[0]["unit"]) == ("12.6", "11.0", "m/s")
    assert rows[1]["by"].startswith("'=cmd")  # no spreadsheet runs it
    assert all(event["at_ms"] >= log[-1]["at_ms"] for event in later)
    assert [row["change"] for row in csv.DictReader(io.StringIO(earlier))] == ["started"]
    started = next(row for row in csv.DictReader(io.StringIO(everything)) if row["change"] == "started")
    assert '"speed_limit.max_mps":11.0' in started["details"]


@pytest.mark.parametrize(
    "query",
    [
        "limit=0",
        "limit=501",
        "before=0",
        "since_ms=-1",
        "since_ms=x",
        "alarm=" + "x" * 200,
        "until_ms=1e400",
        "priority=red",
        "text=" + "x" * 121,
    ],
)
async def test_a_query_that_makes_no_sense_is_refused(server: str, query: str) -> None:
    async with http_client(base_url=server) as client:
        assert (await client.get(f"/api/log?{query}")).status_code == 422


async def test_an_empty_log_is_exported_as_its_columns() -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        assert (await client.get("/api/log.csv")).text.strip() == ",".join(COLUMNS)
        assert (await client.get("/api/log.json")).json() == []


@pytest.mark.virtual_time
async def test_the_load_and_the_state_of_the_log_are_metrics(speeding: str) -> None:
    async with http_client(base_url=speeding) as client:
        lines = (await client.get("/metrics")).text.splitlines()
        state = (await client.get("/api/state")).json()
    assert 'catgraph_alarm_log_kept{vehicle="car"} 1' in lines
    load = next(line for line in lines if line.startswith("catgraph_alarms_announced_10_min{"))
    assert float(load.split()[-1]) == state["alarm_load"]["in_10_min"] >= 1
    assert state["alarm_load"]["chattering"] == []
    assert state["log_trouble"] is None

"""Several cars of one server: what a page gets of the others, and that an order reaches the car it was meant for."""

from __future__ import annotations

import asyncio
import contextlib
import csv
import time
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import websockets

from server.app.app import create_app
from server.rosbridge_server.server import RosBridge
from server.system.log_context import with_context
from server.vehicle.command_handler import CommandHandler
from tests.http import http_client
from tests.server.cars import driving, twist
from tests.server.conftest import serving, serving_app, two
from tests.server.slowdown.conftest import simulated, watching
from tests.server.viewer import Viewer, viewer

pytestmark = pytest.mark.virtual_time


def cars(one: Viewer) -> list[dict[str, Any]]:
    """Of the newest frame, by their order on the server; empty before the first."""
    frames = [frame for frame in one.other if frame["kind"] == "cars"]
    return frames[-1]["cars"] if frames else []


def sent_ms(one: Viewer) -> list[int]:
    """When each list was made, by the server's clock."""
    return [frame["time_ms"] for frame in one.other if frame["kind"] == "cars"]


def named(one: Viewer, name: str) -> dict[str, Any] | None:
    """The summary of one car; None: none came, or nothing is known."""
    return next((car["summary"] for car in cars(one) if car["name"] == name), None)


@contextlib.asynccontextmanager
async def speeding(car: RosBridge, speed_mps: float) -> AsyncIterator[None]:
    """The car sends its speed 20 times a second."""

    async def send() -> None:
        while True:
            car.publish("/catvehicle/vel", twist(speed_mps))
            await asyncio.sleep(0.05)

    task = asyncio.create_task(send())
    try:
        yield
    finally:
        task.cancel()


async def test_a_page_is_told_of_the_other_cars_twice_a_second(bridge: RosBridge, other: RosBridge) -> None:
    async with serving(two(bridge, other)) as base, driving(bridge), speeding(other, 3.0), viewer(base) as one:
        await one.until(lambda: (named(one, "serval") or {}).get("speed", {}).get("value_mps") == 3.0)
        assert [car["name"] for car in cars(one)] == ["ocelot", "serval"]
        serval = named(one, "serval")
        assert serval is not None
        assert (serval["phase"], serval["speed"]["freshness"], serval["slow_down"]) == (
            "monitoring", "fresh", "not_available",
        )  # fmt: skip
        before = len(sent_ms(one))
        await one.until(lambda: len(sent_ms(one)) >= before + 4)
        assert (sent_ms(one)[before + 3] - sent_ms(one)[before]) / 3 == pytest.approx(500, abs=100)


async def test_one_car_alone_sends_no_list(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one:
        await one.until(lambda: len(one.states) > 12)  # two lists would have come meanwhile
        assert cars(one) == []
        assert all("cars" not in offer["of"] for offer in one.offers)


async def test_an_alarm_of_another_car_comes_at_once(bridge: RosBridge, other: RosBridge) -> None:
    async with serving(two(bridge, other)) as base, driving(bridge), viewer(base, vehicle="ocelot") as one:
        await one.until(lambda: named(one, "serval"))
        begun_s = time.monotonic()
        async with speeding(other, 30.0):
            await one.until(lambda: ((named(one, "serval") or {}).get("worst") or {}).get("id") == "speed_limit")
            assert time.monotonic() - begun_s < 0.4
            serval = named(one, "serval")
            assert serval is not None
            assert (serval["worst"]["priority"], serval["worst"]["state"]) == ("critical", "UNACKED")
            assert serval["waiting"] >= 1


async def test_a_car_whose_session_stopped_is_unknown_and_its_age_grows(bridge: RosBridge, other: RosBridge) -> None:
    config = two(bridge, other)
    app = create_app(config, now=time.monotonic)
    async with (
        serving_app(app, config) as base,
        driving(bridge),
        speeding(other, 3.0),
        viewer(base, vehicle="ocelot") as one,
    ):
        await one.until(lambda: (named(one, "serval") or {}).get("phase") == "monitoring")
        await app.state.services.sessions["serval"].stop()
        await one.until(lambda: cars(one)[1]["summary"] is None)
        age_s = cars(one)[1]["age_s"]
        assert age_s >= 2.0
        await one.until(lambda: cars(one)[1]["age_s"] > age_s + 0.4)
        assert cars(one)[0]["summary"]["phase"] == "monitoring"


@pytest.mark.parametrize("kind", ["slow_down", "arm", "disarm", "release", "veto"])
async def test_what_acts_on_a_car_is_refused_by_any_other(bridge: RosBridge, other: RosBridge, kind: str) -> None:
    more = {"release": {"number": 1}, "veto": {"trigger": "on_speed"}}.get(kind, {})
    async with serving(two(bridge, other)) as base, viewer(base, vehicle="ocelot", have_event=0, page="aaaa") as one:
        answer = await one.ask(kind=kind, vehicle="serval", **more)
        assert answer["ok"] is False
        assert answer["reason"] == "This was meant for serval, and this is ocelot: nothing was sent to either."
        right = await one.ask(kind=kind, vehicle="ocelot", **more)
        unnamed = await one.ask(kind=kind, **more)
        assert "meant for" not in right.get("reason", "") + unnamed.get("reason", "")
        if kind == "slow_down":
            await one.until(
                lambda: [e for e in one.events if "meant for serval" in e["text"] and e["step"] == "refused"]
            )


async def test_a_program_orders_without_a_body(bridge: RosBridge, other: RosBridge, tmp_path: Path) -> None:
    async with serving(two(bridge, other)) as base, http_client(base_url=base) as client:
        for path in ("arm", "disarm", "order"):
            answer = await client.post(f"/api/slow-down/{path}", params={"vehicle": "serval"})
            assert answer.status_code in (200, 409), (path, answer.text)


async def test_a_page_of_another_car_is_heard_where_it_announces_alarms(bridge: RosBridge, other: RosBridge) -> None:
    seen = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready"}
    async with (
        serving(two(bridge, other)) as base,
        viewer(base, vehicle="ocelot", page="aaaa") as one,
        viewer(base, vehicle="serval", page="bbbb") as there,
    ):

        async def hearing(vehicles: list[str], can: int, **more: Any) -> None:
            await one.send(seen | {"announces": vehicles} | more)
            state = await there.state(lambda state: state["reach"]["can"] == can)
            assert (state["reach"]["pages"], state["control"]["holder"]) == ([], None)

        await hearing(["serval", "jaguar", "ocelot"], 1)
        await hearing([], 0)
        await hearing(["serval"], 1)
        await hearing(["serval"], 0, sound="asks")
        await hearing(["serval"], 1)
        assert (await one.ask(kind="announces", visible=True, sound="ready"))["ok"] is False  # the server's own message
        await one.send(seen | {"announces": ["serval"], "leaves": True})
        await there.state(lambda state: state["reach"]["can"] == 0)
        await hearing(["serval"], 1)
        await one.socket.close(code=1001)
        await there.state(lambda state: state["reach"]["can"] == 0, within_s=2.0)  # at once, not when it is 3 s old


@pytest.mark.parametrize("path", ["arm", "disarm", "order", "release", "veto"])
async def test_a_program_names_the_car_where_there_are_several(bridge: RosBridge, other: RosBridge, path: str) -> None:
    body = {"release": {"number": 1}, "veto": {"trigger": "on_speed"}}.get(path)
    async with serving(two(bridge, other)) as base, http_client(base_url=base) as client:
        unnamed = await client.post(f"/api/slow-down/{path}", json=body)
        assert (unnamed.status_code, unnamed.json()["detail"]) == (
            422,
            "This server has several cars: name the one that is meant by ?vehicle= (ocelot, serval).",
        )
        named = await client.post(f"/api/slow-down/{path}", params={"vehicle": "ocelot"}, json=body)
        assert named.status_code in (200, 409)
        if body is not None:  # the body may name it as well
            named = await client.post(f"/api/slow-down/{path}", json={**body, "vehicle": "serval"})
            assert named.status_code == 409
            assert "meant for" not in named.json()["detail"]


@pytest.mark.slow
async def test_a_slide_for_a_car_that_was_renamed_reaches_none() -> None:
    """By the page's address, and by the name on the slide; the car's new name reaches it."""
    async with simulated() as (car, address):
        async with watching(car, address, name="ocelot") as before:
            await before.armed()
        async with watching(car, address, name="lynx") as after:
            await after.armed()
            stale = await after.client.post("/api/slow-down/order", params={"vehicle": "ocelot"})
            assert (stale.status_code, stale.json()["detail"]) == (404, "No vehicle is named ocelot.")
            base = str(after.client.base_url).rstrip("/")
            with pytest.raises(websockets.InvalidStatus):
                async with viewer(base, vehicle="ocelot"):
                    pass
            async with viewer(base) as page:
                refused = await page.ask(kind="slow_down", vehicle="ocelot")
                assert refused["reason"] == "This was meant for ocelot, and this is lynx: nothing was sent to either."
                assert (await after.slow())["state"] == "armed"
                assert after.speeds == []
                assert (await page.ask(kind="slow_down", vehicle="lynx"))["ok"]
                await after.until(lambda state: state["decelerate"]["state"] in ("ordered", "holding"))


async def test_exported_events_name_their_car_where_there_are_several(bridge: RosBridge, other: RosBridge) -> None:
    async with serving(two(bridge, other)) as base, http_client(base_url=base) as client:
        for car in ("ocelot", "serval"):
            answer = await client.post("/api/slow-down/order", params={"vehicle": car})
            assert answer.status_code == 409
            assert (await client.post("/api/record", params={"vehicle": car}, json={"on": False})).status_code < 500
        rows = []
        for car in ("ocelot", "serval"):
            text = (await client.get("/api/log.csv", params={"vehicle": car})).text
            found = list(csv.DictReader(text.splitlines()))
            assert found
            assert {row["vehicle"] for row in found} == {car}
            rows += (await client.get("/api/log.json", params={"vehicle": car})).json()
        assert {row["vehicle"] for row in rows} == {"ocelot", "serval"}


async def test_the_servers_log_names_the_car_that_a_line_is_about(
    bridge: RosBridge, other: RosBridge, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[str] = []

    def fail(self: CommandHandler, message: Mapping[str, Any]) -> None:
        lines.append(with_context(f"{self._vehicle} failed"))

    monkeypatch.setattr(CommandHandler, "_query", fail)
    async with serving(two(bridge, other)) as base, http_client(base_url=base) as client:
        for car in ("ocelot", "serval"):
            await client.post("/api/slow-down/order", params={"vehicle": car})
    assert [line.split(" trace=")[0] for line in lines if line.startswith(("ocelot", "serval"))] == [
        "ocelot failed vehicle=ocelot", "serval failed vehicle=serval",
    ]  # fmt: skip

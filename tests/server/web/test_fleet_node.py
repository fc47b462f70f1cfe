"""The page of all cars at web nodes: whole servers, a real broker, and an agent that comes and goes."""

from __future__ import annotations

from typing import Any

from server.app.config import Config
from server.bus.broker import Broker
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.server.bus.broker import running_broker
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import Viewer
from tests.server.web.test_cars import cars
from tests.server.web.test_fleet_socket import holder, item, logged, operator

SOON_S = 20.0


def trouble(one: Viewer) -> list[Any]:
    return [car["trouble"] for car in cars(one)]


async def test_two_rooms_one_car_and_each_part_that_is_lost_is_named(bridge: RosBridge) -> None:
    async with running_broker() as broker, driving(bridge, speed=lambda _: 30.0):
        at = Broker(address=broker.address)
        room = Config(broker=at, is_node=True, expected=("ocelot",))
        agent = Config(broker=at, vehicles=(Vehicle(name="ocelot", address=bridge.address),))  # type: ignore[attr-defined]
        async with (
            serving(room) as north,
            serving(room) as south,
            operator(north, "Ann") as ann,
            operator(south, "Ben") as ben,
        ):
            await ann.until(lambda: trouble(ann) == ["The agent of ocelot has sent nothing since the server started."])
            gone = await ann.ask(kind="take_item", vehicle="ocelot")
            assert gone["reason"] == "Not delivered: the agent of ocelot has sent nothing since the server started."
            async with serving(agent):
                await ann.until(lambda: (item(ann, "ocelot") or {}).get("escalates_ms"), SOON_S)
                assert trouble(ann) == [None]
                assert (await ann.ask(kind="take_item", vehicle="ocelot"))["ok"]
                await ben.until(lambda: holder(ben, "ocelot") == "Ann", SOON_S)
                assert (await ben.ask(kind="take_item", vehicle="ocelot"))["ok"] is False
                assert (await ben.ask(kind="take_item", vehicle="ocelot", over=True))["ok"]
                await ann.until(lambda: holder(ann, "ocelot") == "Ben", SOON_S)
                await ann.until(lambda: len(logged(ann)) >= 2, SOON_S)
                assert logged(ann) == [
                    ("ocelot", "Assigned to Ann.", "Ann"),
                    ("ocelot", "Assigned to Ben, who took it over from Ann.", "Ben"),
                ]
                assert (ann.states, ben.states) == ([], [])
            await ann.until(lambda: "agent of ocelot" in str(trouble(ann)) and cars(ann)[0]["summary"] is None, SOON_S)
            await broker.kill()
            lost = "The broker between the server and the car does not answer."
            await ann.until(lambda: trouble(ann) == [lost], SOON_S)
            lost = "Not delivered: the broker between the server and the car does not answer."
            assert (await ann.ask(kind="take_item", vehicle="ocelot"))["reason"] == lost

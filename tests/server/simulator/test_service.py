"""The simulated car behind its bridge, as clients on real sockets find it."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from server.judge.message import RosVersion
from server.rosbridge_server.server import CannotListen
from server.simulator.messages import PUBLISHED
from server.simulator.scenarios import SCENARIOS, UnknownScenario
from server.simulator.service import SCENARIO_SERVICE, STATE_SERVICE, CarService, serve_car
from tests.server.simulator.conftest import PATIENCE_S, bridge_client, running_car, until

pytestmark = pytest.mark.virtual_time
Car = tuple[CarService, int]
BRAKE, ACCELERATOR = "/catvehicle/brake", "/catvehicle/accelerator"


def is_down(message: Any) -> bool:
    return bool(message["force"]["x"] >= 10.0)


async def running(client: Any) -> set[str]:
    answer = await client.call(STATE_SERVICE)
    return {row["name"] for row in answer["values"]["scenarios"] if row["state"] == "running"}


@pytest.mark.parametrize("ros_version", [1, 2])
async def test_the_bridge_offers_every_topic_of_the_car(ros_version: RosVersion) -> None:
    async with running_car(ros_version=ros_version) as (_, port), bridge_client(port) as client:
        values = (await client.call("/rosapi/topics"))["values"]
        found = dict(zip(values["topics"], values["types"], strict=True))
        expected = {published.topic: published.ros_type(ros_version) for published in PUBLISHED}
        # players tell ROS 2 by the type of /rosout
        log = "rosgraph_msgs/Log" if ros_version == 1 else "rcl_interfaces/msg/Log"
        assert found == {"/rosout": log, **expected}


async def test_every_topic_speaks_at_its_rate(car: Car) -> None:
    _, port = car
    async with bridge_client(port) as client:
        await client.subscribe(*(published.topic for published in PUBLISHED))
        await client.next("/catvehicle/vel")
        counts: Counter[str] = Counter()
        until_s = time.monotonic() + 2.0
        while time.monotonic() < until_s:
            counts[(await client.receive())["topic"]] += 1
    assert counts["/catvehicle/front_laser_points"] == pytest.approx(150, abs=2)
    assert counts["/catvehicle/vel"] == pytest.approx(40, abs=1)
    assert counts["/gps_fix"] == pytest.approx(20, abs=1)
    assert len(counts) == len(PUBLISHED)


async def test_beams_without_a_return_are_null_on_the_wire(car: Car) -> None:
    _, port = car
    async with bridge_client(port) as client:
        await client.subscribe("/catvehicle/front_laser_points")
        ranges = (await client.next("/catvehicle/front_laser_points"))["ranges"]
        assert len(ranges) in (180, 181)
        assert None in ranges
        assert all(0 <= distance <= 81 for distance in ranges if distance is not None)


async def test_the_cars_clock_is_that_of_the_machine(car: Car) -> None:
    service, port = car
    async with bridge_client(port) as client:
        await client.subscribe("/gps_fix")
        stamp = (await client.next("/gps_fix"))["header"]["stamp"]
        assert stamp["secs"] + stamp["nsecs"] * 1e-9 == pytest.approx(time.time(), abs=0.05)
        answer = (await client.call("/rosapi/get_time"))["values"]["time"]
        assert answer["secs"] + answer["nsecs"] * 1e-9 == pytest.approx(service.car.now_s, abs=0.02)


async def test_the_cars_clock_is_set_when_it_drives_off_however_long_that_took() -> None:
    now_s = 1_000.0
    service = CarService(clock=lambda: now_s)
    now_s = 1_060.0
    port = await service.start()
    try:
        async with bridge_client(port) as client:
            await client.subscribe("/gps_fix")
            assert (await client.next("/gps_fix"))["header"]["stamp"]["secs"] >= 1_059
    finally:
        await service.stop()


async def test_a_scenario_is_started_and_stopped_by_a_service_while_the_car_drives(car: Car) -> None:
    _, port = car
    async with bridge_client(port) as client:
        await client.subscribe(BRAKE, ACCELERATOR)
        answer = await client.call(SCENARIO_SERVICE, name="pedal-conflict", stop=False)
        assert answer["result"] is True
        assert answer["values"] == {"success": True, "message": "pedal-conflict started"}
        await client.next(BRAKE, is_down)
        await client.next(ACCELERATOR, is_down)
        assert await running(client) == {"pedal-conflict"}
        answer = await client.call(SCENARIO_SERVICE, name="pedal-conflict", stop=True)
        assert answer["values"]["success"] is True
        await client.next(BRAKE, lambda message: not is_down(message))
        assert await running(client) == set()


async def test_a_scenario_started_by_a_service_ends_by_itself(car: Car) -> None:
    _, port = car
    async with bridge_client(port) as client:
        await client.subscribe(BRAKE)
        await client.call(SCENARIO_SERVICE, name="Pedal-Conflict", duration_s=0.5)
        await client.next(BRAKE, is_down)
        await client.next(BRAKE, lambda message: not is_down(message))
        assert await running(client) == set()


async def test_stop_without_a_name_stops_all(car: Car) -> None:
    _, port = car
    async with bridge_client(port) as client:
        for name in ("slow-rate", "diagnostics-error"):
            await client.call(SCENARIO_SERVICE, name=name)
        assert await running(client) == {"slow-rate", "diagnostics-error"}
        answer = await client.call(SCENARIO_SERVICE, stop=True)
        assert answer["values"]["message"] == "all scenarios stopped"
        assert await running(client) == set()


@pytest.mark.parametrize(
    "args",
    [
        {},
        {"name": ""},
        {"name": "nope"},
        {"name": None},
        {"name": ["speeding"]},
        {"name": "speeding", "stop": "yes"},
        {"name": "nope", "stop": True},
        {"name": "speeding", "duration_s": "long"},
        {"name": "speeding", "duration_s": -1},
        {"name": "speeding", "duration_s": 1e12},
        {"name": "speeding", "duration_s": True},
    ],
    ids=str,
)
async def test_a_call_that_makes_no_sense_is_answered_with_a_sentence(car: Car, args: dict[str, Any]) -> None:
    _, port = car
    async with bridge_client(port) as client:
        answer = await client.call(SCENARIO_SERVICE, **args)
        assert answer["result"] is False
        assert str(answer["values"]).endswith(".'")
        assert await running(client) == set()


async def test_the_state_lists_every_scenario_and_the_truth(car: Car) -> None:
    _, port = car
    async with bridge_client(port) as client:
        state = (await client.call(STATE_SERVICE))["values"]
    assert [row["name"] for row in state["scenarios"]] == list(SCENARIOS)
    assert {"sentence", "alarm", "consequences", "duration_s", "state", "left_s"} <= state["scenarios"][0].keys()
    assert state["truth"]["lat_deg"] == pytest.approx(32.23, abs=0.0013)
    assert state["clients"] == 1


async def test_a_plan_is_carried_out() -> None:
    async with running_car(scenarios=["pedal-conflict@0.2+30"]) as (_, port), bridge_client(port) as client:
        await client.subscribe(BRAKE)
        await client.next(BRAKE, is_down)


async def test_a_client_drives_the_car_by_cmd_vel_and_gives_it_back(car: Car) -> None:
    service, port = car
    async with bridge_client(port) as client:
        await client.subscribe("/catvehicle/vel")
        await client.send(op="advertise", topic="/catvehicle/cmd_vel", type="geometry_msgs/Twist")
        await client.next("/catvehicle/vel", lambda message: message["linear"]["x"] > 1.0)
        stop = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
        async with asyncio.timeout(PATIENCE_S):
            while service.car.motion.speed_mps > 0.0:
                await client.send(op="publish", topic="/catvehicle/cmd_vel", msg=stop)
                await client.next("/catvehicle/vel")
        await client.next("/catvehicle/vel", lambda message: message["linear"]["x"] > 0.5)


async def test_a_frozen_bridge_keeps_its_connections_but_says_nothing() -> None:
    async with running_car() as (service, port), bridge_client(port) as client:
        await client.subscribe("/catvehicle/vel")
        await client.next("/catvehicle/vel")
        service.start_scenario("bridge-frozen", 1.2)
        silences = [0.0]
        began_s = time.monotonic()
        while time.monotonic() < began_s + 3.0:
            heard_s = time.monotonic()
            await client.next("/catvehicle/vel")
            silences.append(time.monotonic() - heard_s)
        assert max(silences) == pytest.approx(1.2, abs=0.06)
        await client.call(STATE_SERVICE)


async def test_a_frozen_bridge_is_thawed_by_stop() -> None:
    async with running_car() as (service, port), bridge_client(port) as client:
        await client.subscribe("/catvehicle/vel")
        await client.next("/catvehicle/vel")
        service.start_scenario("bridge-frozen", 1000.0)
        with pytest.raises(TimeoutError):  # what was on its way
            await asyncio.wait_for(client.listen(), 0.3)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(client.receive(), 0.7)
        service.stop_scenario()
        await client.next("/catvehicle/vel")


async def test_a_killed_bridge_drops_everybody_and_comes_back_on_its_port() -> None:
    async with running_car() as (service, port):
        async with bridge_client(port) as client:
            await client.subscribe("/catvehicle/vel")
            await client.next("/catvehicle/vel")
            service.start_scenario("bridge-killed", 1.0)
            began_s = time.monotonic()
            with pytest.raises(ConnectionClosed):
                await client.listen()
            assert time.monotonic() - began_s < 0.05
        with pytest.raises(OSError, match=r"refused|Connect call failed"):
            async with bridge_client(port):
                pass
        async with asyncio.timeout(PATIENCE_S):
            while True:
                try:
                    async with bridge_client(port) as client:
                        await client.subscribe("/catvehicle/vel")
                        await client.next("/catvehicle/vel")
                        break
                except OSError:
                    await asyncio.sleep(0.05)
        assert time.monotonic() - began_s == pytest.approx(1.0, abs=0.15)


async def test_a_killed_bridge_waits_for_its_port_when_somebody_took_it() -> None:
    async with running_car() as (service, port):
        service.start_scenario("bridge-killed", 0.3)
        taker: asyncio.Server | None = None
        async with asyncio.timeout(PATIENCE_S):
            while taker is None:
                try:
                    taker = await asyncio.start_server(lambda reader, writer: writer.close(), "127.0.0.1", port)
                except OSError:
                    await asyncio.sleep(0.01)
            await until(lambda: not service.car.scenarios.bridge_faults)
            taker.close()
            await taker.wait_closed()
            while True:
                try:
                    async with bridge_client(port) as client:
                        await client.call(STATE_SERVICE)
                        return
                except OSError:
                    await asyncio.sleep(0.05)


async def test_a_taken_port_is_said_in_one_sentence(car: Car) -> None:
    _, port = car
    with pytest.raises(CannotListen, match=f"port {port}"):
        await CarService(port=port).start()


async def test_two_cars_live_in_one_process() -> None:
    async with running_car(seed=1) as (_, one), running_car(seed=2) as (_, two):
        assert one != two
        for port in (one, two):
            async with bridge_client(port) as client:
                await client.subscribe("/catvehicle/vel")
                await client.next("/catvehicle/vel")


async def test_a_car_is_served_in_one_call() -> None:
    service, port = await serve_car(scenarios=["slow-rate"])
    try:
        async with bridge_client(port) as client:
            await client.subscribe("/catvehicle/vel")
            await client.next("/catvehicle/vel")
            assert await running(client) == {"slow-rate"}
    finally:
        await service.stop()
        await service.stop()  # twice does no harm


async def test_it_leaves_no_task_behind() -> None:
    before = asyncio.all_tasks()
    async with running_car() as (_, port), bridge_client(port) as client:
        await client.call(STATE_SERVICE)
    assert asyncio.all_tasks() <= before


async def test_a_faster_rate_makes_a_faster_car() -> None:
    async with running_car(rate=5.0) as (service, _):
        began_s = time.monotonic()
        await until(lambda: service.car.elapsed_s >= 5.0)
        assert time.monotonic() - began_s == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("options", [{"rate": 0.0}, {"rate": -1.0}, {"rate": 1e9}, {"scan_beams": 1}], ids=str)
def test_options_out_of_range_are_refused_with_a_sentence(options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"\.$"):
        CarService(**options)


def test_a_plan_that_cannot_be_read_is_refused() -> None:
    with pytest.raises(UnknownScenario, match="nope"):
        CarService(scenarios=["nope"])

"""A speed that is zero while the car moves, live: the choice moves during the drive, with the reason."""

from __future__ import annotations

import pytest

from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import twist
from tests.server.vehicle.test_compared_cars import fix
from tests.server.vehicle.test_sources import car, odometry
from tests.server.viewer import viewer

ODOM, TWIST, FLOAT, FIX = "nav_msgs/Odometry", "geometry_msgs/Twist", "std_msgs/Float64", "sensor_msgs/NavSatFix"
STANDS_S = 6.0


@pytest.mark.virtual_time
@pytest.mark.parametrize("other", ["/odom", "/speed"])
async def test_the_choice_moves_to_what_moves_once_the_car_does(other: str) -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        mps = 4.0 if at_s > STANDS_S else 0.0
        bridge.publish("/vel", twist(0.0))
        if other == "/odom":
            bridge.publish("/odom", odometry(4.0 * max(0.0, at_s - STANDS_S), mps))
        else:
            bridge.publish("/speed", {"data": mps})

    kinds = {"/odom": ODOM, "/speed": FLOAT}
    async with car({"/vel": TWIST, other: kinds[other]}, publish) as (_, base), viewer(base) as one:
        state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        assert state["signals"]["speed"]["topic"] == "/vel"
        state = await one.state(lambda s: s["signals"]["speed"]["topic"] == other)
        state = await one.state(lambda s: (s["signals"]["speed"]["value"] or {}).get("speed_mps") == 4.0)
        async with http_client() as http:
            offers = (await http.get(f"{base}/api/signals")).json()["candidates"]["speed"]
        (why,) = [offer["why"] for offer in offers if offer["topic"] == "/vel"]
        assert why.startswith(f"its twist is zero while {other} moves")
        assert not any(alarm["id"] == "speed_sources" for alarm in state["alarms"])


@pytest.mark.virtual_time
async def test_a_receiver_that_is_dead_from_the_start_is_an_alarm_and_leaves_with_the_choice() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/odom", odometry(0.0, 0.0))
        bridge.publish("/gps/filtered", fix(0.0, at_s))

    topics = {"/odom": ODOM, "/gps/filtered": FIX, "/receiver/fix": FIX}
    async with car(topics, publish) as (_, base), viewer(base) as one:
        await one.ask(kind="set", topics={"position": "/gps/filtered"})
        state = await one.state(lambda s: any(alarm["id"] == "position_receiver" for alarm in s["alarms"]), within_s=60)
        (alarm,) = [alarm for alarm in state["alarms"] if alarm["id"] == "position_receiver"]
        assert "Nothing from /receiver/fix for" in str(alarm)

"""A speed that is zero while the car moves, live: the choice moves during the drive, with the reason."""

from __future__ import annotations

import asyncio
from pathlib import Path

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


@pytest.mark.virtual_time
@pytest.mark.parametrize(
    ("topic", "kind", "is_picked", "is_recorded"),
    [
        ("/vel", TWIST, True, True),
        ("/vel", TWIST, False, False),
        ("/speed", FLOAT, True, False),
        ("/speed", FLOAT, False, True),
    ],
)
async def test_a_speed_that_was_refused_is_taken_once_it_is_filled(
    tmp_path: Path, topic: str, kind: str, is_picked: bool, is_recorded: bool
) -> None:
    """Beside an odometry, where the operator chose it; beside poses that go far, where nobody did."""
    filled: list[bool] = []
    other, mps = ("/odom", 4.0) if is_picked else ("/lio/odom", 20.0)

    def publish(bridge: RosBridge, at_s: float) -> None:
        shown = mps if filled else 0.0
        bridge.publish(topic, twist(shown) if kind == TWIST else {"data": shown})
        bridge.publish(other, odometry(mps * max(0.0, at_s - STANDS_S), mps if is_picked and at_s > STANDS_S else 0.0))

    data = tmp_path if is_recorded else None
    async with car({topic: kind, other: ODOM}, publish, data=data) as (_, base), viewer(base) as one:
        await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        if is_picked:
            await one.ask(kind="set", topics={"speed": topic})
        state = await one.state(lambda s: "no speed" in (s["signals"]["speed"]["note"] or ""), within_s=60.0)
        assert (state["signals"]["speed"]["topic"], state["questions"]) == (None, [])
        assert state["recording"]["state"] == ("recording" if is_recorded else "off")
        await asyncio.sleep(20.0)
        filled.append(True)
        state = await one.state(lambda s: s["signals"]["speed"]["topic"] == topic)
        state = await one.state(lambda s: (s["signals"]["speed"]["value"] or {}).get("speed_mps") == mps)

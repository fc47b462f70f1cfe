"""Live cars whose sources of speed and position contradict each other, and one whose sources agree."""

from __future__ import annotations

from typing import Any

import pytest

from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import twist
from tests.server.vehicle.test_sources import car, odometry
from tests.server.viewer import Viewer, viewer

TWIST, FIX, ODOM = "geometry_msgs/Twist", "sensor_msgs/NavSatFix", "nav_msgs/Odometry"
M_PER_DEG = 111_195.0
NOWHERE = {"lat_deg": 0.0}
BEGINS_S, MPS2, MPS = 8.0, 1.0, 6.0  # when the car starts, how fast it gains speed, and its speed then


def driven(at_s: float) -> tuple[float, float]:
    """The way and the speed of a car that starts."""
    gains_s = MPS / MPS2
    since_s = max(0.0, at_s - BEGINS_S)
    if since_s < gains_s:
        return MPS2 * since_s**2 / 2, MPS2 * since_s
    return MPS * (since_s - gains_s / 2), MPS


def fix(way_m: float, at_s: float, *, status: int = 0) -> dict[str, Any]:
    """A fix of a receiver with an error of 0.5 m, so far north."""
    secs = 1_800_000_000 + int(at_s)
    stamp = {"secs": secs, "nsecs": int(at_s % 1.0 * 1e9)}
    return {
        "header": {"seq": 1, "stamp": stamp, "frame_id": "gps"},
        "status": {"status": status, "service": 1},
        "latitude": 32.0 + way_m / M_PER_DEG,
        "longitude": -110.0,
        "altitude": 700.0,
        "position_covariance": [0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0],
        "position_covariance_type": 2,
    }


async def raised(one: Viewer, alarm_id: str) -> dict[str, Any]:
    """The first state in which an alarm is active."""
    return await one.state(lambda s: alarm_id in ids(s), within_s=40.0)


def ids(state: dict[str, Any]) -> set[str]:
    return {alarm["id"] for alarm in state["alarms"]}


@pytest.mark.virtual_time
async def test_wheels_that_are_stuck_at_zero_contradict_the_position() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        bridge.publish("/vel", twist(0.0))
        bridge.publish("/gps/fix", fix(driven(at_s)[0], at_s))

    async with car({"/vel": TWIST, "/gps/fix": FIX}, publish, 10.0) as (_, base):
        async with viewer(base) as one, http_client() as http:
            state = await raised(one, "speed_sources")
            assert not ids(state) & {"gps_jump", "gps_drift"}
            found = (await http.get(f"{base}/api/checks/speed_sources")).json()
            assert found["verdict"] == "fault"
            assert found["text"].startswith("Speed 0.0 m/s by /vel, but ")


@pytest.mark.virtual_time
async def test_a_position_that_goes_on_without_its_receiver_is_named() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        way_m, mps = driven(at_s)
        bridge.publish("/vel", twist(mps))
        bridge.publish("/gps/filtered", fix(way_m, at_s))
        bridge.publish("/gps/fix", fix(way_m, at_s, status=0 if at_s < 20.0 else -1))

    async with car({"/vel": TWIST, "/gps/filtered": FIX, "/gps/fix": FIX}, publish, 10.0) as (_, base):
        async with viewer(base) as one, http_client() as http:
            await one.state(lambda s: s["signals"]["position"]["freshness"] == "fresh")
            await one.ask(kind="set", topics={"position": "/gps/filtered"})
            state = await raised(one, "position_receiver")
            assert state["signals"]["position"]["topic"] == "/gps/filtered"
            assert state["signals"]["position"]["freshness"] == "fresh"
            found = (await http.get(f"{base}/api/checks/position_receiver")).json()
            expected = "No fix at /gps/fix; the position of /gps/filtered continues without it"
            assert (found["verdict"], found["text"]) == ("fault", expected)
            assert not ids(state) & {"speed_sources", "position_sources", "gps_jump", "gps_drift"}


@pytest.mark.virtual_time
async def test_sources_that_agree_raise_nothing_and_an_empty_twist_is_none() -> None:
    def publish(bridge: RosBridge, at_s: float) -> None:
        way_m, mps = driven(at_s)
        bridge.publish("/vel", twist(mps))
        bridge.publish("/gps/fix", fix(way_m, at_s))
        bridge.publish("/odom", odometry(way_m, mps))
        bridge.publish("/lio/odom", odometry(way_m, 0.0))  # its twist is never filled

    topics = {"/vel": TWIST, "/gps/fix": FIX, "/odom": ODOM, "/lio/odom": ODOM}
    async with car(topics, publish, 10.0) as (_, base):
        async with viewer(base) as one, http_client() as http:
            far_deg = 32.0 + 60.0 / M_PER_DEG
            state = await one.state(lambda s: (s["signals"]["position"]["value"] or NOWHERE)["lat_deg"] > far_deg, 40.0)
            assert not ids(state) & {"speed_sources", "position_sources", "position_receiver", "gps_jump", "gps_drift"}
            found = (await http.get(f"{base}/api/checks/speed_sources")).json()
            assert found["verdict"] == "ok"
            assert "/lio/odom" in found["text"]
            assert "by /lio/odom" not in found["text"]

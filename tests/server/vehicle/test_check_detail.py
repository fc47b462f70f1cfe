"""What a page gets that opens a check: the finding, its minute, its thresholds, what would make it checked."""

from __future__ import annotations

import asyncio
from typing import Any

import orjson

from monitor.runner import Monitor
from monitor.trends import STEP_S, CheckMinute
from monitor.values import Twist
from server.protocol.alarm_state import CheckAnswer
from server.rosbridge_server.server import RosBridge
from server.vehicle.queries import check_answer
from tests.frames import check_shape
from tests.http import http_client
from tests.monitor.checks.known import known
from tests.server.cars import driving
from tests.server.viewer import viewer


def twist(speed_mps: float) -> Twist:
    return Twist(speed_mps=speed_mps, yaw_rate_radps=0.0)


def driven(*speeds: float | None) -> tuple[Monitor, CheckMinute, float]:
    """A monitor after a step for each speed; None: no speed was known."""
    monitor, minute, now_s = Monitor(), CheckMinute(), 100.05
    for speed_mps in speeds:
        now_s += STEP_S
        monitor.step(known(now_s, speed=None if speed_mps is None else twist(speed_mps)))
        minute.note(monitor.findings, now_s)
    return monitor, minute, now_s


def answer(name: str, *speeds: float | None) -> Any:
    monitor, minute, now_s = driven(*speeds)
    return check_answer(monitor, name, now_s + 1.0, minute)


def test_a_fault_with_its_numbers_and_its_minute() -> None:
    found = answer("speed_limit", 4.0, None, 12.6, 12.6)
    check_shape(orjson.dumps(found), CheckAnswer)
    assert (found["verdict"], found["measured"]["value"], found["limit"]["value"]) == ("fault", 12.6, 11.0)
    assert found["minute"] == {"step_s": STEP_S, "values": [4.0, None, 12.6, 12.6], "limits": [11.0, None, 11.0, 11.0]}
    assert found["for_s"] == 1.2
    assert found["settings"] == ["speed_limit.max_mps", "speed_limit.deadband_mps"]
    assert found["ends"] == {"side": "below", "value": 10.5, "unit": "m/s"}
    assert (found["signal"], found["delays"]["on_s"]) == ("speed", 0.3)


def test_not_checked_names_why_and_what_it_needs() -> None:
    found = answer("gps_drift", 4.0)
    assert (found["verdict"], found["text"]) == ("unknown", "Position is not published")
    assert found["checked_when"].startswith("Checked at standstill")
    assert found["minute"]["values"] == []
    assert found["ends"] is None


def test_all_checks_of_a_tile_are_named() -> None:
    names = [one["id"] for one in answer("gps_jump", 4.0)["checks"]]
    assert names == ["gps_drift", "gps_jump"]


def test_each_check_of_a_tile_has_the_priority_of_its_own_alarm() -> None:
    """A tile may hold a warning beside a critical alarm: the list of its checks marks each by its own."""
    found = answer("diagnostics_warn", 4.0)["checks"]
    assert {one["id"]: one["priority"] for one in found} == {
        "diagnostics_warn": "advisory",
        "diagnostics_error": "warning",
    }


async def test_over_http(bridge: RosBridge, server: str) -> None:
    async with viewer(server) as one, driving(bridge, speed=lambda n: 4.0), http_client() as http:
        await one.state(lambda s: any(tile["id"] == "speed" and tile["verdict"] == "ok" for tile in s["checks"]), 15)
        async with asyncio.timeout(15):
            while not (found := (await http.get(f"{server}/api/checks/speed_limit")).json())["minute"]["values"]:
                await asyncio.sleep(0.02)  # the first look comes a moment later
        wrong = await http.get(f"{server}/api/checks/nothing")
    check_shape(orjson.dumps(found), CheckAnswer)
    assert found["measured"]["value"] == 4.0
    assert 4.0 in found["minute"]["values"]
    assert (wrong.status_code, wrong.json()["detail"]) == (409, "There is no such check.")

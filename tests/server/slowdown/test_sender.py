"""A car is slowed: by hand and by itself, proven by its own speed, held until it is released."""

from __future__ import annotations

import asyncio
import itertools
import time
from pathlib import Path

import pytest

from monitor.triggers import COUNTDOWN_S
from tests.server.slowdown.conftest import ASK_S, field, simulated, watching

pytestmark = [pytest.mark.slow, pytest.mark.virtual_time]
RATES_KNOWN_S = 7.0  # of the drive: a rate is learned from the first 5 s; what is slow from the beginning is its rate


async def test_it_is_armed_ordered_proven_held_and_released() -> None:
    async with field() as car:
        await car.armed()
        before = await car.slow()
        assert (before["state"], before["topic"], before["type"]) == (
            "armed",
            "/catvehicle/cmd_vel",
            "geometry_msgs/Twist",
        )
        assert before["rivals"] == ["/simulated_car"]
        assert car.speeds == []  # nothing is published to a car before it is ordered
        speed_mps = car.speed_mps
        assert (await car.post("order")).status_code == 200
        ordered = (await car.slow())["order"]
        assert ordered["from_mps"] == pytest.approx(speed_mps, abs=0.3)
        state = await car.until(lambda state: state["decelerate"]["order"]["confirmed"])
        steps = state["decelerate"]["order"]["steps"]
        assert steps["server_ms"] <= steps["bridge_ms"] <= steps["slows_ms"] <= steps["server_ms"] + 1600
        await car.until(lambda state: state["decelerate"]["state"] == "holding")
        await car.until_car(lambda: car.speed_mps == 0.0)
        slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in zip(car.speeds[:-1:20], car.speeds[20::20], strict=False)]
        assert slopes[0] == pytest.approx(-1.5, abs=0.001)
        angles = {
            round(message["angular"]["z"], 6) for _, topic, message in car.published if topic == "/catvehicle/cmd_vel"
        }
        assert len(angles) == 1  # the wheels are held
        await asyncio.sleep(1.0)
        assert car.speed_mps == 0.0
        number = ordered["number"]
        assert (await car.post("release", number=number + 1)).status_code == 409
        assert (await car.post("release", number=number)).status_code == 200
        sent = len(car.speeds)
        await car.until_car(lambda: car.speed_mps > 1.0)
        assert len(car.speeds) == sent
        assert (await car.slow())["state"] == "armed"
        assert await car.steps() == ["ordered", "sent", "slows", "released"]
        raised = [event["alarm"] for event in await car.events("raised")]
        assert "slow_down_unconfirmed" not in raised


async def test_it_keeps_its_rate() -> None:
    async with field() as car:
        await car.armed()
        await car.post("order")
        await asyncio.sleep(2.98)
        gaps = [b - a for (a, _), (b, _) in itertools.pairwise(car.speeds)]
        assert gaps == pytest.approx([0.05] * 59, abs=0.001)


@pytest.mark.parametrize("body", [None, {"number": 1}])
async def test_what_is_not_armed_or_not_ordered_is_refused(body: dict[str, int] | None) -> None:
    async with field() as car:
        await car.until(lambda state: state["decelerate"]["state"] == "not_armed")
        refused = await car.post("order") if body is None else await car.post("release", **body)
        assert refused.status_code == 409
        assert refused.json()["detail"] == (
            "Slow-down is not armed." if body is None else "The car is not being slowed."
        )
        assert car.speeds == []


async def test_a_rival_is_named_and_the_order_not_confirmed() -> None:
    async with field(gives_way=False) as car:
        await car.armed()
        assert "slow_down_rivals" in [alarm["id"] for alarm in (await car.until(lambda s: s["alarms"]))["alarms"]]
        await car.post("order")
        await car.until(lambda state: state["decelerate"]["order"]["confirmed"] is False, 6.0)
        state = await car.until(lambda state: any(alarm["id"] == "slow_down_unconfirmed" for alarm in state["alarms"]))
        (alarm,) = (alarm for alarm in state["alarms"] if alarm["id"] == "slow_down_unconfirmed")
        assert alarm["priority"] == "critical"
        assert "physical stop" in alarm["text"]
        assert "not_confirmed" in await car.steps()


async def test_what_is_released_while_the_link_is_lost_is_not_taken_up_again() -> None:
    async with field() as car:
        await car.armed()
        await car.post("order")
        await asyncio.sleep(0.3)
        number = (await car.slow())["order"]["number"]
        car.service.start_scenario("bridge-killed", 1.0)
        await car.until(lambda state: state["session"]["phase"] == "lost")
        assert (await car.post("release", number=number)).status_code == 200
        sent = len(car.speeds)
        await car.until(lambda state: state["session"]["phase"] == "monitoring")
        await asyncio.sleep(0.5)
        assert len(car.speeds) == sent


async def test_without_a_link_it_is_refused_and_logged() -> None:
    async with field() as car:
        await car.armed()
        car.service.start_scenario("bridge-killed", 3.0)
        await car.until(lambda state: state["session"]["phase"] == "lost")
        refused = await car.post("order")
        assert refused.status_code == 409
        assert "physical stop" in refused.json()["detail"]
        assert (await car.steps()) == ["refused"]
        await car.until(lambda state: state["session"]["phase"] == "monitoring")
        await asyncio.sleep(0.5)
        assert car.speeds == []  # and it is not ordered later


async def test_a_server_that_is_started_again_goes_on_where_the_order_stood(tmp_path: Path) -> None:
    async with simulated() as (service, address):
        async with watching(service, address, tmp_path) as car:
            await car.armed()
            await car.post("order")
            await asyncio.sleep(0.5)
            number = (await car.slow())["order"]["number"]
        async with watching(service, address, tmp_path) as car:
            state = await car.until(lambda state: (state["decelerate"]["order"] or {}).get("sending"))
            assert state["decelerate"]["order"]["number"] > number
            await car.until_car(lambda: car.speed_mps == 0.0)
            assert "resumed" in await car.steps()
            assert (await car.post("release", number=state["decelerate"]["order"]["number"])).status_code == 200


async def test_what_was_released_before_the_restart_stays_released(tmp_path: Path) -> None:
    async with simulated() as (service, address):
        async with watching(service, address, tmp_path) as car:
            await car.armed()
            await car.post("order")
            await car.post("release", number=(await car.slow())["order"]["number"])
        async with watching(service, address, tmp_path) as car:
            await car.until(lambda state: state["decelerate"]["state"] == "not_armed")
            await asyncio.sleep(0.5)
            assert (await car.slow())["order"] is None
            assert car.speeds == []


SPEEDING = {"slow_down.on_speed": 1.0, "slow_down.on_speed_after_s": 0.5, "speed_limit.max_mps": 2.0}


async def test_a_rule_counts_down_and_may_be_vetoed() -> None:
    async with field() as car:
        await car.armed()
        await car.set(SPEEDING)
        await car.until(lambda state: state["decelerate"]["countdown"])
        assert (await car.post("veto", trigger="speed")).status_code == 200
        await asyncio.sleep(2.5)
        assert car.speeds == []
        assert (await car.post("veto", trigger="speed")).status_code == 409


@pytest.mark.parametrize(
    ("trigger", "switched_on", "scenario", "why"),
    [
        ("speed", SPEEDING, None, "Speed above limit"),
        ("obstacle", {"slow_down.on_obstacle": 1.0}, "near-object", "Obstacle within the stopping distance"),
        (
            "reach",
            {"slow_down.on_reach": 1.0, "slow_down.on_reach_after_s": 0.5},
            None,
            "No operator's phone reachable",
        ),
        (
            "rate.speed",
            {"slow_down.on_rate_speed": 1.0, "slow_down.on_rate_after_s": 0.2},
            "slow-rate",
            "Speed below its expected rate",
        ),
        ("rate.position", {"slow_down.on_rate_position": 1.0}, "stale-gps", "Position below its expected rate"),
    ],
)
async def test_each_rule_slows_the_car(
    trigger: str, switched_on: dict[str, float], scenario: str | None, why: str
) -> None:
    """Nothing but what is switched on orders anything."""
    async with field() as car:
        await car.armed()
        if scenario is not None:
            known_s = RATES_KNOWN_S if trigger.startswith("rate") else 0.0
            await car.until_car(lambda: car.service.car.elapsed_s >= known_s)
            car.service.start_scenario(scenario, 15.0)
            await asyncio.sleep(1.5)
            assert (await car.slow())["countdown"] is None  # off until somebody switches it on
        await car.set(switched_on)
        state = await car.until(lambda state: state["decelerate"]["countdown"])
        assert state["decelerate"]["countdown"]["trigger"] == trigger
        assert car.speeds == []
        counted_s = time.monotonic()
        state = await car.until(lambda state: state["decelerate"]["order"])
        assert time.monotonic() - counted_s == pytest.approx(COUNTDOWN_S, abs=ASK_S + 0.05)
        assert state["decelerate"]["order"]["why"] == why
        assert (await car.steps())[:3] == ["countdown", "ordered", "sent"]
        began_mps = car.driven[0]
        await car.until_car(lambda: car.speed_mps < began_mps - 1.0)


async def test_a_hold_that_nobody_releases_ends() -> None:
    """With the alarm slow_down_hold_ended: nothing holds the car any more, and that is never a surprise."""
    async with field() as car:
        await car.armed()
        await car.set({"slow_down.longest_s": 10.0})
        await car.post("order")
        state = await car.until(lambda state: state["decelerate"]["order"] is None)
        assert state["decelerate"]["state"] == "armed"
        state = await car.until(lambda s: any(alarm["id"] == "slow_down_hold_ended" for alarm in s["alarms"]))
        assert (await car.steps())[-1] == "ended"
        await car.until_car(lambda: car.speed_mps > 1.0)


async def test_monitoring_that_is_stopped_ends_the_order_and_disarms() -> None:
    async with field() as car:
        await car.armed()
        await car.post("order")
        await asyncio.sleep(0.2)
        assert (await car.client.post("/api/disconnect")).is_success
        sent = len(car.speeds)
        slow = await car.slow()
        assert (slow["state"], slow["order"], slow["armed_by"]) == ("not_available", None, None)
        await asyncio.sleep(0.5)
        assert len(car.speeds) == sent
        assert (await car.steps())[-1] == "ended"

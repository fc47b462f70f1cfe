"""A latched sample that the bridge sends again after a renewed subscription is not new: its age continues."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest

from server.recording.read.read import open_recording
from tests.reports.cases import made
from tests.server.vehicle.keeping_bridge import KeepingBridge, Topic, monitored

pytestmark = [pytest.mark.virtual_time, pytest.mark.slow]

FUEL, SPEED = "/fuel", "/catvehicle/vel"
SHOWN_EVERY_S = 0.5
ROUNDED_S, TRANSPORT_S = 0.1, 0.6  # a message may have waited for as long as pings are apart
BEFORE_S, AFTER_S = 8.0, 60.0  # of the recording: around the levels, and their silence


async def test_the_age_of_a_latched_level_goes_on_and_it_is_recorded_once(tmp_path: Path) -> None:
    bag = made("case_41_latched_then_silent.py") / "41-latched-then-silent" / "tank.bag"
    shown: list[tuple[float, dict[str, Any]]] = []
    fuel_s: list[float] = []  # when each level was published
    with open_recording([bag]) as recording:
        topics = {topic: Topic(info.type, is_latched=topic == FUEL) for topic, info in recording.topics.items()}
        bridge = KeepingBridge(topics)
        async with monitored(bridge, tmp_path) as session:
            began_s, due_s = time.monotonic(), 0.0
            for number, one in enumerate(recording.messages(BEFORE_S)):
                at_s = one.at_s - recording.start_s - BEFORE_S
                if at_s > AFTER_S:
                    break
                if one.topic == SPEED and number % 4:
                    continue  # five a second are enough here
                await asyncio.sleep(began_s + at_s - time.monotonic())
                bridge.publish(one.topic, one.message)
                if one.topic == FUEL:
                    fuel_s.append(time.monotonic())
                elif at_s >= due_s:
                    due_s += SHOWN_EVERY_S
                    shown.append((time.monotonic(), session.frame()["signals"]["fuel"]))  # type: ignore[arg-type]
    assert len(fuel_s) == 3
    renewed = [at_s for at_s, topic in bridge.subscribed if topic == FUEL and at_s > fuel_s[-1]]
    assert 2 <= len(renewed) <= 6, "its subscription is renewed, ever more seldom"
    later = [(at_s - fuel_s[-1], fuel) for at_s, fuel in shown if at_s > fuel_s[-1] + 0.1]
    assert later[-1][0] > 40.0
    for true_s, fuel in later:
        assert true_s - ROUNDED_S <= fuel["age_s"] <= true_s + TRANSPORT_S
        assert fuel["freshness"] == "stale" or true_s <= 10.0
    assert later[-1][1]["note"] == "sent again by the bridge after a renewed subscription: not new"
    (path,) = tmp_path.rglob("*.mcap")
    with open_recording([path]) as recording:
        assert [message["data"] for _, topic, _, message in recording.rows() if topic == FUEL] == [70.0, 69.0, 68.0]

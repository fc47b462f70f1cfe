"""Equal messages without a stamp around our own renewals: what was published is recorded, what is kept once."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from server.vehicle.doubtful import LEAST_ANSWERS, MOST_HELD, Doubtful, Held, answers_needed
from tests.server.vehicle.keeping_bridge import KeepingBridge, Topic, monitored
from tests.world.test_kept_samples import FUEL, SPEED, drive, recorded, topics

pytestmark = [pytest.mark.world(n=27), pytest.mark.virtual_time]

SWITCH = "/lights"  # only recorded


def both(*, is_latched: bool) -> dict[str, Topic]:
    return topics() | {
        SWITCH: Topic("std_msgs/Bool", is_latched=is_latched),
        FUEL: Topic("std_msgs/Float32", is_latched=is_latched),
    }


async def publish_now(bridge: KeepingBridge, topic: str, after_s: float, message: Mapping[str, Any]) -> None:
    await asyncio.sleep(after_s)
    bridge.publish(topic, message)


@pytest.mark.slow
@pytest.mark.parametrize(("topic", "message"), [(SWITCH, {"data": True}), (FUEL, {"data": 60.0})])
@pytest.mark.parametrize("after_s", [0.08, 0.25, 0.7, 4.0])
async def test_an_equal_message_after_a_renewal_is_recorded(
    tmp_path: Path, topic: str, message: dict[str, Any], after_s: float
) -> None:
    """One message, silence, our renewal, and the same again."""
    bridge = KeepingBridge(both(is_latched=False))
    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=4.0)
        bridge.publish(topic, message)
        await drive(bridge, 3.0, hz=4.0)
        bridge.renew(topic)
        again = asyncio.create_task(publish_now(bridge, topic, after_s, message))
        await drive(bridge, after_s + 7.0, hz=4.0)
        await again
    assert recorded(tmp_path, topic) == [[message["data"]] * 2]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
async def test_a_switch_that_is_sent_now_and_then_is_recorded_whole(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    bridge = KeepingBridge(both(is_latched=False))
    sent = 0
    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=4.0)
        for _ in range(25):
            if chance.random() < 0.4:
                bridge.renew(SWITCH)
            await asyncio.sleep(chance.choice((0.06, 0.3, 1.0, 2.5)))
            bridge.publish(SWITCH, {"data": True})
            bridge.publish(SPEED, {"linear": {"x": 3.0 + sent / 10, "y": 0.0, "z": 0.0}})
            sent += 1
    [part] = recorded(tmp_path, SWITCH)
    assert len(part) >= sent


@pytest.mark.slow
async def test_what_is_in_doubt_when_the_recording_ends_is_recorded(tmp_path: Path) -> None:
    bridge = KeepingBridge(both(is_latched=False))
    async with monitored(bridge, tmp_path) as session:
        await drive(bridge, 4.0, hz=4.0)
        bridge.publish(SWITCH, {"data": True})
        await drive(bridge, 3.0, hz=4.0)
        bridge.renew(SWITCH)
        await asyncio.sleep(0.1)
        bridge.publish(SWITCH, {"data": True})
        session._parts.recording.order(False, by="test")
    assert recorded(tmp_path, SWITCH) == [[True, True]]


@pytest.mark.slow
async def test_a_kept_switch_is_recorded_once_and_anew_when_it_is_published_again(tmp_path: Path) -> None:
    bridge = KeepingBridge(both(is_latched=True))
    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=4.0)
        bridge.publish(SWITCH, {"data": True})
        for _ in range(3):
            await drive(bridge, 7.0, hz=4.0)
            bridge.renew(SWITCH)
        await drive(bridge, 7.0, hz=4.0)
        bridge.publish(SWITCH, {"data": True})
        await drive(bridge, 1.0, hz=4.0)
    assert recorded(tmp_path, SWITCH) == [[True, True]]


def held(at_s: float) -> Held:
    return Held({"data": True}, 10, at_s)


def test_a_fast_topic_is_recorded_at_once_and_a_quiet_one_needs_few_answers() -> None:
    assert answers_needed(None, 1.0) == LEAST_ANSWERS
    assert answers_needed(1.0, 20.0) == LEAST_ANSWERS
    assert answers_needed(1.0, 1.0) == 4
    assert answers_needed(0.2, 0.1) is None
    assert answers_needed(0.0, 0.0) is not None  # two at once are no period
    doubtful = Doubtful()
    assert doubtful.came("/a", held(1.0), None).record == (held(1.0),)


def test_without_an_answer_in_time_all_are_recorded() -> None:
    doubtful = Doubtful()
    assert doubtful.came("/a", held(1.0), 2).probes
    assert not list(doubtful.overdue(5.9))
    assert list(doubtful.overdue(6.1)) == [("/a", held(1.0))]
    assert not list(doubtful.overdue(20.0))
    assert doubtful.came("/a", held(21.0), 2).probes
    assert doubtful.came("/a", held(22.0), 2).record == (held(21.0), held(22.0))


def test_what_is_held_is_bounded() -> None:
    doubtful = Doubtful()
    at_once = sum(bool(doubtful.came(f"/{number}", held(1.0), 2).record) for number in range(MOST_HELD + 100))
    assert at_once == 100
    large = Held({"data": True}, 5_000_000, 1.0)
    doubtful = Doubtful()
    assert [bool(doubtful.came(name, large, 2).record) for name in ("/a", "/b")] == [False, True]
    assert list(doubtful.all()) == [("/a", large)]
    assert not doubtful.came("/b", large, 2).record

"""Equal messages without a stamp around our own renewals: what was published is recorded, what is kept once."""

from __future__ import annotations

import asyncio
import random
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from server.recording.delay import recorded_delay
from server.recording.read.read import open_recording
from server.vehicle.doubtful import ANSWERED_WITHIN_S
from tests.server.vehicle.keeping_bridge import KeepingBridge, Topic, monitored
from tests.world.test_kept_samples import FUEL, ROUNDED_S, SPEED, TRANSPORT_S, drive, recorded, signal, topics

pytestmark = [pytest.mark.world(n=27), pytest.mark.virtual_time]

SWITCH = "/lights"  # only recorded
WAITS_S = (0.06, ANSWERED_WITHIN_S + 0.05, 1.0, 2.5)  # none at the limit itself, where rounding of the clock decides


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
            await asyncio.sleep(chance.choice(WAITS_S))
            bridge.publish(SWITCH, {"data": True})
            bridge.publish(SPEED, {"linear": {"x": 3.0 + sent / 10, "y": 0.0, "z": 0.0}})
            sent += 1
    [part] = recorded(tmp_path, SWITCH)
    assert len(part) >= sent


@pytest.mark.slow
@pytest.mark.parametrize(("count", "gap_s"), [(2, 0.25), (3, 0.1), (3, 0.25), (4, 0.02), (7, 0.25)])
async def test_equal_messages_in_a_row_right_after_a_renewal_are_recorded(
    tmp_path: Path, count: int, gap_s: float
) -> None:
    """Each comes as soon as an answer would, and then nothing more."""
    bridge = KeepingBridge(both(is_latched=False))
    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=4.0)
        bridge.publish(SWITCH, {"data": True})
        await drive(bridge, 3.0, hz=4.0)
        bridge.renew(SWITCH)
        for _ in range(count):
            await asyncio.sleep(gap_s)
            bridge.publish(SWITCH, {"data": True})
        await drive(bridge, 9.0, hz=4.0)
    assert recorded(tmp_path, SWITCH) == [[True] * (count + 1)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
async def test_a_switch_that_is_sent_in_bursts_is_recorded_whole(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    bridge = KeepingBridge(both(is_latched=False))
    sent = 0
    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=4.0)
        for _ in range(15):
            bridge.renew(SWITCH)
            for _ in range(chance.randint(1, 6)):
                await asyncio.sleep(chance.choice((0.02, 0.06, 0.21)))
                bridge.publish(SWITCH, {"data": True})
                sent += 1
            await drive(bridge, chance.choice((0.65, 1.3, 2.2, 6.5)), hz=4.0)
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


def late(folder: Path, topic: str) -> list[tuple[float, float]]:
    """When each message of a topic was recorded, since the first one, and how old it was then [s]."""
    [path] = folder.rglob("*.mcap")
    with open_recording([path]) as recording:
        delay = recorded_delay(recording)
        assert delay is not None
        times = [at_s - recording.start_s for at_s, name, _, _ in recording.rows() if name == topic]
        return [(at_s - times[0], delay.receive(topic, at_s)) for at_s in times]


@pytest.mark.slow
@pytest.mark.parametrize("silent_s", [0.3, 1.0, 5.5])
async def test_a_constant_topic_that_goes_on_after_a_silence_is_recorded_whole(tmp_path: Path, silent_s: float) -> None:
    """A parked car: what is published has the rhythm of answers."""
    bridge = KeepingBridge(both(is_latched=False))
    sent = 0

    def each() -> None:
        nonlocal sent
        sent += 1
        bridge.publish(SWITCH, {"data": True})

    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=20.0)
        await drive(bridge, 3.0, each, hz=20.0)
        for _ in range(3):
            await drive(bridge, silent_s, hz=20.0)
            bridge.renew(SWITCH)
            await drive(bridge, 7.0, each, hz=20.0)
            bridge.renew(SWITCH)
            await drive(bridge, 1.0, each, hz=20.0)
    assert recorded(tmp_path, SWITCH) == [[True] * sent]


@pytest.mark.slow
async def test_over_a_slow_link_a_kept_sample_is_recorded_once(tmp_path: Path) -> None:
    bridge = KeepingBridge(both(is_latched=True))
    bridge.trip_s = 0.8
    async with monitored(bridge, tmp_path):
        await drive(bridge, 6.0, hz=4.0)
        bridge.publish(FUEL, {"data": 60.0})
        for _ in range(2):
            await drive(bridge, 9.0, hz=4.0)
            bridge.renew(FUEL)
        await drive(bridge, 16.0, hz=4.0)
    assert recorded(tmp_path, FUEL) == [[60.0]]


@pytest.mark.slow
async def test_what_is_recorded_late_is_as_old_as_it_is_shown_and_the_next_one_is_new(tmp_path: Path) -> None:
    bridge = KeepingBridge(both(is_latched=False))
    async with monitored(bridge, tmp_path) as session:
        await drive(bridge, 4.0, hz=4.0)
        published_s = time.monotonic()
        for topic, value in ((SWITCH, True), (FUEL, 60.0)):
            bridge.publish(topic, {"data": value})
        await drive(bridge, 3.0, hz=4.0)
        for topic, value in ((SWITCH, True), (FUEL, 60.0)):
            bridge.renew(topic)
            bridge.publish(topic, {"data": value})
        await drive(bridge, 6.0, hz=4.0)
        shown_s, true_s = signal(session, "fuel")["age_s"], time.monotonic() - published_s
        await asyncio.sleep(0.1)  # what is new comes between two ticks: at the moment of one the order is by chance
        for topic, value in ((SWITCH, False), (FUEL, 50.0)):
            bridge.publish(topic, {"data": value})
        await drive(bridge, 1.0, hz=4.0)
    for topic in (SWITCH, FUEL):
        [_, (at_s, old_s), (_, new_s)] = late(tmp_path, topic)
        assert old_s == pytest.approx(at_s, abs=0.2)
        assert new_s < 0.2
    assert true_s - ROUNDED_S <= shown_s <= true_s + TRANSPORT_S


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [0.02, 0.15, 0.4])
async def test_what_comes_while_a_doubt_is_settled_is_not_missed(tmp_path: Path, after_s: float) -> None:
    """On a real bridge a topic whose only subscription ended needs time to find its publishers again."""
    bridge = KeepingBridge(both(is_latched=False))
    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=4.0)
        bridge.publish(SWITCH, {"data": True})
        await drive(bridge, 3.0, hz=4.0)
        bridge.renew(SWITCH)
        bridge.connects_s = 0.3
        again = asyncio.create_task(publish_now(bridge, SWITCH, 0.1, {"data": True}))
        new = asyncio.create_task(publish_now(bridge, SWITCH, 0.1 + after_s, {"data": False}))
        await drive(bridge, 8.0, hz=4.0)
        await asyncio.gather(again, new)
    assert recorded(tmp_path, SWITCH) == [[True, True, False]]

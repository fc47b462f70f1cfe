"""Stories of a car behind a bridge that keeps samples: their age continues, and each is recorded once in a part."""

from __future__ import annotations

import asyncio
import random
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from server.recording.read.read import open_recording
from server.vehicle.session import Session
from server.vehicle.undelivered import CLIENT_COUNT
from tests.server.vehicle.keeping_bridge import KeepingBridge, Topic, monitored
from tests.world.test_sent_again import stamped

pytestmark = [pytest.mark.world(n=27), pytest.mark.virtual_time, pytest.mark.slow]

FUEL, SPEED, FIX, MAP = "/fuel", "/catvehicle/vel", "/fix", "/map_name"
TICK_S = 0.1
ROUNDED_S = 0.15  # a state is of the moment, and a bridge gives a sample 0.05 s after the subscription
TRANSPORT_S = 0.6  # what the first message of a connection may have waited at most: pings come every 0.5 s


def topics() -> dict[str, Topic]:
    return {
        SPEED: Topic("geometry_msgs/Twist"),
        FUEL: Topic("std_msgs/Float32", is_latched=True),
        MAP: Topic("std_msgs/String", is_latched=True),
        CLIENT_COUNT: Topic("std_msgs/Int32"),
    }


def twist(speed_mps: float) -> dict[str, Any]:
    zeros = {"x": 0.0, "y": 0.0, "z": 0.0}
    return {"linear": zeros | {"x": speed_mps}, "angular": zeros}


def signal(session: Session, name: str) -> dict[str, Any]:
    found: dict[str, Any] = session.frame()["signals"][name]  # type: ignore[assignment]
    return found


async def drive(
    bridge: KeepingBridge, for_s: float, each: Callable[[], None] = lambda: None, *, hz: float = 10.0
) -> None:
    """The car publishes its speed; `each` is called after each message."""
    ends_s, number = time.monotonic() + for_s, 0
    while time.monotonic() < ends_s:
        bridge.publish(SPEED, twist(3.0 + number % 7 / 10))
        each()
        number += 1
        await asyncio.sleep(1 / hz)


async def test_after_an_outage_the_sample_that_comes_again_is_as_old_as_it_is() -> None:
    bridge = KeepingBridge(topics())
    async with monitored(bridge) as session:
        await drive(bridge, 4.0)
        bridge.publish(FUEL, {"data": 60.0})
        published_s = time.monotonic()
        await drive(bridge, 4.0)
        bridge.close()
        await asyncio.sleep(6.0)
        bridge.open()
        seen: list[tuple[float, dict[str, Any]]] = []
        await drive(bridge, 4.0, lambda: seen.append((time.monotonic() - published_s, signal(session, "fuel"))))
        assert session._parts.judgement.reception.repeats >= 1
    assert len(seen) > 30
    for true_s, fuel in seen:
        assert true_s - ROUNDED_S <= fuel["age_s"] <= true_s + TRANSPORT_S
        assert fuel["freshness"] != "fresh" or true_s <= 10.0


async def test_a_new_level_after_an_outage_is_new() -> None:
    bridge = KeepingBridge(topics())
    async with monitored(bridge) as session:
        await drive(bridge, 4.0)
        bridge.publish(FUEL, {"data": 60.0})
        await drive(bridge, 1.0)
        bridge.close()
        bridge.publish(FUEL, {"data": 40.0})
        await asyncio.sleep(3.0)
        bridge.open()
        await drive(bridge, 0.5)
        fuel = signal(session, "fuel")
        assert (fuel["value"], fuel["freshness"]) == ({"value": 40.0, "unit": "%"}, "fresh")


async def test_a_level_that_is_sent_each_second_stays_fresh_through_renewals() -> None:
    """Without a stamp, the first one after a renewal may be the kept one: this costs one period."""
    bridge = KeepingBridge(topics() | {FUEL: Topic("std_msgs/Float32")})
    ages: list[float] = []
    async with monitored(bridge) as session:
        due_s = time.monotonic()

        def each() -> None:
            nonlocal due_s
            if time.monotonic() >= due_s:
                due_s += 1.0
                bridge.publish(FUEL, {"data": 60.0})
            fuel = signal(session, "fuel")
            if fuel["age_s"] is not None:
                ages.append(fuel["age_s"])
                assert fuel["freshness"] != "stale"

        await drive(bridge, 12.0, each)
        for _ in range(3):
            bridge.renew(FUEL)
            await drive(bridge, 4.0, each)
    assert max(ages) <= 2.0 + TRANSPORT_S
    assert sum(age_s < 1.0 + TRANSPORT_S for age_s in ages) > 0.85 * len(ages)


def recorded(folder: Path, topic: str) -> list[list[Any]]:
    """What each part of the recording holds of a topic."""
    parts = []
    for path in sorted(folder.rglob("*.mcap")):
        with open_recording([path]) as recording:
            parts.append([message["data"] for _, name, _, message in recording.rows() if name == topic])
    return parts


async def test_each_part_of_a_recording_holds_the_kept_samples_once(tmp_path: Path) -> None:
    bridge = KeepingBridge(topics())
    async with monitored(bridge, tmp_path) as session:
        await drive(bridge, 4.0)
        bridge.publish(FUEL, {"data": 60.0})
        bridge.publish(MAP, {"data": "yard"})
        await drive(bridge, 2.0)
        for topic in (FUEL, MAP):
            bridge.renew(topic)
        await drive(bridge, 3.0)  # three answers, each after a longer silence, take 2 s
        bridge.close()
        await asyncio.sleep(3.0)
        bridge.open()
        await drive(bridge, 3.0)
        for topic in (FUEL, MAP):
            bridge.renew(topic)
        await drive(bridge, 3.0)
        assert session._parts.judgement.reception.repeats >= 4
    assert recorded(tmp_path, FUEL) == [[60.0], [60.0]]
    assert recorded(tmp_path, MAP) == [["yard"], ["yard"]]


async def test_a_signal_that_gets_its_topic_later_takes_the_kept_sample_at_its_age() -> None:
    bridge = KeepingBridge(topics())
    async with monitored(bridge) as session:
        await drive(bridge, 3.0)
        bridge.publish(FUEL, {"data": 60.0})
        published_s = time.monotonic()
        await drive(bridge, 1.0)
        judgement = session._parts.judgement
        before = session._parts.connection.subscriptions.by_topic[FUEL]
        bridge.renew(FUEL)
        await drive(bridge, 3.0)
        judgement._filled[FUEL] = ()  # as if it had come before any signal was mapped to it
        bridge.renew(FUEL)
        await drive(bridge, 1.0)
        assert judgement._filled[FUEL] == before
        fuel = signal(session, "fuel")
        assert fuel["age_s"] == pytest.approx(time.monotonic() - published_s, abs=ROUNDED_S)
        assert fuel["note"] == "sent again by the bridge after a renewed subscription: not new"


async def test_a_recording_that_is_begun_by_hand_gets_the_kept_samples_of_before(tmp_path: Path) -> None:
    bridge = KeepingBridge(topics())
    async with monitored(bridge, tmp_path) as session:
        await drive(bridge, 2.0)
        session._parts.recording.order(on=False, by="Ann")
        bridge.publish(FUEL, {"data": 60.0})
        published_s = time.monotonic()
        await drive(bridge, 6.0)
        session._parts.recording.order(on=True, by="Ann")
        await drive(bridge, 3.0)
        fuel = signal(session, "fuel")
        assert fuel["age_s"] >= time.monotonic() - published_s - ROUNDED_S
    assert recorded(tmp_path, FUEL)[-1] == [60.0]


async def test_a_sample_that_another_part_holds_keeps_its_age_there(tmp_path: Path) -> None:
    bridge = KeepingBridge(topics())
    async with monitored(bridge, tmp_path):
        await drive(bridge, 3.0)
        bridge.publish(FUEL, {"data": 60.0})
        published_s = time.time()
        await drive(bridge, 2.0)
        bridge.close()
        await asyncio.sleep(12.0)
        bridge.open()
        await drive(bridge, 3.0)
    with open_recording([sorted(tmp_path.rglob("*.mcap"))[1]]) as recording:
        ages = [row["delays"][FUEL] for _, row in recording.own("/catgraph/delay") if FUEL in row["delays"]]
        given_s = next(at_s for at_s, topic, _, _ in recording.rows() if topic == FUEL)
    assert ages == [pytest.approx(given_s - published_s, abs=ROUNDED_S)]


# -- a sample that was there before us -------------------------------------------------------------------------------


async def late(bridge: KeepingBridge, topic: str, message: Callable[[], dict[str, Any]], old_s: float) -> None:
    """The topic's only message is published, and becomes old before anybody listens."""
    bridge.publish(topic, message())
    await asyncio.sleep(old_s)


def fix(stamp_s: float) -> dict[str, Any]:
    status = {"status": 0, "service": 1}
    place = {"latitude": 48.2, "longitude": 11.5, "altitude": 520.0}
    return (
        stamped(0.0, stamp_s)
        | place
        | {"status": status, "position_covariance": [0.1] * 9}
        | {"position_covariance_type": 2}
    )


async def test_a_latched_sample_of_before_shows_the_age_of_its_stamp() -> None:
    bridge = KeepingBridge(topics() | {FIX: Topic("sensor_msgs/NavSatFix", is_latched=True)})
    await late(bridge, FIX, lambda: fix(time.time()), 40.0)
    stamp_s = time.time() - 40.0
    async with monitored(bridge) as session:
        await drive(bridge, 3.0)
        position = signal(session, "position")
        assert position["age_s"] == pytest.approx(time.time() - stamp_s, abs=TRANSPORT_S)
        assert position["freshness"] == "stale"
        assert position["note"] is None
        assert session._parts.judgement.transport.late_s(time.monotonic()) < TRANSPORT_S, "the link is not late by it"


async def test_where_stamps_are_of_another_clock_the_age_of_an_only_message_is_not_known() -> None:
    """The other stamps of this car are an hour behind the time of ROS: so may be this one."""
    bridge = KeepingBridge(
        topics() | {SPEED: Topic("geometry_msgs/TwistStamped"), FIX: Topic("sensor_msgs/NavSatFix", is_latched=True)}
    )
    await late(bridge, FIX, lambda: fix(time.time() - 3600.0), 5.0)
    async with monitored(bridge) as session:
        for number in range(40):
            message = stamped(0.0, time.time() - 3600.0) | {"twist": twist(3.0 + number % 7 / 10)}
            bridge.publish(SPEED, message)
            await asyncio.sleep(0.1)
        position = signal(session, "position")
        assert position["age_s"] < 5.0
        assert position["note"] == "one message since connecting: it may be older than its age here"
        assert signal(session, "speed")["freshness"] == "fresh"


async def test_a_sample_without_a_stamp_that_came_alone_is_of_unknown_age_and_reports_it() -> None:
    bridge = KeepingBridge(topics())
    await late(bridge, FUEL, lambda: {"data": 60.0}, 40.0)
    async with monitored(bridge) as session:
        await drive(bridge, 4.0)
        assert signal(session, "fuel")["note"] == "one message since connecting: it may be older than its age here"
        bridge.publish(FUEL, {"data": 59.0})
        await drive(bridge, 3.0)
        assert signal(session, "fuel")["note"] == "published in 0 to 100 %, by its values"


# -- one message with each subscription ------------------------------------------------------------------------------


def subscriptions(bridge: KeepingBridge, topic: str) -> list[float]:
    return [at_s for at_s, name in bridge.subscribed if name == topic]


async def test_a_topic_of_which_one_message_comes_is_renewed_and_the_other_client_is_named() -> None:
    bridge = KeepingBridge(topics(), clients=2)
    bridge.stuck.add(FUEL)
    named_s: list[float] = []
    async with monitored(bridge) as session:
        began_s = time.monotonic()
        number = 0

        def each() -> None:
            nonlocal number
            number += 1
            bridge.publish(FUEL, {"data": float(number % 90)})
            problem = session.frame()["link"]["problem"]
            if problem is not None and problem["code"] == "topics_once":
                assert "/fuel" in problem["title"]
                assert "2 other clients" in problem["hint"]
                named_s.append(time.monotonic() - began_s)

        await drive(bridge, 80.0, each, hz=5.0)
        assert named_s[0] < 25.0
        assert 4 <= len(subscriptions(bridge, FUEL)) <= 8, "renewed, ever more seldom"
        bridge.clients = 0
        bridge.stuck.clear()
        await drive(bridge, 8.0, each, hz=5.0)
        assert signal(session, "fuel")["freshness"] == "fresh"
        assert session.frame()["link"]["problem"] is None


async def test_a_latched_topic_of_one_message_is_not_blamed_on_another_client_and_renewed_ever_more_seldom() -> None:
    bridge = KeepingBridge(topics(), clients=2)
    bridge.publish(FUEL, {"data": 60.0})
    async with monitored(bridge) as session:

        def each() -> None:
            assert session.frame()["link"]["problem"] is None

        await drive(bridge, 150.0, each, hz=2.0)
    renewed = subscriptions(bridge, FUEL)
    assert 2 <= len(renewed) <= 8
    gaps = [later - sooner for sooner, later in pairwise(renewed[1:])]
    assert gaps == sorted(gaps)


async def test_clients_that_come_and_go_renew_nothing_more_often_than_every_five_seconds() -> None:
    bridge = KeepingBridge(topics(), clients=3)
    bridge.stuck.add(FUEL)
    async with monitored(bridge):

        def each() -> None:
            bridge.publish(FUEL, {"data": time.monotonic() % 50})
            bridge.clients = 2 + int(time.monotonic()) % 2

        await drive(bridge, 60.0, each, hz=5.0)
    renewed = subscriptions(bridge, FUEL)
    assert min(later - sooner for sooner, later in pairwise(renewed[1:])) >= 4.9


# -- what is reported of a silent car --------------------------------------------------------------------------------


async def test_a_car_is_not_called_silent_while_its_other_topics_come(tmp_path: Path) -> None:
    bridge = KeepingBridge(topics())
    async with monitored(bridge, tmp_path) as session:

        def problem() -> str | None:
            found = session.frame()["link"]["problem"]
            return None if found is None else found["code"]

        number = 0

        def name_map() -> None:
            nonlocal number
            number += 1
            bridge.publish(MAP, {"data": f"yard {number}"})

        await drive(bridge, 4.0, name_map)
        for _ in range(30):
            name_map()
            await asyncio.sleep(0.1)
        assert problem() == "signals_silent"
        await drive(bridge, 1.0)
        assert problem() is None
        await asyncio.sleep(3.0)
        assert problem() == "car_silent"


# -- any sequence ----------------------------------------------------------------------------------------------------

PROVEN_S = 12.0  # longer than until a kept sample is known, and 5 s in which nothing new comes
STEPS = ("publish", "publish", "renew", "renew twice", "outage", "wait", "wait long")


class Truth:
    """What was published of the only topic, and what was shown of it."""

    def __init__(self) -> None:
        self.published: list[float] = []
        self.newest_s = -1.0
        self.shown: list[tuple[float, dict[str, Any]]] = []


async def walk(steps: list[str], folder: Path, *, is_stamped: bool, rest_s: float) -> Truth:
    """A car that publishes its latched fuel level, and its speed without a pause, while its link changes; between two
    steps nothing happens for `rest_s`."""
    truth = Truth()
    bridge = KeepingBridge(topics())

    def publish() -> None:
        number = float(len(truth.published))
        truth.published.append(number)
        header = stamped(0.0, time.time())["header"]
        bridge.publish(FUEL, {"data": number} | ({"header": header} if is_stamped else {}))
        truth.newest_s = time.monotonic()

    async with monitored(bridge, folder) as session:

        def each() -> None:
            if truth.published and bridge.is_open:
                truth.shown.append((time.monotonic() - truth.newest_s, signal(session, "fuel")))

        await drive(bridge, 3.0, each, hz=4.0)
        for step in steps:
            if step == "publish":
                publish()
            elif step.startswith("renew"):
                for _ in step.split():
                    bridge.renew(FUEL)
            elif step == "outage":
                bridge.close()
                await asyncio.sleep(2.0)
                bridge.open()
            await drive(bridge, 12.0 if step == "wait long" else rest_s, each, hz=4.0)
    return truth


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("is_stamped", "rest_s"), [(False, 1.0), (False, PROVEN_S), (True, 1.0)])
async def test_no_age_is_smaller_than_the_true_one_and_each_message_is_recorded(
    tmp_path: Path, is_stamped: bool, rest_s: float, seed: int
) -> None:
    """Once, unless it is not known yet that a sample without a stamp is kept when something new comes."""
    chance = random.Random(seed)
    truth = await walk(["publish", *chance.choices(STEPS, k=10)], tmp_path, is_stamped=is_stamped, rest_s=rest_s)
    assert truth.shown
    for true_s, fuel in truth.shown:
        if fuel["age_s"] is not None:
            assert fuel["age_s"] >= true_s - ROUNDED_S
    parts = recorded(tmp_path, FUEL)
    for part in parts:
        assert part == sorted(set(part) if is_stamped or rest_s >= PROVEN_S else part)
    assert sorted({level for part in parts for level in part}) == truth.published

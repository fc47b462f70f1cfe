"""What arrives of a car's topics: when publishers are queried, what is renewed, what is named as missing."""

from __future__ import annotations

import random
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import pytest

from server.cli import doctor
from server.judge.sources import choice
from server.judge.topics import could_carry
from server.recording.recorded_topics import choose
from server.vehicle.delivery import AT_ONCE, Delivery
from server.vehicle.discovery import Offer


def drive(
    delivery: Delivery,
    publishers: Mapping[str, tuple[str, ...] | None],
    *,
    flows: dict[str, float],
    seconds: float,
    start_s: float = 0.0,
    candidates: tuple[str, ...] = (),
) -> tuple[list[tuple[float, str]], list[tuple[float, str]]]:
    """Time passes, topics of `flows` come with their period. Return what was queried and renewed, and when."""
    queried, renewed = [], []
    step = 0
    while (now_s := start_s + step * 0.1) <= start_s + seconds:
        for topic, period_s in flows.items():
            if step % max(1, round(period_s / 0.1)) == 0:
                delivery.received(topic, now_s)
        if step % 10 == 0:
            for topic in delivery.to_ask(now_s, candidates):
                queried.append((now_s, topic))
                if delivery.answered(topic, publishers[topic], now_s):
                    renewed.append((now_s, topic))
        step += 1
    return queried, renewed


@pytest.mark.world(n=4)
def test_a_published_topic_of_which_nothing_comes_is_subscribed_to_anew_and_then_named() -> None:
    delivery = Delivery()
    delivery.opened(0.0)
    delivery.follow(["/vel"], ["/imu"], 0.0)
    queried, renewed = drive(delivery, {"/imu": ("/car",)}, flows={"/vel": 0.1}, seconds=5.0)
    assert queried
    assert [topic for _, topic in renewed] == ["/imu"]
    assert renewed[0][0] <= 5.0
    assert delivery.not_received(5.0) == {}  # it has its time as JSON
    drive(delivery, {"/imu": ("/car",)}, flows={"/vel": 0.1}, seconds=5.0, start_s=5.1)
    assert delivery.not_received(10.1) == {"/imu": ("/car",)}
    delivery.received("/imu", 10.2)
    assert delivery.not_received(10.2) == {}


@pytest.mark.world(n=4)
def test_while_nothing_flows_at_all_no_topic_is_to_blame() -> None:
    delivery = Delivery()
    delivery.follow([], ["/imu", "/tf"], 0.0)
    _, renewed = drive(delivery, {"/imu": ("/car",), "/tf": ("/car",)}, flows={}, seconds=60.0)
    assert renewed == []
    assert delivery.not_received(60.0) == {}


@pytest.mark.world(n=4)
def test_without_a_publisher_or_an_answer_nothing_is_missing() -> None:
    delivery = Delivery()
    delivery.follow(["/vel"], ["/goal", "/unknown"], 0.0)
    _, renewed = drive(delivery, {"/goal": (), "/unknown": None}, flows={"/vel": 0.1}, seconds=60.0)
    assert renewed == []
    assert delivery.not_received(60.0) == {}


@pytest.mark.world(n=4)
def test_a_slow_topic_that_comes_in_time_is_never_renewed_again() -> None:
    """A latched topic sends one message and is silent for the rest of the drive."""
    delivery = Delivery()
    delivery.follow(["/vel"], ["/map"], 0.0)
    delivery.received("/map", 0.2)
    queried, renewed = drive(delivery, {"/map": ("/car",)}, flows={"/vel": 0.1}, seconds=600.0)
    assert queried == renewed == []


@pytest.mark.world(n=4)
def test_a_topic_that_stays_silent_is_queried_ever_more_seldom() -> None:
    delivery = Delivery()
    delivery.follow(["/vel"], [f"/quiet_{n}" for n in range(30)], 0.0)
    nodes = {f"/quiet_{n}": ("/car",) for n in range(30)}
    queried, renewed = drive(delivery, nodes, flows={"/vel": 0.1}, seconds=1800.0)
    of_one = [at_s for at_s, topic in renewed if topic == "/quiet_7"]
    gaps = [b - a for a, b in pairwise(of_one)]
    assert len(of_one) <= 10
    assert gaps == sorted(gaps)
    assert max(gaps) < 400
    assert len(queried) / 1800 < 0.3  # calls a second
    most = max(sum(1 for at_s, _ in queried if at_s == when) for when, _ in queried)
    assert most <= AT_ONCE


@pytest.mark.world(n=4)
def test_a_signal_s_topic_that_a_neighbour_blocks_is_renewed_until_it_comes() -> None:
    delivery = Delivery()
    delivery.follow(["/vel", "/brake"], [], 0.0)
    _, renewed = drive(delivery, {"/brake": ("/car",)}, flows={"/vel": 0.1}, seconds=60.0)
    times = [at_s for at_s, _ in renewed]
    assert times[0] <= 6.0
    assert max(b - a for a, b in pairwise(times)) <= 12.0
    assert delivery.not_received(60.0) == {"/brake": ("/car",)}


@pytest.mark.world(n=4)
def test_a_signal_s_topic_that_stops_is_subscribed_to_anew_while_its_publisher_is_there() -> None:
    """A publisher that comes back with another quality of service is not received by the old subscription."""
    for nodes, expected in ((("/car",), True), ((), False)):
        delivery = Delivery()
        delivery.follow(["/vel", "/brake"], [], 0.0)
        drive(delivery, {}, flows={"/vel": 0.1, "/brake": 0.1}, seconds=10.0)
        _, renewed = drive(delivery, {"/brake": nodes}, flows={"/vel": 0.1}, seconds=10.0, start_s=10.1)
        assert bool(renewed) is expected


@pytest.mark.world(n=27)
@pytest.mark.parametrize("before", [(), ("/car",)])
def test_a_publisher_that_comes_back_after_many_renewals_is_renewed_soon(before: tuple[str, ...]) -> None:
    delivery = Delivery()
    delivery.follow(["/vel", "/brake"], [], 0.0)
    drive(delivery, {}, flows={"/vel": 0.1, "/brake": 0.1}, seconds=10.0)
    _, renewed = drive(delivery, {"/brake": ("/car",)}, flows={"/vel": 0.1}, seconds=600.0, start_s=10.1)
    gaps = [later - sooner for (sooner, _), (later, _) in pairwise(renewed)]
    assert 4 <= len(renewed) <= 8
    assert all(later >= sooner - 1.0 for sooner, later in pairwise(gaps))
    drive(delivery, {"/brake": before}, flows={"/vel": 0.1}, seconds=30.0, start_s=610.2)
    _, renewed = drive(delivery, {"/brake": ("/new",)}, flows={"/vel": 0.1}, seconds=20.0, start_s=640.3)
    assert len(renewed) >= 1


@pytest.mark.world(n=27)
def test_a_slow_topic_that_starts_with_one_message_is_soon_left_alone_and_nobody_is_blamed() -> None:
    delivery = Delivery()
    delivery.follow(["/vel", "/fuel"], [], 0.0)
    renewed = []
    for step in range(6000):
        now_s = step / 10
        delivery.received("/vel", now_s)
        if step % 200 == 30:
            delivery.received("/fuel", now_s)
        for topic in delivery.to_ask(now_s):
            if delivery.answered(topic, ("/car",), now_s):
                renewed.append(now_s)
        assert delivery.came_once(now_s) == []
    assert len(renewed) <= 6


@pytest.mark.world(n=27)
@pytest.mark.parametrize(
    "periods_s", [(5.0, 5.1), (5.0, 7.0), (5.5, 5.5), (6.0, 6.0), (4.0, 12.0), (9.0, 20.0), (6.0, 40.0)]
)
def test_a_topic_that_is_slow_is_never_reported_to_give_one_message_a_subscription(
    periods_s: tuple[float, float],
) -> None:
    """Whenever its messages come, also always just behind a renewal."""
    for seed in range(20):
        chance = random.Random(seed)
        delivery = Delivery()
        delivery.follow(["/vel", "/fuel"], [], 0.0)
        due_s = chance.uniform(0.0, 7.0)
        for step in range(1200):
            now_s = step / 5
            delivery.received("/vel", now_s)
            if now_s >= due_s:
                due_s = now_s + chance.uniform(*periods_s)
                delivery.received("/fuel", now_s)
            for topic in delivery.to_ask(now_s):
                delivery.answered(topic, ("/car",), now_s)
            assert delivery.came_once(now_s) == [], (seed, now_s)


@pytest.mark.world(n=27)
@pytest.mark.parametrize("given_after_s", [0.1, 1.0])
@pytest.mark.parametrize("away_s", [0.0, 300.0])
def test_one_message_a_subscription_is_noticed_within_half_a_minute(given_after_s: float, away_s: float) -> None:
    """Also of a publisher that was away for longer than a slow topic would be."""
    delivery = Delivery()
    delivery.follow(["/vel", "/fuel"], [], 0.0)
    subscribed_s, noticed_s = 0.0, None
    if away_s:
        drive(delivery, {}, flows={"/vel": 0.1, "/fuel": 0.1}, seconds=10.0)
        drive(delivery, {"/fuel": ()}, flows={"/vel": 0.1}, seconds=away_s, start_s=10.1)
        subscribed_s = away_s + 11.0
    back_s = subscribed_s
    for step in range(300):
        now_s = back_s + step / 5
        delivery.received("/vel", now_s)
        if 0.0 <= now_s - subscribed_s - given_after_s < 0.19:
            delivery.received("/fuel", now_s)
        for topic in delivery.to_ask(now_s):
            if delivery.answered(topic, ("/car",), now_s):
                subscribed_s = now_s
        if delivery.came_once(now_s):
            noticed_s = noticed_s or now_s
    assert noticed_s is not None
    assert noticed_s - back_s < 30.0


@pytest.mark.world(n=9)
def test_a_topic_nobody_publishes_is_known_as_such_and_queried_again_until_somebody_does() -> None:
    delivery = Delivery()
    delivery.follow(["/vel", "/brake"], [], 0.0)
    queried, _ = drive(delivery, {"/brake": ()}, flows={"/vel": 0.1}, seconds=2.0)
    assert delivery.unpublished == {"/brake"}
    assert queried[0][0] <= 1.5
    delivery.follow(["/vel"], [], 2.0)  # it carries no signal any more
    queried, _ = drive(delivery, {"/brake": ()}, flows={"/vel": 0.1}, seconds=60.0, start_s=2.1, candidates=("/brake",))
    assert 15 <= len(queried) <= 21
    drive(delivery, {"/brake": ("/late",)}, flows={"/vel": 0.1}, seconds=4.0, start_s=62.2, candidates=("/brake",))
    assert delivery.unpublished == set()


@pytest.mark.world(n=9)
def test_what_comes_has_a_publisher_and_is_not_queried() -> None:
    delivery = Delivery()
    delivery.follow(["/vel"], ["/tf"], 0.0)
    queried, _ = drive(delivery, {}, flows={"/vel": 0.1, "/tf": 0.1}, seconds=600.0)
    assert queried == []


@pytest.mark.world(n=9)
def test_a_publisher_that_died_after_it_published_leaves_its_topic_mapped() -> None:
    delivery = Delivery()
    delivery.follow(["/vel", "/brake"], [], 0.0)
    drive(delivery, {}, flows={"/vel": 0.1, "/brake": 0.1}, seconds=5.0)
    drive(delivery, {"/brake": ()}, flows={"/vel": 0.1}, seconds=60.0, start_s=5.1)
    assert delivery.unpublished == set()


FOUND = {
    "/catvehicle/vel": "geometry_msgs/Twist",
    "/vel": "geometry_msgs/Twist",
    "/fix_of_drone": "sensor_msgs/NavSatFix",
    "/catvehicle/cmd_vel": "geometry_msgs/Twist",
    "/cmd_vel": "geometry_msgs/Twist",
    "/fuel": "std_msgs/Float32",
}


@pytest.mark.world(n=9)
def test_a_signal_is_mapped_to_a_topic_with_a_publisher() -> None:
    sources = choice.choose(FOUND, {}, {"/catvehicle/vel", "/fix_of_drone", "/fuel"}).sources
    assert sources["speed"].topic == "/vel"
    assert sources["speed"].decode is not None
    for signal, topic in (("position", "/fix_of_drone"), ("fuel", "/fuel")):
        assert (sources[signal].topic, sources[signal].decode) == (topic, None)
        assert sources[signal].note == "no node publishes it"


@pytest.mark.world(n=9)
def test_a_topic_that_the_operator_picked_is_kept_and_explained() -> None:
    sources = choice.choose(FOUND, {"speed": "/catvehicle/vel"}, {"/catvehicle/vel"}).sources
    assert (sources["speed"].topic, sources["speed"].decode) == ("/catvehicle/vel", None)
    assert sources["speed"].note == "no node publishes it"
    assert choice.choose(FOUND, {"speed": "/catvehicle/vel"}, set()).sources["speed"].decode is not None


@pytest.mark.world(n=9)
def test_the_car_is_commanded_where_it_listens_though_nobody_publishes_there() -> None:
    source = choice.choose(FOUND, {}, {"/catvehicle/cmd_vel"}).sources["command"]
    assert (source.topic, source.type, source.decode) == ("/catvehicle/cmd_vel", "geometry_msgs/Twist", None)


@pytest.mark.world(n=9)
def test_what_may_carry_a_signal_once_it_is_published() -> None:
    found = FOUND | {"/camera": "sensor_msgs/Image", "/mine": "std_msgs/Float64"}
    assert could_carry(found, {"distance": "/mine"}) == {*FOUND, "/mine"}


@pytest.mark.world(n=9)
async def test_the_doctor_looks_for_topics_with_a_publisher() -> None:
    queried: list[str] = []

    class Link:
        async def call(self, service: str, arguments: dict[str, str], *, timeout_s: float) -> Any:
            queried.append(arguments["topic"])
            return {"publishers": [] if arguments["topic"] in ("/catvehicle/vel", "/fuel") else ["/car"]}

    link: Any = Link()
    choice, unpublished = await doctor._map(link, Offer(topics=FOUND, ros=1))
    sources = choice.sources
    assert unpublished == {"/catvehicle/vel", "/fuel"}
    assert (sources["speed"].topic, sources["speed"].decode is not None) == ("/vel", True)
    assert sources["fuel"].decode is None
    assert len(queried) == len(set(queried)) == len(FOUND) - 1, "each topic once, and none that carries no signal"


@pytest.mark.world(n=4)
def test_a_topic_whose_name_is_not_sent_to_a_bridge_is_named_as_left_out() -> None:
    offered = {
        "/good": "std_msgs/String",
        "relative": "std_msgs/String",
        "/wrong": "no type",
        "/a b": "std_msgs/String",
    }
    others, left_out = choose(offered, without=(), also="all", requested={*offered.values()})
    assert set(others) == {"/good"}
    assert left_out == ("/a b", "/wrong", "relative")


@pytest.mark.world(n=4)
@pytest.mark.parametrize(("period_s", "flows_s"), [(0.1, 2.0), (5.0, 10.0), (600.0, 30.0)])
def test_a_topic_flows_for_two_of_its_intervals_and_for_half_a_minute_at_most(period_s: float, flows_s: float) -> None:
    delivery = Delivery()
    delivery.opened(0.0)
    delivery.follow(["/vel"], [], 0.0)
    for n in range(20):
        delivery.received("/vel", n * period_s)
    newest_s = 19 * period_s
    assert delivery.flows("/vel", newest_s + flows_s - 0.1)
    assert not delivery.flows("/vel", newest_s + flows_s + 0.1)

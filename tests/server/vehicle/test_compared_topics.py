"""The subscriptions of topics that are only compared: as few messages as that needs, and none less that is recorded."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from server.judge import pipeline
from server.vehicle.link_load import LinkLoad
from server.vehicle.signal_map import SignalMap
from server.vehicle.wanted_topics import compared

CAR = {
    "/vel": "geometry_msgs/Twist",
    "/gps/fix": "sensor_msgs/NavSatFix",
    "/gps/filtered": "sensor_msgs/NavSatFix",
    "/odom": "nav_msgs/Odometry",
    "/lio": "nav_msgs/Odometry",
}
COMPARED = {"/gps/filtered", "/lio"}


@dataclass
class Delivered:
    """What is known of the delivery of topics."""

    unpublished: list[str] = field(default_factory=list)
    delivered: tuple[str, ...] = ()


def mapped(offered: dict[str, str] = CAR) -> SignalMap:
    signals = SignalMap()
    signals.update(offered, {}, Delivered())
    return signals


def test_further_topics_are_watched_and_carry_nothing() -> None:
    signals = mapped()
    assert {source.topic for source in signals.compared} == COMPARED
    assert set(pipeline.by_topic(signals.decoded)) == set(CAR)
    assert signals.carriers == {"speed": "/vel", "position": "/gps/fix", "odometry": "/odom"}
    assert set(signals.unmapped) == COMPARED


def test_what_the_operator_picks_carries_the_signal_and_the_other_is_compared() -> None:
    signals = mapped()
    signals.update(CAR, {"position": "/gps/filtered"}, Delivered())
    assert signals.carriers["position"] == "/gps/filtered"
    assert {source.topic for source in signals.compared} == {"/gps/fix", "/lio"}


def test_a_topic_without_a_publisher_is_not_watched() -> None:
    signals = mapped()
    signals.update(CAR, {}, Delivered(unpublished=["/lio"]))
    assert {source.topic for source in signals.compared} == {"/gps/filtered"}


@pytest.mark.parametrize(
    ("is_recorded", "step", "throttle_ms", "queue_length"),
    [(False, 0, 200, 1), (True, 0, 0, 50), (True, 1, 200, 1), (False, 1, 200, 1)],
)
def test_they_are_throttled_unless_they_are_recorded(
    is_recorded: bool, step: int, throttle_ms: int, queue_length: int
) -> None:
    load = LinkLoad()
    load.step = step
    wanted = compared(
        pipeline.by_topic(mapped().compared),
        load,
        undecided=(),
        without=(),
        is_recorded=is_recorded,
        requested=(),
        fit=(),
        compression=lambda topic, is_fit: "none",
    )
    assert set(wanted) == COMPARED
    for row in wanted.values():
        assert (row.throttle_ms, row.queue_length) == (throttle_ms, queue_length)

"""Which messages a bridge sent again after a subscription was renewed, and which are new. Pure."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from server.rosbridge.raw_frame import RawFrame, raw_frame
from server.vehicle.sent_again import GIVEN_WITHIN_S, KEPT, KEPT_BYTES, MOST_TOPICS, TWICE_WITHIN_S, SentAgain

pytestmark = pytest.mark.world(n=27)

TOPIC = "/fuel"


def level(number: float) -> dict[str, Any]:
    return {"data": number}


def stamped(number: float, stamp_s: float = 1_800_000_000.0) -> dict[str, Any]:
    stamp = {"sec": int(stamp_s), "nanosec": round(stamp_s % 1 * 1e9)}
    return {"header": {"stamp": stamp, "frame_id": ""}, "range": number}


def transforms(*names: str) -> dict[str, Any]:
    return {"transforms": [stamped(0.0) | {"child_frame_id": name} for name in names]}


def frame(message: Mapping[str, Any]) -> RawFrame:
    found = raw_frame(json.dumps({"op": "publish", "topic": TOPIC, "msg": message}).encode(), False)
    assert found is not None
    return found


class Bridge:
    """Subscribes at once, reads at once."""

    def __init__(self, *, reads_after_s: float | None = 0.0) -> None:
        self.known = SentAgain(lambda sent_s: None if reads_after_s is None else sent_s + reads_after_s)

    def subscribe(self, at_s: float) -> None:
        self.known.subscribed(TOPIC, at_s)

    def repeats(self, message: Any, at_s: float) -> bool:
        size = len(message.payload) if isinstance(message, RawFrame) else 100
        return self.known.receive(TOPIC, message, size, at_s).is_repeat


@pytest.mark.parametrize("made", [level, stamped, lambda number: frame(level(number)), lambda n: frame(stamped(n))])
def test_the_kept_sample_that_a_renewed_subscription_gives_is_not_new(made: Any) -> None:
    bridge = Bridge()
    bridge.subscribe(0.0)
    assert not bridge.repeats(made(80.0), 0.1)
    for renewed_s in (10.0, 30.0, 90.0):
        bridge.subscribe(renewed_s)
        assert bridge.repeats(made(80.0), renewed_s + 0.2)
    assert not bridge.repeats(made(79.0), 91.0)


def test_without_a_renewal_the_same_message_is_new_each_time() -> None:
    bridge = Bridge()
    bridge.subscribe(0.0)
    assert not any(bridge.repeats(level(80.0), at_s) for at_s in (0.1, 1.1, 2.1, 2.15, 3.1))
    assert not any(bridge.repeats(stamped(80.0), at_s) for at_s in (4.1, 5.1, 6.1))


@pytest.mark.parametrize("made", [level, lambda number: frame(level(number))])
def test_of_a_periodic_value_without_a_stamp_at_most_the_first_is_taken_for_the_kept_one(made: Any) -> None:
    bridge = Bridge()
    bridge.subscribe(0.0)
    for second in range(10):
        assert not bridge.repeats(made(80.0), second + 0.5)
    bridge.subscribe(10.0)
    assert [bridge.repeats(made(80.0), 10.5 + second) for second in range(5)] == [True, False, False, False, False]


def test_a_value_that_came_when_it_was_due_may_be_new_and_one_between_is_not() -> None:
    for at_s, may_be_new in ((10.4, True), (10.6, True), (10.05, False), (13.0, False)):
        bridge = Bridge()
        for second in range(10):
            bridge.repeats(level(80.0), second + 0.5)
        bridge.subscribe(10.0)
        found = bridge.known.receive(TOPIC, level(80.0), 100, at_s)
        assert (found.is_repeat, found.may_be_new) == (True, may_be_new), at_s


def test_two_messages_make_no_period() -> None:
    bridge = Bridge()
    bridge.repeats(level(79.0), 0.0)
    bridge.repeats(level(80.0), 1.0)
    bridge.subscribe(1.5)
    found = bridge.known.receive(TOPIC, level(80.0), 100, 2.0)
    assert (found.is_repeat, found.may_be_new) == (True, False)


def test_without_a_stamp_a_value_of_before_the_newest_is_new() -> None:
    bridge = Bridge()
    bridge.repeats(level(80.0), 0.0)
    bridge.repeats(level(79.0), 1.0)
    bridge.subscribe(10.0)
    assert not bridge.repeats(level(80.0), 10.1)


def test_each_sample_is_given_again_once() -> None:
    bridge = Bridge()
    for name in ("laser", "camera"):
        bridge.repeats(frame(transforms(name)), 0.1)
    bridge.subscribe(10.0)
    assert [bridge.repeats(frame(transforms("laser")), at_s) for at_s in (10.1, 10.2)] == [True, False]
    assert bridge.repeats(frame(transforms("camera")), 10.3)


def test_the_same_value_long_after_the_renewal_is_new() -> None:
    bridge = Bridge(reads_after_s=1.0)
    bridge.repeats(level(80.0), 0.0)
    bridge.subscribe(20.0)
    assert not bridge.repeats(level(80.0), 21.0 + GIVEN_WITHIN_S + 0.1)
    bridge.subscribe(40.0)
    assert bridge.repeats(level(80.0), 41.0 + GIVEN_WITHIN_S - 0.1)


def test_while_the_bridge_has_not_read_the_subscription_its_answer_is_awaited() -> None:
    bridge = Bridge(reads_after_s=None)
    bridge.repeats(level(80.0), 0.0)
    bridge.subscribe(20.0)
    assert bridge.repeats(level(80.0), 50.0)


def test_after_something_new_the_same_value_is_new_too() -> None:
    bridge = Bridge()
    bridge.repeats(level(80.0), 0.0)
    bridge.subscribe(10.0)
    assert [bridge.repeats(level(number), at_s) for number, at_s in ((81.0, 10.1), (80.0, 10.6), (81.0, 11.1))] == [
        False,
        False,
        False,
    ]


@pytest.mark.parametrize("made", [level, stamped])
def test_a_message_that_the_bridge_sends_twice_is_one(made: Any) -> None:
    """ROS 2: the first message after a second subscription of one connection."""
    bridge = Bridge()
    bridge.repeats(made(80.0), 0.0)
    bridge.subscribe(10.0)
    assert [
        bridge.repeats(made(number), at_s) for number, at_s in ((81.0, 10.5), (81.0, 10.5 + TWICE_WITHIN_S / 2))
    ] == [
        False,
        True,
    ]
    assert not bridge.repeats(made(82.0), 11.5)


def test_a_message_that_the_bridge_sends_twice_may_come_after_those_that_were_on_their_way() -> None:
    bridge = Bridge(reads_after_s=0.3)
    bridge.repeats(stamped(80.0), 9.95)
    bridge.subscribe(10.0)
    assert not any(bridge.repeats(stamped(number), 10.0 + number / 1000) for number in (81.0, 82.0, 83.0))
    assert not bridge.repeats(stamped(84.0), 10.4)
    assert [bridge.repeats(stamped(number), 10.5) for number in (83.5, 84.0, 84.0, 83.5)] == [False, True, False, False]
    bridge.subscribe(20.0)
    assert not bridge.repeats(stamped(85.0), 20.1)
    assert not bridge.repeats(stamped(86.0), 20.3 + GIVEN_WITHIN_S + 0.1)
    assert not bridge.repeats(stamped(86.0), 20.3 + GIVEN_WITHIN_S + 0.2)


def test_what_comes_again_seconds_later_is_another_message() -> None:
    """Of a sensor that is frozen, or that publishes what it has again."""
    bridge = Bridge(reads_after_s=0.3)
    bridge.repeats(stamped(80.0), 9.95)
    bridge.subscribe(10.0)
    assert not bridge.repeats(stamped(81.0), 10.1)
    assert not bridge.repeats(stamped(82.0), 12.3)
    assert not bridge.repeats(stamped(82.0), 14.9)


def test_without_a_stamp_only_the_first_message_after_a_subscription_may_come_twice() -> None:
    bridge = Bridge(reads_after_s=0.3)
    bridge.repeats(level(80.0), 9.95)
    bridge.subscribe(10.0)
    assert not any(bridge.repeats(level(number), at_s) for number, at_s in ((81.0, 10.1), (82.0, 10.4), (82.0, 10.41)))


def test_the_samples_of_several_publishers_are_given_again_in_any_order() -> None:
    bridge = Bridge()
    bridge.subscribe(0.0)
    names = ("laser", "camera", "gps")
    assert not any(bridge.repeats(frame(transforms(name)), 0.1) for name in names)
    for renewed_s in (10.0, 20.0):
        bridge.subscribe(renewed_s)
        assert all(bridge.repeats(frame(transforms(name)), renewed_s + 0.1) for name in ("gps", "laser", "camera"))
        assert not bridge.repeats(frame(transforms("new", str(renewed_s))), renewed_s + 0.2)


@pytest.mark.parametrize("made", [level, stamped])
def test_of_a_message_that_was_published_many_times_one_is_kept(made: Any) -> None:
    bridge = Bridge()
    assert not any(bridge.repeats(made(80.0), number / 10) for number in range(20))
    bridge.subscribe(10.0)
    assert [bridge.repeats(made(80.0), 10.3 + number / 10) for number in range(4)] == [True, False, False, False]


def test_two_renewals_may_give_it_twice_and_no_more() -> None:
    bridge = Bridge()
    bridge.repeats(stamped(80.0), 0.0)
    bridge.subscribe(10.0)
    bridge.subscribe(10.1)
    assert [bridge.repeats(stamped(80.0), 10.2 + number) for number in range(3)] == [True, True, False]


def test_a_sample_in_another_encoding_is_the_same() -> None:
    bridge = Bridge()
    as_json = {**stamped(1.5), "ranges": [1.0, None, 2.5], "flag": True}
    as_cbor = {**stamped(1.5), "ranges": np.array([1.0, math.nan, 2.5]), "flag": True}
    bridge.repeats(as_cbor, 0.0)
    bridge.subscribe(10.0)
    assert bridge.repeats(as_json, 10.1)
    bridge.subscribe(20.0)
    assert not bridge.repeats({**as_json, "flag": 1}, 20.1)
    bridge.subscribe(30.0)
    assert not bridge.repeats({**as_json, "ranges": [1.0, 2.0, 2.5]}, 30.1)


@pytest.mark.parametrize("made", [level, stamped])
def test_a_sample_that_was_only_recorded_is_the_same_once_its_topic_carries_a_signal(made: Any) -> None:
    for before, after in ((frame(made(80.0)), made(80.0)), (made(80.0), frame(made(80.0)))):
        bridge = Bridge()
        assert not bridge.repeats(before, 0.0)
        bridge.subscribe(10.0)
        assert bridge.repeats(after, 10.1)
        bridge.subscribe(20.0)
        assert not bridge.repeats(made(79.0), 20.1)


def test_a_frame_that_cannot_be_read_is_the_same_as_no_message() -> None:
    bridge = Bridge()
    broken = RawFrame(
        topic=TOPIC, payload=b'{"op":"publish","topic":"/fuel","msg":{"data":}}', is_binary=False, begins=40
    )
    bridge.repeats(broken, 0.0)
    bridge.subscribe(10.0)
    assert not bridge.repeats(level(80.0), 10.1)


def test_a_large_message_without_a_stamp_may_be_new() -> None:
    for content, is_doubtful in (
        ({"data": [0] * KEPT_BYTES}, True),
        (stamped(1.0) | {"data": [0] * KEPT_BYTES}, False),
    ):
        known = SentAgain(lambda sent_s: sent_s)
        large = frame(content)
        known.receive(TOPIC, large, len(large.payload), 0.0)
        known.subscribed(TOPIC, 10.0)
        found = known.receive(TOPIC, frame(content), len(large.payload), 10.1)
        assert (found.is_repeat, found.is_doubtful) == (True, is_doubtful)


def nested(depth: int) -> dict[str, Any]:
    inner: dict[str, Any] = {}
    for _ in range(depth):
        inner = {"inner": inner}
    return inner


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({"data": np.array([1.0, 2.0])}, {"data": 1.0}),
        ({"data": 1.0}, {"data": np.array([1.0, 2.0])}),
        ({"data": np.array([1.0, 2.0])}, {"data": None}),
        (nested(3000), nested(3000)),
        ([1, 2], {"data": 1}),
        ("text", 5),
    ],
)
def test_messages_of_any_shape_are_compared(before: Any, after: Any) -> None:
    bridge = Bridge()
    bridge.repeats(before, 0.0)
    bridge.subscribe(10.0)
    assert not bridge.repeats(after, 10.1)


def test_a_large_sample_is_known_by_its_hash() -> None:
    bridge = Bridge()
    large = frame({"data": [0] * KEPT_BYTES})
    bridge.repeats(large, 0.0)
    bridge.subscribe(10.0)
    assert bridge.repeats(frame({"data": [0] * KEPT_BYTES}), 10.1)
    bridge.subscribe(20.0)
    assert not bridge.repeats(frame({"data": [0] * (KEPT_BYTES - 1) + [1]}), 20.1)


def test_what_is_kept_is_bounded() -> None:
    known = SentAgain(lambda _: None)
    for number in range(MOST_TOPICS + 100):
        known.receive(f"/topic_{number}", level(1.0), 100, 0.0)
    assert len(known._topics) == MOST_TOPICS
    for number in range(10 * KEPT):
        known.receive(TOPIC, level(number), KEPT_BYTES // 4, float(number))
    assert len(known._topics[TOPIC].samples) <= 4

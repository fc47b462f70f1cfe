"""Transforms that a bridge sends again: each part of a recording has them, and none has them twice."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from server.recording.parts import MOST_HELD, _held_as
from server.vehicle.message_intake import MessageIntake
from server.vehicle.tick_parts import TickParts
from tests.server.judge.mounted_lasers import Laser

TOPIC = "/tf_static"


def test_a_part_that_began_with_other_messages_gets_what_the_bridge_sends_again() -> None:
    message = {"transforms": [Laser(x_m=0.5).transform()]}
    recorded: list[Any] = []
    held: set[Any] = set()
    recording: Any = SimpleNamespace(
        part=("drive", 1),
        take=lambda topic, type, message, *_: recorded.append(message),
        hold=lambda topic, type, message: held.add(_held_as(topic, message)),
        holds=lambda topic, message: _held_as(topic, message) in held,
        release=held.clear,
    )
    judgement: Any = SimpleNamespace(
        frames=SimpleNamespace(receive=lambda *_: None, forget=lambda: None, needs_moving=False, notes=[]),
        reception=SimpleNamespace(repeats=0, unasked=0),
        transport=SimpleNamespace(read_s=lambda sent_s: sent_s, given=lambda *_: None, is_new=lambda _: None),
    )
    marks: Any = SimpleNamespace(button=lambda now_s, read_s: SimpleNamespace())
    nothing: Any = None
    now_s = [0.0]
    intake = MessageIntake("car", nothing, judgement, recording, nothing, TickParts("car"), marks, now=lambda: now_s[0])
    table = SimpleNamespace(transforms=frozenset({TOPIC}), given=lambda _: None, button=None)
    subscriptions = SimpleNamespace(
        table=table, others={}, by_topic={}, received=lambda _: None, type_of=lambda _: "tf2_msgs/TFMessage",
        ros_version=1,
    )  # fmt: skip
    connection: Any = SimpleNamespace(subscriptions=subscriptions, link=SimpleNamespace(frame_bytes=300))
    intake.follow(connection)

    def sent() -> int:
        intake.subscribed(TOPIC)
        now_s[0] += 1.0
        intake.message_received(TOPIC, message, None)
        return len(recorded)

    assert sent() == 1
    assert sent() == 1  # the same part
    intake.link_opened()
    recording.part = ("drive", 2)  # begun by another message, when nothing was held
    assert sent() == 2
    assert sent() == 2
    assert judgement.reception.repeats == 3


def test_transforms_of_the_same_frames_are_held_once() -> None:
    one, other = Laser(x_m=0.5).transform(), Laser(x_m=0.7).transform()
    assert _held_as(TOPIC, {"transforms": [one]}) == _held_as(TOPIC, {"transforms": [other]})
    assert _held_as(TOPIC, {"transforms": [one] * 1000}) == _held_as(TOPIC, {"transforms": [one] * MOST_HELD})
    assert _held_as(TOPIC, None) == (TOPIC,)

"""Which unparsed messages of transforms are parsed: soon for each frame, and not many."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import cbor2
import orjson
import pytest

from server.rosbridge.raw_frame import RawFrame, raw_frame
from server.vehicle.message_intake import TransformPace
from tests.server.judge.mounted_lasers import row


def sent(rows: list[dict[str, Any]], *, is_binary: bool, topic: str = "/tf") -> RawFrame:
    whole = {"op": "publish", "topic": topic, "msg": {"transforms": rows}}
    found = raw_frame(cbor2.dumps(whole) if is_binary else orjson.dumps(whole), is_binary)
    assert found is not None
    return found


def stamped(child: str, at_s: float) -> dict[str, Any]:
    one = row("base_link", child, x_m=at_s)
    header = {"stamp": {"secs": int(at_s), "nsecs": round(at_s % 1 * 1e9)}, "frame_id": "base_link"}
    return {"header": header, "child_frame_id": child, "transform": one["transform"]}


@pytest.mark.parametrize("is_binary", [False, True], ids=["JSON", "CBOR"])
@pytest.mark.parametrize(("joints", "in_a_message"), [(8, 8), (12, 1), (300, 10), (300, 1), (480, 480)])
@pytest.mark.parametrize("laser", ["laser", "car/" + "a_name_of_more_than_24_bytes"])
def test_each_frame_is_parsed_soon_and_few_messages_are(
    is_binary: bool, joints: int, in_a_message: int, laser: str
) -> None:
    pace, seconds = TransformPace(), 7
    names = [f"wheel_{n}" for n in range(joints)]
    parts = [names[at : at + in_a_message] for at in range(0, joints, in_a_message)]
    step_s = 0.02 if joints < 100 else 0.1  # the rate that each frame has
    parsed, of_laser = 0, []
    for tick in range(round(seconds / step_s)):
        now_s = tick * step_s
        messages = [[stamped(name, now_s) for name in part] for part in parts]
        if tick % round(1.0 / step_s) == 7:
            messages.append([stamped(laser, now_s)])
        for message in messages:
            if pace.is_due(sent(message, is_binary=is_binary), now_s):
                parsed += 1
                of_laser += [now_s] if message[0]["child_frame_id"] == laser else []
    assert of_laser[0] == pytest.approx(7 * step_s)
    assert max(b - a for a, b in pairwise(of_laser)) <= 3.0
    assert parsed <= 260 * seconds
    assert parsed * in_a_message <= 2_500 * seconds


def test_a_bridge_with_another_order_of_fields_is_read_five_times_a_second() -> None:
    pace, found = TransformPace(), []
    for tick in range(200):
        one = stamped("laser", tick * 0.02)
        message = sent([dict(sorted(one.items(), reverse=True))], is_binary=False)
        found += [tick] if pace.is_due(message, tick * 0.02) else []
    assert 15 <= len(found) <= 21


def test_names_without_end_are_not_kept_and_not_parsed_without_end() -> None:
    pace, parsed = TransformPace(), 0
    for n in range(5_000):
        parsed += pace.is_due(sent([stamped(f"frame_{n}", 0.0)], is_binary=False), n * 0.002)
    assert parsed <= 500 + 6
    assert len(pace._parsed_s) == 500


def test_a_needed_frame_is_parsed_in_time_though_names_come_without_end() -> None:
    pace, found = TransformPace(), []
    for n in range(5_000):
        now_s = n * 0.02
        pace.is_due(sent([stamped(f"frame_{n}", now_s)], is_binary=False), now_s, {b"laser"})
        if n % 50 == 7 and pace.is_due(sent([stamped("laser", now_s)], is_binary=False), now_s, {b"laser"}):
            found.append(now_s)
    assert max(later - sooner for sooner, later in pairwise(found)) <= 3.0
    assert found[-1] > 95.0
    assert len(pace._parsed_s) <= 500


def test_a_frame_of_another_topic_is_another_one() -> None:
    pace, rows = TransformPace(), [stamped("laser", 0.0)]
    found = [pace.is_due(sent(rows, is_binary=True, topic=topic), 0.0) for topic in ("/one/tf", "/two/tf", "/one/tf")]
    assert found == [True, True, False]


def test_frames_that_come_in_another_encoding_leave_room_for_others() -> None:
    pace = TransformPace()
    for is_binary in (False, True):
        for n in range(300):
            assert pace.is_due(sent([stamped(f"joint_{n}", 0.0)], is_binary=is_binary), 0.0)
    assert pace.is_due(sent([stamped("laser", 0.0)], is_binary=True), 0.0)

"""Messages that come and go in pieces."""

from __future__ import annotations

from typing import Any

import orjson
import pytest

from server.rosbridge_server.encoding import MOST_FRAGMENTS, fragments
from server.rosbridge_server.fields import MOST_MESSAGES, Fragments, Refused
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import Probe, probing


def piece(number: Any, total: Any, data: Any = "x", id: Any = "a") -> dict[str, Any]:
    return {"op": "fragment", "id": id, "data": data, "num": number, "total": total}


def test_pieces_make_a_whole_in_any_order_and_mixed_with_others() -> None:
    fragments = Fragments(limit_bytes=100)
    assert fragments.add(piece(1, 3, "wo")) is None
    assert fragments.add(piece(0, 1, "alone", id="b")) == b"alone"
    assert fragments.add(piece(2, 3, "rld")) is None
    assert fragments.add(piece(0, 3, "hello ")) == b"hello world"


@pytest.mark.parametrize(
    "bad",
    [
        piece(3, 3),
        piece(-1, 3),
        piece(0, 0),
        piece(0, 10**9),
        piece("0", 3),
        piece(0, None),
        piece(0, 3, data=7),
        piece(0, 3, id=None),
        piece(0, 3, id=[]),
    ],
)
def test_senseless_pieces_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(Refused):
        Fragments(limit_bytes=100).add(bad)


def test_a_piece_that_contradicts_the_others_ends_them() -> None:
    fragments = Fragments(limit_bytes=100)
    fragments.add(piece(0, 2))
    with pytest.raises(Refused, match="does not fit"):
        fragments.add(piece(0, 2))
    assert fragments.add(piece(1, 2)) is None  # the first one is forgotten: this begins anew


def test_pieces_have_a_common_limit() -> None:
    fragments = Fragments(limit_bytes=100)
    fragments.add(piece(0, 3, "x" * 60, id="a"))
    with pytest.raises(Refused, match="more than 100 bytes"):
        fragments.add(piece(0, 3, "x" * 60, id="b"))
    assert fragments.add(piece(1, 3, "x", id="a")) is None


def test_the_oldest_unfinished_message_gives_way() -> None:
    fragments = Fragments(limit_bytes=100)
    for number in range(MOST_MESSAGES + 1):
        fragments.add(piece(0, 2, "x", id=number))
    assert fragments.add(piece(1, 2, "y", id=1)) == b"xy"
    assert fragments.add(piece(1, 2, "y", id=0)) is None  # was forgotten


async def whole(probe: Probe, size: int) -> tuple[int, Any]:
    """Of how many fragments of this size the next operation is made, and the operation."""
    text, count, message = "", 0, await probe.hear()
    while message["op"] == "fragment":
        assert (message["num"], message["total"] >= 1) == (count, True)
        text, count = text + message["data"], count + 1
        if len(message["data"]) < size:
            return count, orjson.loads(text)
        message = await probe.hear()
    return count, message


async def test_a_client_gets_all_text_in_pieces_of_its_size() -> None:
    """Answers, messages and pictures; CBOR is whole."""
    async with bridging() as (bridge, port), probing(port) as probe:
        bridge.advertise("/text", "std_msgs/String")
        for compression, op, is_whole in (("none", "publish", False), ("png", "png", False), ("cbor", "publish", True)):
            await probe.send(op="subscribe", topic="/text", id="s", compression=compression, fragment_size=61)
            await probe.send(op="call_service", service="/rosapi/get_time", id="t")
            count, answer = await whole(probe, 61)
            assert (count > 1, answer["id"]) == (True, "t")
            bridge.publish("/text", {"data": "text " * 20})
            count, message = await whole(probe, 61)
            assert (count == 0, message["op"]) == (is_whole, op)


@pytest.mark.parametrize(("version", "op"), [(1, "publish"), (2, "fragment")])
async def test_ros_2_takes_what_is_longer_than_its_frames_apart(version: Any, op: str) -> None:
    async with bridging(ros_version=version, max_message_bytes=5_000) as (bridge, port), probing(port) as probe:
        bridge.advertise("/text", "std_msgs/String")
        await probe.send(op="subscribe", topic="/text")
        await probe.send(op="call_service", service="/rosapi/get_time", id="t")
        assert (await probe.hear())["id"] == "t"
        bridge.publish("/text", {"data": "x" * 6_000})
        assert (await probe.hear())["op"] == op


def test_a_tiny_size_makes_no_flood() -> None:
    assert len(fragments("x" * 1_000_000, 1, 0)) == MOST_FRAGMENTS

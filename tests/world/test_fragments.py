"""Fragments that nobody requested, as real bridges send them: put together, or named as too large."""

from __future__ import annotations

import itertools
import json
from typing import Any

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.judge.message import RosVersion
from server.rosbridge.codec import Unreadable
from server.rosbridge.frame_reader import MOST_UNDER_WAY, Fragments, TooLarge, is_fragment
from server.rosbridge_server import encoding as bridge
from tests.world.transcripts import names, needs_transcripts, read

pytestmark = pytest.mark.world(n=10)
MOST = 4_000


def pieces(text: str, size: int, id: object = 0, version: RosVersion = 2) -> list[bytes]:
    """As written by rosbridge of either ROS: without spaces and with escaped slashes, or with spaces."""
    found = bridge.fragments(text, size, id)
    if version == 2:
        return [json.dumps(one).encode() for one in found]
    return [json.dumps(one, separators=(",", ":")).replace("/", "\\/").encode() for one in found]


@given(
    st.recursive(
        st.none() | st.integers(-(2**40), 2**40) | st.text(max_size=40),
        lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=9), inner, max_size=5),
        max_leaves=20,
    ),
    st.integers(1, 60),
    st.sampled_from([0, "call:7", 'a "quoted" one']),
    st.sampled_from([1, 2]),
)
def test_what_was_taken_apart_is_put_together(message: Any, size: int, id: object, version: RosVersion) -> None:
    text = orjson.dumps({"op": "publish", "topic": "/a", "msg": message}).decode()
    fragments = Fragments(10_000_000)
    *before, last = pieces(text, size, id, version)
    for _ in range(2):
        assert all(is_fragment(one, False) for one in [*before, last])
        assert [fragments.add(one) for one in before] == [None] * len(before)
        assert fragments.add(last) == text.encode()


@pytest.mark.parametrize("size", [100, 1_000, 3_999, MOST + 1])
def test_one_that_will_be_too_large_is_named_with_its_first_piece_and_the_next_is_whole(size: int) -> None:
    long = orjson.dumps({"op": "publish", "topic": "/camera/left", "msg": {"data": "x" * 2 * MOST}}).decode()
    first, *rest = pieces(long, size)
    fragments = Fragments(MOST)
    found = fragments.add(first)
    assert isinstance(found, TooLarge)
    assert found.topic == "/camera/left"
    assert len(long) <= found.size <= 1.2 * len(long)
    assert [fragments.add(one) for one in rest] == [None] * len(rest)
    assert [fragments.add(one) for one in pieces('{"op":"publish"}', 9)] == [None, b'{"op":"publish"}']


def test_a_piece_out_of_its_place_is_refused_and_the_next_message_is_whole() -> None:
    fragments = Fragments(MOST)
    one, two, three = pieces('{"op":"publish"}', 6)
    for wrong in ([two], [one, three], [one, two, two]):
        *before, last = wrong
        for piece in before:
            fragments.add(piece)
        with pytest.raises(Unreadable):
            fragments.add(last)
        assert [fragments.add(piece) for piece in (one, two, three)][-1] == b'{"op":"publish"}'
    fragments.add(one)
    with pytest.raises(Unreadable):
        fragments.add(pieces("x" * 20, 6, "other")[1])
    assert [fragments.add(piece) for piece in (two, three)][-1] == b'{"op":"publish"}', "the other has its own"


def test_messages_whose_fragments_come_in_turn_are_each_whole() -> None:
    """A bridge of ROS 1 sends each topic from a thread of its own, and all fragments have the id 0."""
    texts = ["a" * 20, "b" * 23, "c" * 31]
    fragments, whole = Fragments(MOST), []
    for row in itertools.zip_longest(*(pieces(text, 6) for text in texts)):
        whole += [found for piece in row if piece is not None and (found := fragments.add(piece)) is not None]
    assert whole == [text.encode() for text in texts]


def test_fragments_that_may_be_of_either_of_two_messages_are_refused() -> None:
    """Two messages of one length: the first half of one and the second half of the other would be a message too."""
    (first_a, rest_a), (first_b, rest_b) = pieces("a" * 12, 6), pieces("b" * 12, 6)
    fragments = Fragments(MOST)
    fragments.add(first_a)
    fragments.add(first_b)
    for piece in (rest_a, rest_b):
        with pytest.raises(Unreadable):
            fragments.add(piece)
    assert [fragments.add(piece) for piece in (first_a, rest_a)][-1] == b"a" * 12


def test_messages_that_do_not_end_take_bounded_memory() -> None:
    fragments = Fragments(MOST)
    begun = [pieces("x" * length, 6) for length in range(100, 100 + 2 * MOST_UNDER_WAY)]
    for first, *_ in begun[:MOST_UNDER_WAY]:
        fragments.add(first)
    for first, *_ in begun[MOST_UNDER_WAY:]:
        with pytest.raises(Unreadable):
            fragments.add(first)
    assert [fragments.add(piece) for piece in begun[-1][1:]][-1] == b"x" * 107, "those that came last are kept"
    with pytest.raises(Unreadable):
        fragments.add(begun[0][1])


@pytest.mark.parametrize(
    "piece",
    [
        b'{"op":"fragment","id":0,"data":"a"}',
        b'{"op":"fragment","id":0,"data":"a","num":-1,"total":2}',
        b'{"op":"fragment","id":0,"data":"a","num":0,"total":1e9}',
        b'{"op":"fragment","id":0,"data":"\\x","num":0,"total":1}',
    ],
)
def test_what_is_no_fragment_is_refused(piece: bytes) -> None:
    with pytest.raises(Unreadable):
        Fragments(MOST).add(piece)


def test_more_than_was_announced_is_not_kept() -> None:
    fragments = Fragments(MOST)
    piece = b'{"op":"fragment","id":0,"data":"%s","num":%d,"total":99999.5}'
    fragments.add(piece % (b"", 0))
    found = [fragments.add(piece % (b"x" * 1_000, n)) for n in range(1, 10)]
    assert sum(isinstance(one, TooLarge) for one in found) == 1
    assert sum(len(piece) for one in fragments._under_way.values() for piece in one.pieces) <= MOST


@needs_transcripts
def test_the_fragments_of_real_bridges_make_messages() -> None:
    whole = []
    for name in names():
        fragments: dict[str, Fragments] = {}
        for line in read(name).lines:
            if line.kind == "in" and isinstance(line.frame, str) and is_fragment(line.frame.encode(), False):
                found = fragments.setdefault(line.conn, Fragments(1_000_000)).add(line.frame.encode())
                if found is not None:
                    assert isinstance(found, bytes)
                    whole.append(orjson.loads(found)["op"])
    assert len(whole) > 5
    assert set(whole) <= {"publish", "service_response", "png"}

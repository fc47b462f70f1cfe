"""Fragments that nobody requested, as real bridges send them: put together, or named as too large."""

from __future__ import annotations

import contextlib
import itertools
import json
from typing import Any

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.judge.message import RosVersion
from server.rosbridge.codec import Unreadable
from server.rosbridge.frame_reader import MOST_DOUBTFUL, MOST_UNDER_WAY, Fragments, TooLarge, is_fragment
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


def accepted(fragments: Fragments, *given: bytes) -> list[bytes | TooLarge]:
    """What the pieces make, without those that are refused."""
    found = []
    for piece in given:
        with contextlib.suppress(Unreadable):
            found.append(fragments.add(piece))
    return [one for one in found if one is not None]


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
    text = '{"op":"publish","topic":"/a","msg":{"data":"%s"}}' % ("x" * 60)
    one, two, three = pieces(text, 40)
    for wrong in ([two], [one, three], [one, two, two]):
        *before, last = wrong
        for piece in before:
            fragments.add(piece)
        with pytest.raises(Unreadable):
            fragments.add(last)
        assert accepted(fragments, three) == [], "its rest"
        assert [fragments.add(piece) for piece in (one, two, three)][-1] == text.encode()
    fragments.add(one)
    with pytest.raises(Unreadable):
        fragments.add(pieces("x" * 20, 6, "other")[1])
    assert [fragments.add(piece) for piece in (two, three)][-1] == text.encode(), "the other has its own"


def test_messages_whose_fragments_come_in_turn_are_each_whole() -> None:
    """A bridge of ROS 1 sends each topic from a thread of its own, and all fragments have the id 0."""
    texts = ["a" * 20, "b" * 23, "c" * 31]
    fragments, whole = Fragments(MOST), []
    for row in itertools.zip_longest(*(pieces(text, 6) for text in texts)):
        whole += [found for piece in row if piece is not None and (found := fragments.add(piece)) is not None]
    assert whole == [text.encode() for text in texts]


def test_fragments_that_may_be_of_either_of_two_messages_are_refused() -> None:
    """Two messages of one length: the first half of one and the second half of the other would be a message too."""
    a, b, c = (pieces(letter * 12, 6) for letter in "abc")
    fragments = Fragments(MOST)
    assert accepted(fragments, a[0], b[0], a[1], c[0], b[1], c[1]) == []
    assert accepted(fragments, *a, *b) == [b"a" * 12, b"b" * 12], "all of them have ended"


def test_the_rest_of_one_of_two_messages_does_not_end_a_third_one() -> None:
    a, b, c = (pieces(letter * 18, 6) for letter in "abc")
    fragments = Fragments(MOST)
    assert accepted(fragments, a[0], a[1], b[0], b[1], b[2], c[0], c[1], a[2], c[2]) == []
    assert accepted(fragments, *c) == [b"c" * 18]


@given(st.lists(st.integers(0, 2), max_size=60), st.integers(2, 4), st.booleans())
def test_topics_of_equal_length_in_any_turn_never_make_a_message_of_two(
    turns: list[int], count: int, has_topic: bool
) -> None:
    heads = [f'{{"op":"publish","topic":"/{name}","msg":' if has_topic else name for name in "abc"]
    texts = [head.ljust(40 * count, name) for head, name in zip(heads, "abc", strict=True)]
    sent = [pieces(text, 40) for text in texts]
    fragments, numbers = Fragments(MOST), [0, 0, 0]
    given = []
    for topic in turns:
        given.append(sent[topic][numbers[topic] % count])
        numbers[topic] += 1
    assert set(accepted(fragments, *given)) <= {text.encode() for text in texts}
    for topic, number in enumerate(numbers):
        accepted(fragments, *sent[topic][number % count or count :])
    assert accepted(fragments, *itertools.chain(*sent)) == [text.encode() for text in texts], "all have ended"
    assert fragments._unended == {}


def of_topic(topic: str) -> list[bytes]:
    text = orjson.dumps({"op": "publish", "topic": topic, "msg": {"data": "x" * 50}}).decode()
    return pieces(text, 60)


def test_after_a_lost_last_piece_a_few_messages_of_its_topic_are_refused() -> None:
    fragments, left, right = Fragments(MOST), of_topic("/left_"), of_topic("/right")
    assert accepted(fragments, left[0]) == []
    assert accepted(fragments, *MOST_DOUBTFUL * left) == []
    assert len(accepted(fragments, *left, *left)) == 2
    assert accepted(fragments, left[0], *2 * MOST_DOUBTFUL * [*right, *left]) == [], "of either topic"


def test_the_last_message_of_a_subscription_is_not_mixed_with_the_first_of_the_next() -> None:
    fragments, old, new = Fragments(MOST), of_topic("/left_"), of_topic("/left_")
    assert accepted(fragments, old[0], new[0], old[1], new[1]) == []
    assert len(accepted(fragments, *new)) == 1


def test_the_messages_of_a_topic_do_not_end_that_of_another() -> None:
    left, right = of_topic("/left_"), of_topic("/right")
    assert len(left) == len(right) == 2
    given = [left[0], right[0], left[1], *2 * MOST_DOUBTFUL * left, right[1]]
    assert accepted(Fragments(MOST), *given) == []


def test_large_topics_in_turn_are_each_whole() -> None:
    """Each begins while those before it are under way, the last of them almost complete."""
    fragments = Fragments(MOST)
    sent = [pieces("x" * (3_001 + number), 500) for number in range(5)]
    length = len(sent[0])
    turns = [(number, step) for step in range(10 * length) for number in range(5) if step >= number]
    found = [fragments.add(sent[number][(step - number) % length]) for number, step in turns]
    assert sum(one is not None for one in found) == 10 + 4 * 9


def test_messages_that_do_not_end_take_bounded_memory() -> None:
    fragments = Fragments(MOST)
    begun = [pieces("x" * length, 6) for length in range(100, 101 + MOST_UNDER_WAY)]
    for first, *_ in begun[:-1]:
        fragments.add(first)
    with pytest.raises(Unreadable):
        fragments.add(begun[-1][0])
    assert [fragments.add(piece) for piece in begun[-1][1:]][-1] == b"x" * 164, "those that came last are kept"
    with pytest.raises(Unreadable):
        fragments.add(begun[0][1])


def test_large_messages_that_do_not_end_take_the_memory_of_four() -> None:
    fragments = Fragments(MOST)
    for length in range(MOST - 100, MOST - 50):
        accepted(fragments, *pieces("x" * length, 600)[:-1])
        assert sum(len(piece) for one in fragments._under_way.values() for piece in one.pieces) <= 4 * MOST


def test_counts_of_messages_that_do_not_end_are_bounded() -> None:
    fragments = Fragments(MOST)
    for length in range(100, 1_300):
        accepted(fragments, pieces("x" * length, 6)[0])
    assert len(fragments._unended) == 1_000


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

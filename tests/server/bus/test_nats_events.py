"""The events of one vehicle at a node, in whatever order and from whatever run they come."""

from __future__ import annotations

import random
from typing import Any

import pytest

from server.bus import nats_wire as wire
from server.bus.nats_logs import EventCache


def events(*numbers: int) -> list[dict[str, Any]]:
    return [{"n": n} for n in numbers]


def test_an_older_message_of_the_same_run_takes_nothing_back() -> None:
    cache = EventCache()
    cache.begin("a", 9)
    assert cache.take(events(10, 11))
    cache.begin("a", 10)  # it was overtaken by the events
    assert (cache.last, cache.after(10, 9)) == (11, events(11))


@pytest.mark.parametrize("last", [3, 51, 60])
def test_nothing_of_another_run_is_taken_for_this_one(last: int) -> None:
    """Its log may be another one, restored and grown since; a reader requests where to go on."""
    cache = EventCache()
    cache.begin("a", 50)
    cache.take(events(51))
    cache.begin("b", last)
    assert (cache.last, cache.newest, cache.is_behind) == (last, last, False)
    assert cache.after(last - 1, 9) is None
    assert cache.take(events(last + 1))
    assert cache.after(last, 9) == events(last + 1)


def test_what_an_agent_has_lost_is_not_waited_for() -> None:
    """Published events with a gap wait for the missing ones; of requested ones the agent has no others."""
    cache = EventCache()
    cache.begin("a", 3)
    assert not cache.take(events(7))
    assert cache.take(events(6, 7), are_all=True)
    assert (cache.last, cache.is_behind, cache.after(3, 9)) == (7, False, None)
    assert cache.take(events(8))
    assert cache.after(5, 9) == events(6, 7, 8)
    assert not cache.take(events(6, 7, 8), are_all=True)


@pytest.mark.parametrize(
    "more", ['"age_s": 1e308', '"age_s": 1e30', '"waited_s": NaN', '"now_s": 1e300', '"number": -1']
)
def test_a_frame_of_no_sensible_age_is_refused(more: str) -> None:
    with pytest.raises(wire.Malformed):
        wire.decode_frame(b'{"run": "a", "number": 1, "now_s": 1.0, %s}\nx' % more.encode())


def test_a_compressed_frame_is_read_whole_or_not_at_all() -> None:
    frame = wire.encode_frame(wire.FrameHead(run="a", number=1, now_s=1.0), '{"kind": "state"}' * 1000)
    small = wire.compressed(frame)
    assert len(small) < len(frame) / 10
    assert wire.decode_frame(small) == wire.decode_frame(frame)
    for broken in (small[:-1], small[:20] + b"\x00\x00" + small[22:], wire.compressed(bytes(wire.LARGEST + 1))):
        with pytest.raises(wire.Malformed):
            wire.decode_frame(broken)


def test_a_frame_is_read_by_the_frame_by_which_it_was_compressed_and_by_no_other() -> None:
    state = random.Random(1).randbytes(8000).hex()
    frame = wire.encode_frame(wire.FrameHead(run="a", number=2, now_s=1.0), f"{state}2")
    base = f"{state}1".encode()
    small = wire.compressed(frame, base)
    assert len(small) < 500 < 7000 < len(wire.compressed(frame))
    assert wire.decode_frame(small, base)[1] == f"{state}2"
    assert wire.decode_frame(wire.compressed(frame), base)[1] == f"{state}2", "an agent that has it no more"
    for other in (b"", f"{state}3".encode()):
        with pytest.raises(wire.Malformed):
            wire.decode_frame(small, other)


def test_the_frames_that_others_are_compressed_by_are_the_newest_ones() -> None:
    bases = wire.Bases()
    for number in range(1, wire.MOST_BASES + 2):
        bases.add(number, str(number))
        bases.add(number, "a frame that is sent twice counts once")
    assert [bases.get(n) for n in (0, 1, 2, number, number + 1)] == [b"", b"", b"2", str(number).encode(), b""]


def test_more_events_than_were_requested_are_refused() -> None:
    body = wire.encode(wire.Events.model_construct(run="a", events=events(*range(wire.PORTION + 1))))
    with pytest.raises(wire.Malformed):
        wire.decode(wire.Events, body)

"""What is forgotten of sources that are compared: with another unit, choice or link, and a clock that goes back; and
what is awaited of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.pace import SourceClock
from monitor.state import LinkFacts, State
from monitor.values import GpsFix, Twist

FIX = GpsFix(lat_deg=32.0, lon_deg=-110.0, alt_m=None, status=0, sigma_m=1.0)


def driven(state: State, until_s: float) -> State:
    """Ten speeds a second, and the fixes of a second receiver."""
    for tenth in range(round(until_s * 10)):
        state.receive("speed", Twist(speed_mps=5.0, yaw_rate_radps=None), tenth / 10)
        state.receive_other("position", "/gps/second", FIX, tenth / 10, None)
    return state


def opened(at_s: float) -> LinkFacts:
    return LinkFacts(phase="monitoring", since_s=at_s, connected_s=at_s)


def test_speeds_of_another_unit_make_no_pace() -> None:
    state = driven(State(), 6.0)
    pace = state.snapshot(6.0).compared.stated["speed"]
    assert pace is not None
    assert pace.mps == pytest.approx(5.0)
    state.forget("speed")
    assert "speed" not in state.snapshot(6.0).compared.stated
    assert len(state.snapshot(6.0).compared.of("position")) == 1


def test_over_another_link_further_sources_come_anew() -> None:
    state = State()
    state.link(opened(0.0))
    assert len(driven(state, 6.0).snapshot(6.0).compared.of("position")) == 1
    state.link(opened(7.0))
    assert state.snapshot(7.0).compared.of("position") == ()


def test_a_clock_that_goes_back_leaves_no_age_of_a_further_source() -> None:
    state = driven(State(), 6.0)
    assert len(state.snapshot(6.0).compared.of("position")) == 1
    assert state.snapshot(2.0).compared.of("position") == ()


def compares(at_s: float = 0.0, **topics: tuple[str, ...]) -> LinkFacts:
    return replace(opened(at_s), compared=topics)


def test_what_is_no_longer_compared_leaves_and_the_rest_stays() -> None:
    state = State()
    state.link(compares(position=("/gps/second", "/gps/third")))
    driven(state, 2.0)
    state.receive_other("position", "/gps/third", FIX, 2.0, None)
    state.link(compares(position=("/gps/third",)))
    assert [one.topic for one in state.snapshot(2.0).compared.of("position")] == ["/gps/third"]
    state.link(compares())
    assert state.snapshot(2.0).compared.of("position") == ()


def test_a_link_that_does_not_say_what_is_compared_forgets_nothing() -> None:
    state = State()
    state.link(opened(0.0))
    driven(state, 2.0)
    state.link(replace(opened(0.0), carriers={"speed": "/vel"}))
    assert len(state.snapshot(2.0).compared.of("position")) == 1


def test_the_motion_by_another_topic_leaves_with_the_choice() -> None:
    state = State()
    state.link(replace(opened(0.0), carriers={"speed": "/vel"}))
    driven(state, 6.0)
    state.link(replace(opened(0.0), carriers={"speed": "/vel"}))
    assert "speed" in state.snapshot(6.0).compared.stated
    state.link(replace(opened(0.0), carriers={"speed": "/odom"}))
    assert "speed" not in state.snapshot(6.0).compared.stated


def test_what_never_came_is_awaited_until_it_comes() -> None:
    state = State()
    both = {"position": ("/gps/second", "/gps/third")}
    state.link(compares(4.0, **both))
    assert state.snapshot(9.0).compared.awaited == {"position": {"/gps/second": 4.0, "/gps/third": 4.0}}
    state.receive_other("position", "/gps/third", None, 9.0, None)  # it sends, though nothing that can be used
    state.link(compares(4.0, **both))
    assert state.snapshot(9.0).compared.awaited == {"position": {"/gps/second": 4.0}}
    state.receive("speed", Twist(speed_mps=1.0, yaw_rate_radps=None), 20.0)
    state.link(compares(4.0, **both, odometry=("/lio",)))
    assert state.snapshot(20.0).compared.awaited == {"position": {"/gps/second": 4.0}, "odometry": {"/lio": 20.0}}
    state.link(compares(30.0, **both))
    assert state.snapshot(30.0).compared.awaited == {"position": {"/gps/second": 30.0, "/gps/third": 30.0}}


STAMPS: dict[str, tuple[Any, bool]] = {
    "as time does": (lambda at_s: 1e9 + at_s, True),
    "of another clock that is a little fast": (lambda at_s: 5.0 + 1.01 * at_s, True),
    "late by one second, now and then": (lambda at_s: at_s - (at_s % 4 > 2), True),
    "frozen from the beginning": (lambda at_s: 1e9, False),
    "frozen later": (lambda at_s: 1e9 + min(at_s, 10.0), False),
    "of another rate": (lambda at_s: 1e9 + 0.1 * at_s, False),
    "of milliseconds": (lambda at_s: 1e3 * at_s, False),
    "backwards": (lambda at_s: 1e9 - at_s, False),
}


@pytest.mark.parametrize(("stamp", "is_by_stamp"), STAMPS.values(), ids=STAMPS)
def test_stamps_that_do_not_go_on_as_time_does_are_not_the_clock(stamp: Any, is_by_stamp: bool) -> None:
    clock, times = SourceClock(), []
    for n in range(200):
        times.append((clock.time_s(n / 10, stamp(n / 10)), n / 10))
    at_s, received_s = times[-1]
    assert (at_s == stamp(received_s)) is is_by_stamp
    assert (at_s == received_s) is not is_by_stamp


@pytest.mark.parametrize("is_frozen", [False, True])
def test_a_frozen_stamp_keeps_no_pace(is_frozen: bool) -> None:
    """A receiver at 10 m/s that stops, while its stamps go on or stay."""
    state = State()
    state.link(compares(position=("/gps/second",)))
    for n in range(200):
        at_s = n / 10
        way_deg = 10.0 * min(at_s, 8.0) / 111_195.0
        stamp_s = 1e9 + (min(at_s, 8.0) if is_frozen else at_s)
        state.receive_other("position", "/gps/second", replace(FIX, lat_deg=32.0 + way_deg), at_s, stamp_s)
        if n == 75:
            (other,) = state.snapshot(at_s).compared.of("position")
            assert other.made is not None
            assert other.made.mps == pytest.approx(10.0, abs=0.1)
    (other,) = state.snapshot(20.0).compared.of("position")
    assert other.made is not None
    assert other.made.mps == pytest.approx(0.0, abs=0.1)


def test_the_only_source_of_the_motion_is_not_followed_until_there_is_another() -> None:
    """Nothing could be compared with it, and each of its messages would cost time."""
    state = State()
    state.link(replace(opened(0.0), carriers={"speed": "/vel"}, compared={}))
    driven(state, 6.0)
    assert "speed" not in state.snapshot(6.0).compared.stated
    state.link(replace(opened(0.0), carriers={"speed": "/vel", "position": "/fix"}, compared={}))
    for step in range(60, 120):
        state.receive("speed", Twist(speed_mps=3.0), step / 10)
    assert state.snapshot(12.0).compared.stated["speed"] is not None

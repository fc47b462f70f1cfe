"""How often a signal comes, what is expected of it, and when its silence counts."""

from __future__ import annotations

import random

import pytest

from monitor.rates import STARTING_S, UNDECLARED_S, RateMeter


def feed(meter: RateMeter, hz: float, seconds: float, start_s: float = 0.0, jitter: float = 0.0) -> float:
    """Regular messages, each up to `jitter` periods late; the time of the last."""
    noise, at_s = random.Random(1), start_s
    for number in range(round(hz * seconds) + 1):
        at_s = max(at_s, start_s + (number + jitter * noise.random()) / hz)
        meter.receive(at_s)
    return at_s


@pytest.mark.parametrize("hz", [1.0, 5.0, 10.0, 20.0, 75.0, 200.0])
@pytest.mark.parametrize("declared_hz", [None, 20.0])
def test_a_steady_rate_takes_the_place_of_the_declared_one(hz: float, declared_hz: float | None) -> None:
    meter = RateMeter(declared_hz)
    end_s = feed(meter, hz, max(5.0, 10.0 / hz) + 2.6, jitter=0.4)
    rate = meter.rate(end_s)
    assert rate.settled
    assert rate.expected_hz == pytest.approx(hz, rel=0.03)
    assert rate.measured_hz == pytest.approx(hz, rel=0.05)
    assert meter.horizon_s == pytest.approx(max(1.0, 10.0 / hz), rel=0.03)


def test_until_then_nothing_is_held_against_the_car() -> None:
    meter = RateMeter(75.0)
    end_s = feed(meter, 10.0, 4.0)
    assert not meter.rate(end_s).settled
    assert meter.rate(end_s).learning


def test_a_falling_rate_is_not_learned() -> None:
    meter = RateMeter(20.0)
    end_s = feed(meter, 20.0, 10.0)
    end_s = feed(meter, 12.0, 60.0, end_s)
    assert meter.rate(end_s).expected_hz == pytest.approx(20.0, rel=0.02)
    assert meter.rate(end_s).measured_hz == pytest.approx(12.0, rel=0.03)


def test_a_clearly_and_steadily_higher_rate_is() -> None:
    meter = RateMeter(20.0)
    end_s = feed(meter, 20.0, 10.0)
    end_s = feed(meter, 21.0, 60.0, end_s)
    assert meter.rate(end_s).expected_hz == pytest.approx(20.0, rel=0.02)  # a wobble
    end_s = feed(meter, 40.0, 10.0, end_s)
    assert meter.rate(end_s).expected_hz == pytest.approx(40.0, rel=0.02)


@pytest.mark.world(n=20)
@pytest.mark.parametrize("stall_s", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("begins_s", [0.5 * n for n in range(1, 24)])
@pytest.mark.parametrize("drained_in_s", [0.1, 2.0, 4.0])
def test_a_hiccup_is_not_learned_as_a_faster_source(stall_s: float, begins_s: float, drained_in_s: float) -> None:
    """A 20 Hz source whose messages wait for a while and are then delivered within some seconds: seen as 22.6 Hz."""
    meter = RateMeter(20.0)
    ends_s = begins_s + stall_s
    share = drained_in_s / (stall_s + drained_in_s)
    for number in range(20 * 60):
        at_s = number / 20.0
        if begins_s <= at_s < ends_s + drained_in_s:
            at_s = ends_s + (at_s - begins_s) * share
        meter.receive(at_s)
    assert meter.rate(60.0).expected_hz == pytest.approx(20.0, rel=0.03)


def test_a_burst_on_connecting_is_not_taken_for_the_rate() -> None:
    meter = RateMeter(20.0)
    for _ in range(15):
        meter.receive(0.0)
    end_s = feed(meter, 20.0, 10.0)
    assert meter.rate(end_s).expected_hz == pytest.approx(20.0, rel=0.02)


def test_messages_in_pairs_are_counted_by_time_not_by_spacing() -> None:
    meter = RateMeter(None)
    for number in range(200):
        meter.receive(number // 2 * 0.1)
    assert meter.rate(9.9).expected_hz == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize(
    ("declared_hz", "settled", "learning"), [(20.0, True, False), (None, False, False)], ids=["declared", "undeclared"]
)
def test_a_signal_that_keeps_no_rate(declared_hz: float | None, settled: bool, learning: bool) -> None:
    meter, at_s = RateMeter(declared_hz), 0.0
    for number in range(6):
        at_s = feed(meter, 10.0 if number % 2 else 20.0, 2.5, at_s + 0.05)
    rate = meter.rate(at_s)
    assert (rate.settled, rate.learning, rate.expected_hz) == (settled, learning, declared_hz)


def test_the_operators_figure_stands_above_all() -> None:
    meter = RateMeter(20.0, 50.0)
    end_s = feed(meter, 20.0, 10.0)
    assert (meter.rate(end_s).expected_hz, meter.is_settled) == (50.0, True)
    meter.expect(0.0)
    assert meter.rate(end_s).expected_hz == pytest.approx(20.0, rel=0.02)


def test_the_measured_rate_follows_within_the_window() -> None:
    meter = RateMeter(20.0)
    end_s = feed(meter, 20.0, 10.0)
    end_s = feed(meter, 10.0, 6.0, end_s)
    assert meter.measured_hz(end_s) == pytest.approx(10.0, rel=0.03)


def test_a_pause_that_is_still_going_on_counts() -> None:
    meter = RateMeter(20.0)
    end_s = feed(meter, 20.0, 10.0)
    assert meter.measured_hz(end_s) == pytest.approx(20.0, rel=0.02)
    assert meter.measured_hz(end_s + 0.8) == pytest.approx(20.0 * 4.2 / 4.95, rel=0.05)
    assert meter.measured_hz(end_s + 1.1) == 0.0


def test_a_gap_long_enough_to_be_called_stale_does_not_count_as_slow() -> None:
    meter = RateMeter(20.0)
    end_s = feed(meter, 20.0, 10.0)
    end_s = feed(meter, 20.0, 1.0, end_s + 3.0)
    assert meter.measured_hz(end_s) == pytest.approx(20.0, rel=0.02)


def test_silence_before_the_first_message_is_no_rate() -> None:
    assert RateMeter(20.0).measured_hz(5.0) is None
    meter = RateMeter(20.0)
    meter.receive(5.0)
    assert meter.measured_hz(5.1) is None


def test_patience_before_the_rate_is_known() -> None:
    """A car with 1 Hz positions where 10 Hz is usual must not begin with an alarm."""
    meter = RateMeter(10.0)
    meter.receive(0.0)
    assert meter.horizon_s == STARTING_S
    meter.receive(1.0)
    assert meter.horizon_s == pytest.approx(10.0)
    unknown = RateMeter(None)
    unknown.receive(0.0)
    assert unknown.horizon_s == UNDECLARED_S


@pytest.mark.parametrize("back_s", [0.001, 1.0, 1e9])
def test_a_clock_that_goes_back_begins_the_measuring_anew(back_s: float) -> None:
    meter = RateMeter(20.0)
    end_s = feed(meter, 20.0, 10.0)
    end_s = feed(meter, 20.0, 2.0, end_s - back_s)
    assert meter.measured_hz(end_s) == pytest.approx(20.0, rel=0.02)
    assert meter.rate(end_s).expected_hz == pytest.approx(20.0, rel=0.02)


def test_a_flood_is_measured_and_bounded() -> None:
    meter = RateMeter(20.0)
    end_s = feed(meter, 10_000.0, 6.0)
    measured_hz = meter.measured_hz(end_s)
    assert measured_hz is not None
    assert measured_hz == pytest.approx(10_000.0, rel=0.02)


@pytest.mark.parametrize(("set_hz", "horizon_s"), [(None, 90.0), (2.0, 5.0)])
def test_a_horizon_that_is_held_is_that_of_the_meter_unless_a_rate_is_set(
    set_hz: float | None, horizon_s: float
) -> None:
    meter = RateMeter(1.0, set_hz)
    meter.hold(90.0, 30.0)
    assert meter.horizon_s == horizon_s
    feed(meter, 1.0, 30.0)
    assert (meter.horizon_s, meter.period_s) == (horizon_s, 0.5 if set_hz else 30.0)

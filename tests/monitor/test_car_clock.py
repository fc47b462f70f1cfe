"""The offset of the car's clock, and the lateness of a message by its stamp."""

from __future__ import annotations

import pytest

from monitor.car_clock import AHEAD_S, CONTRADICTION_S, IN_TIME_S, SAMPLES, CarClock, StampedDelay


def clock_of(*answers: tuple[float, float, float]) -> CarClock:
    clock = CarClock()
    for answer in answers:
        clock.answered(*answer)
    return clock


def test_nothing_is_known_before_an_answer() -> None:
    clock = CarClock()
    assert (clock.epoch, clock.ahead_s, clock.requested_s) == (0, None, None)
    assert StampedDelay().late_s(1.0, 2.0, clock) is None


@pytest.mark.parametrize(
    ("answers", "ahead_s", "epoch"),
    [
        ([(10.0, 10.2, 60.1)], 50.1, 0),
        ([(10.0, 10.2, 60.1), (11.0, 11.02, 61.01)], 50.01, 0),  # the tightest answer counts
        ([(11.0, 11.02, 61.01), (12.0, 12.2, 62.1)], 50.01, 0),
        ([(10.0, 10.0, 60.0), (11.0, 11.0, 61.0 + CONTRADICTION_S)], 50.0, 0),  # the limit itself contradicts nothing
        ([(10.0, 10.0, 60.0), (11.0, 11.0, 61.2)], 50.2, 1),  # the clock was set forward
        ([(10.0, 10.0, 60.0), (11.0, 11.0, 60.8)], 49.8, 1),  # and back
    ],
)
def test_the_offset_is_the_tightest_of_the_answers(
    answers: list[tuple[float, float, float]], ahead_s: float, epoch: int
) -> None:
    clock = clock_of(*answers)
    assert clock.ahead_s == pytest.approx(ahead_s)
    assert (clock.epoch, clock.requested_s) == (epoch, answers[-1][0])


def test_only_the_newest_answers_count() -> None:
    clock = clock_of((0.0, 0.01, 50.005), *((float(n), n + 0.1, n + 50.05) for n in range(1, SAMPLES + 1)))
    assert clock.ahead_s == pytest.approx(50.05)


def test_a_stamp_tells_how_late_its_message_is() -> None:
    clock, delay = clock_of((0.0, 0.0, 50.0)), StampedDelay()
    assert delay.late_s(51.0, 1.02, clock) == pytest.approx(0.02)
    assert delay.late_s(52.0, 4.0, clock) == pytest.approx(
        2.0
    )  # the topic was in time once: its stamps are of the clock


@pytest.mark.parametrize(
    ("late_s", "is_known"),
    [(IN_TIME_S - 0.01, True), (IN_TIME_S + 0.01, False), (-AHEAD_S + 0.01, True), (-AHEAD_S - 0.01, False)],
)
def test_stamps_of_another_clock_are_not_trusted(late_s: float, is_known: bool) -> None:
    found = StampedDelay().late_s(51.0, 1.0 + late_s, clock_of((0.0, 0.0, 50.0)))
    assert (found is not None) is is_known
    if found is not None:
        assert found == pytest.approx(late_s)


def test_once_ahead_is_ahead_for_good() -> None:
    clock, delay = clock_of((0.0, 0.0, 50.0)), StampedDelay()
    assert delay.late_s(52.0, 1.0, clock) is None
    assert delay.late_s(53.0, 3.1, clock) is None


def test_after_a_step_back_the_time_is_requested_anew() -> None:
    clock, delay = clock_of((0.0, 0.0, 50.0)), StampedDelay()
    assert delay.late_s(51.0, 1.0, clock) == pytest.approx(0.0)
    assert delay.late_s(41.0, 2.0, clock) is None
    clock.answered(2.0, 2.0, 52.0)
    assert delay.late_s(52.5, 2.6, clock) is None  # requested at the step: the answer may be older than it
    clock.answered(3.0, 3.0, 53.0)
    assert delay.late_s(53.5, 3.6, clock) == pytest.approx(0.1)


@pytest.mark.parametrize("behind_s", [0.7, 3.0, 60.0])
def test_the_late_one_of_two_publishers_stays_late_when_the_other_ends(behind_s: float) -> None:
    """Its stamps go back once, keep their distance and advance at the rate of arrival, as those of another clock do."""
    clock, delay = clock_of((0.0, 0.0, 50.0)), StampedDelay()
    assert delay.late_s(51.0, 1.0, clock) == pytest.approx(0.0)
    for n in range(100):
        at_s = 1.1 + n / 10
        late_s = delay.late_s(50.0 + at_s - behind_s, at_s, clock)
        assert late_s == (None if n == 0 else pytest.approx(behind_s))
        clock.answered(at_s + 0.05, at_s + 0.05, 50.0 + at_s + 0.05)


def test_a_clock_that_was_set_forgets_what_was_in_time() -> None:
    clock, delay = clock_of((0.0, 0.0, 50.0)), StampedDelay()
    assert delay.late_s(51.0, 1.0, clock) == pytest.approx(0.0)
    clock.answered(2.0, 2.0, 60.0)
    assert clock.epoch == 1
    assert delay.late_s(52.0, 2.1, clock) is None  # 8 s late by the new offset, and never in time by it

"""A ping counts as answered by the first message that entered the server's queue after it, whatever its answer says."""

from __future__ import annotations

from server.vehicle.foxglove.stream_marks import IDLE_S, StreamMarks

AHEAD_S = 1000.0  # the server's clock before ours
NS = 10**9


def ns(entered_s: float) -> int:
    return round((entered_s + AHEAD_S) * NS)


def steady() -> StreamMarks:
    """A subscription of 0.0 s, whose first message entered the queue at 0.02 s."""
    marks = StreamMarks()
    marks.subscribed(1, 0.0)
    assert marks.message(1, ns(0.02), 0.03) is None
    return marks


def test_a_ping_is_behind_a_message_that_entered_after_it() -> None:
    marks = steady()
    marks.pong(0.10, 0.11)
    marks.pong(0.20, 0.21)
    assert marks.message(1, ns(0.11), 0.22) is None  # as far as is known, it may have entered at 0.09
    assert marks.message(1, ns(0.13), 0.23) == 0.10
    assert marks.message(1, ns(0.25), 0.26) == 0.20
    assert marks.message(1, ns(0.30), 0.31) is None


def test_messages_that_waited_a_minute_answer_no_newer_ping() -> None:
    marks = steady()
    for tenth in range(1, 600):
        marks.pong(tenth / 10, tenth / 10 + 0.01)
    assert marks.message(1, ns(1.05), 60.0) == 1.0
    assert marks.idle(60.1) is None


def test_where_no_message_waits_a_ping_is_answered_by_its_answer() -> None:
    marks = steady()
    marks.pong(1.0, 1.01)
    assert marks.idle(1.01 + IDLE_S - 0.01) is None
    assert marks.idle(1.01 + IDLE_S + 0.01) == 1.0
    assert marks.idle(2.0) is None
    marks.pong(2.0, 2.01)
    marks.message(1, ns(1.9), 2.02)  # it may have waited
    marks.pong(2.1, 2.11)
    assert marks.idle(2.2) is None
    assert marks.idle(2.11 + IDLE_S + 0.01) == 2.1


def test_without_any_message_pings_are_answered() -> None:
    marks = StreamMarks()
    marks.pong(1.0, 1.01)
    assert marks.idle(1.5) == 1.0


def test_the_first_message_long_after_its_subscription_bounds_the_clock_by_the_silence_before() -> None:
    marks = StreamMarks()
    marks.subscribed(1, 0.0)
    marks.pong(9.5, 9.51)
    assert marks.idle(9.9) == 9.5
    assert marks.message(1, ns(10.0), 10.01) is None
    marks.pong(10.02, 10.03)
    assert marks.message(1, ns(10.6), 10.61) == 10.02  # not only after 10 s


def test_a_kept_sample_is_no_clock() -> None:
    """It has the time at which it was published, long before the subscription: what comes then is of no use."""
    marks = StreamMarks()
    marks.subscribed(1, 100.0)
    assert marks.message(1, ns(3.0), 100.1) is None
    marks.pong(100.2, 100.21)
    assert marks.message(1, ns(50.0), 130.0) is None
    assert marks.message(1, ns(129.9), 130.1) is None
    marks.subscribed(2, 130.2)
    assert marks.message(2, ns(130.25), 130.26) == 100.2


def test_times_at_another_pace_are_no_clock() -> None:
    marks = steady()
    for tick in range(1, 40):
        at_s = tick / 10
        marks.message(1, ns(2 * at_s), at_s)
    marks.pong(4.0, 4.01)
    assert marks.message(1, ns(9.0), 4.5) is None


def test_a_clock_that_drifts_is_followed() -> None:
    marks = steady()
    at_s = 0.0
    for _ in range(10_000):
        at_s += 0.05
        marks.message(1, ns(at_s * (1 + 4e-4)), at_s + 0.001)
    marks.pong(at_s + 0.01, at_s + 0.02)
    assert marks.message(1, ns((at_s + 0.05) * (1 + 4e-4)), at_s + 0.051) == at_s + 0.01


def test_what_ended_is_forgotten() -> None:
    marks = steady()
    marks.unsubscribed(1)
    marks.pong(1.0, 1.01)
    assert marks.message(1, ns(2.0), 2.01) is None

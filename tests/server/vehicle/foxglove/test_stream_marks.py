"""A ping counts as answered by the first message that entered the server's queue after it, whatever its content."""

from __future__ import annotations

import pytest

from server.vehicle.foxglove.delay import StreamMarks

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
    """The server sends half of what enters its queue."""
    marks = steady()
    for tenth in range(1, 1200):
        at_s, entered_s = tenth / 10, tenth / 20
        assert marks.pong(at_s, at_s + 0.01) is None
        newest_s = marks.message(1, ns(entered_s), at_s + 0.05)
        assert newest_s is None or entered_s - 0.2 < newest_s <= entered_s
    assert newest_s is not None or marks.message(1, ns(60.1), 121.0) is not None


def pongs(marks: StreamMarks, *sent_s: float) -> list[tuple[float, float] | None]:
    """Answers that come 0.01 s after their pings."""
    return [marks.pong(at_s, at_s + 0.01) for at_s in sent_s]


def test_where_no_message_waits_a_ping_is_answered_by_its_answer() -> None:
    marks = steady()
    assert pongs(marks, 1.0, 1.1, 1.3, 1.4) == [None] * 4  # the last one is the first that was sent long enough after
    assert pongs(marks, 1.5) == [(1.0, 1.01)]  # and this one was sent when that was answered
    assert pongs(marks, 1.6) == [(1.1, 1.11)]
    marks.message(1, ns(1.9), 2.02)  # it may have waited
    assert pongs(marks, 2.1, 2.2, 2.3, 2.4, 2.5) == [None] * 5
    assert pongs(marks, 2.6) == [(2.1, 2.11)]


def test_answers_that_are_late_prove_nothing_of_the_time_before_they_came() -> None:
    """A radio that was gone for 2 s passes on what the server wrote before: all of it comes at once."""
    marks = steady()
    for tenth in range(10, 30):
        assert marks.pong(tenth / 10, 3.0 + tenth / 10_000) is None
    assert pongs(marks, 3.1, 3.2) == [None, None]


@pytest.mark.parametrize("is_skipped", [True, False])
def test_a_message_that_is_not_read_or_not_whole_is_one(is_skipped: bool) -> None:
    marks = steady()
    assert pongs(marks, 1.0, 1.2) == [None, None]
    if is_skipped:
        marks.skipped(1.25)
    else:
        assert marks.pong(1.25, 1.26, is_in_message=True) is None
    assert pongs(marks, 1.4, 1.5, 1.6, 1.7, 1.8) == [None] * 5
    assert pongs(marks, 1.9) == [(1.4, 1.41)]


def test_without_any_message_pings_are_answered() -> None:
    assert pongs(StreamMarks(), 1.0, 1.4, 1.5) == [None, None, (1.0, 1.01)]


def test_the_first_message_long_after_its_subscription_bounds_the_clock_by_the_silence_before() -> None:
    marks = StreamMarks()
    marks.subscribed(1, 0.0)
    assert pongs(marks, 9.4, 9.8, 9.9) == [None, None, (9.4, 9.41)]
    assert marks.message(1, ns(10.0), 10.01) is None
    marks.pong(10.02, 10.03)
    assert marks.message(1, ns(10.7), 10.71) == 10.02  # not only after 10 s


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

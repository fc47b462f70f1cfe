"""The upper bound of a message's delay: pings as marks, the bridge's queues, stamps, the clock of ROS."""

from __future__ import annotations

import pytest

from monitor.transport import (
    EXCESS_S,
    FAST_S,
    KEPT_S,
    LONG_QUEUE,
    MIDDLE_AT_MOST_S,
    PLACE_PERIODS,
    RECENT_S,
    SHUT_BYTES,
    TOGETHER_S,
    TRIM_S,
    USUAL_S,
    TransportDelay,
)


def opened(at_s: float = 0.0) -> TransportDelay:
    link = TransportDelay()
    link.open(at_s)
    return link


def ping(link: TransportDelay, sent_s: float, at_s: float) -> None:
    link.sent(sent_s)
    link.answered(sent_s, at_s)


def healthy(link: TransportDelay, until_s: float, trip_s: float = 0.01) -> None:
    """Pings four times a second, answered at once."""
    for n in range(int(until_s * 4)):
        ping(link, n / 4, n / 4 + trip_s)


def test_before_any_answer_a_message_is_as_old_as_the_connection() -> None:
    link = opened(10.0)
    assert link.receive("/vel", 10.8) == pytest.approx(0.8)


def test_a_message_is_no_older_than_the_mark_before_it() -> None:
    link = opened()
    link.subscribe("/vel", 0)
    for n in range(3):
        ping(link, float(n), n + 0.01)
        link.receive("/vel", n + 0.02)
    assert link.receive("/vel", 2.10) == pytest.approx(0.10)


def test_a_round_trip_with_a_loss_is_not_the_one_of_the_link() -> None:
    """What was thrown away for a slow link is tried again sooner once the link is another one: a loss is none."""
    link = opened()
    ping(link, 0.0, 0.1)
    ping(link, 1.0, 1.5)
    ping(link, 2.0, 2.12)
    assert link.trip_s == pytest.approx(0.1)


def test_a_long_way_that_is_always_as_long_is_no_queue() -> None:
    link = opened()
    link.subscribe("/scan", 1)
    for n in range(6):
        ping(link, 2.0 * n, 2.0 * n + 2.0)
        late_s = link.receive("/scan", 2.0 * n + 2.0)
    assert late_s == pytest.approx(2.0)


def test_a_queue_without_a_busy_connection_adds_nothing() -> None:
    """A slow topic on a fast link: the marks of its last messages are old, the pings show that nothing waits."""
    link = opened()
    link.subscribe("/gps", 5)
    healthy(link, 40.0)
    link.receive("/gps", 20.0)
    assert link.receive("/gps", 39.80) == pytest.approx(0.05)


@pytest.mark.parametrize("queue_length", [1, 5])
def test_each_place_of_the_queue_costs_as_long_as_the_connection_was_shut(queue_length: int) -> None:
    link = opened()
    link.subscribe("/gps", queue_length)
    healthy(link, 20.0)
    ping(link, 20.0, 20.36)  # 0.35 s longer than the least, of which 0.05 are jitter
    assert link.receive("/gps", 20.36) == pytest.approx(0.36 + (queue_length + 1) * 0.30)


def test_a_place_that_holds_the_newest_costs_a_period_beyond_the_shut_of_now() -> None:
    link = opened()
    link.subscribe("/gps", 1)
    healthy(link, 19.0)
    for n in range(30):
        link.receive("/gps", 18.0 + n * 0.05)
    ping(link, 20.0, 20.36)
    assert link.receive("/gps", 20.36) <= 0.36 + 0.30 + PLACE_PERIODS * 0.14
    ping(link, 20.4, 20.41)
    assert link.receive("/gps", 20.43) <= 0.03 + PLACE_PERIODS * 0.14, "that shut is over"


def busy(link: TransportDelay, queue_lengths: list[tuple[float, int]], until_s: float) -> list[float]:
    """The delays of a topic of 50 Hz over a link whose round trips are 0.17 to 0.37 s, under queues from then on."""
    lengths, delays = dict(queue_lengths), list[float]()
    for n in range(round(until_s * 50)):
        at_s = n / 50
        if at_s in lengths:
            link.subscribe("/dist", lengths[at_s])
        if n % 5 == 0:
            ping(link, at_s - 0.37, at_s - 0.2 * (n % 2))
        delays.append(link.receive("/dist", at_s))
    return delays


def test_a_queue_that_becomes_longer_holds_nothing_that_came_long_before() -> None:
    delays = busy(opened(), [(0.0, 1), (10.0, 10)], 12.0)
    assert max(delays[500:]) <= 0.37 + 0.1 + 11 * 0.02 + 0.001, "the age of the mark, and eleven periods"


def test_what_a_longer_queue_held_before_may_still_come_after_a_shorter_one() -> None:
    link = opened()
    delays = busy(link, [(0.0, 10), (10.0, 1), (10.1, 10)], 10.2)
    assert delays[506] > 1.0, "five messages under the shorter one: the longer one may have held eleven"


@pytest.mark.parametrize(("waited", "shut_s"), [(SHUT_BYTES - 1, 0.0), (SHUT_BYTES, 0.30)])
def test_a_connection_that_so_few_bytes_waited_in_was_not_shut(waited: int, shut_s: float) -> None:
    link = opened()
    link.subscribe("/gps", 1)
    link.took(100_000)
    healthy(link, 20.0)
    link.sent(20.0)
    link.took(waited)
    link.answered(20.0, 20.36)
    assert link.receive("/gps", 20.36) == pytest.approx(0.36 + 2 * shut_s)


def test_a_connection_that_was_slow_from_the_first_message_on_is_not_taken_for_usual() -> None:
    link = opened()
    link.subscribe("/gps", 1)
    for n in range(3):
        ping(link, float(n), n + 0.5)
    assert link.receive("/gps", 2.5) == pytest.approx(0.5 + 2 * 0.45)


def test_a_throttled_topic_may_be_held_until_its_next_message() -> None:
    link = opened()
    link.subscribe("/tf", 1, throttle_s=0.4)
    healthy(link, 20.0)
    assert link.receive("/tf", 19.80) == pytest.approx(0.05 + 0.4)


def test_no_longer_than_its_own_period() -> None:
    link = opened()
    link.subscribe("/tf", 1)
    healthy(link, 20.0)
    for n in range(5):
        link.receive("/tf", 19.0 + n * 0.1)
    link.subscribe("/tf", 1, throttle_s=0.4)
    assert link.receive("/tf", 19.80) <= 0.05 + 0.1 + 1e-9


@pytest.mark.parametrize(("sent_s", "at_s"), [(1.0, 3.0), (5.0, 4.9)])
def test_an_answer_out_of_order_is_no_mark(sent_s: float, at_s: float) -> None:
    link = opened()
    link.subscribe("/vel", 0)
    ping(link, 2.0, 2.5)
    link.answered(sent_s, at_s)
    assert link.receive("/vel", 6.0) == pytest.approx(4.0)


def test_a_stamp_makes_the_bound_a_little_tighter_and_no_more() -> None:
    link = opened()
    link.subscribe("/gps", 0)
    ping(link, 1.0, 1.01)
    link.receive("/gps", 1.02, stamp_s=101.02)
    ping(link, 2.0, 2.01)
    link.receive("/gps", 2.02, stamp_s=102.02)
    assert link.receive("/gps", 2.08, stamp_s=102.08) == pytest.approx(0.02)
    assert link.receive("/gps", 3.00, stamp_s=103.00) == pytest.approx(1.0 - TRIM_S)


def test_the_offset_of_a_stamp_is_forgotten_in_time() -> None:
    link = opened()
    link.subscribe("/gps", 0)
    ping(link, 1.0, 1.01)
    link.receive("/gps", 1.02, stamp_s=101.02)
    for at_s in (2.0, 2.0 + KEPT_S, 3.0 + 2 * KEPT_S):
        ping(link, at_s, at_s + 0.08)
        late_s = link.receive("/gps", at_s + 0.1, stamp_s=at_s + 100.1)
    assert late_s == pytest.approx(0.1)


def test_a_stamp_that_goes_back_is_of_a_clock_that_was_set() -> None:
    link = opened()
    link.subscribe("/gps", 0)
    ping(link, 1.0, 1.01)
    link.receive("/gps", 1.02, stamp_s=101.02)
    ping(link, 2.0, 2.01)
    assert link.receive("/gps", 2.1, stamp_s=52.1) == pytest.approx(0.1)


def test_what_waits_before_the_bridge_shows_in_the_clock_of_ros() -> None:
    link = opened()
    link.subscribe("/gps", 0)
    ping(link, 1.0, 1.01)
    link.clock.answered(1.0, 1.0, 101.0)
    assert link.receive("/gps", 1.02, stamp_s=101.02) == pytest.approx(0.0, abs=0.03)
    ping(link, 5.0, 5.01)
    assert link.receive("/gps", 5.02, stamp_s=104.02) == pytest.approx(1.0)


@pytest.mark.parametrize(("neighbours", "late_s"), [(1, 0.02), (2, 0.82)])
def test_signals_without_a_stamp_are_as_late_as_the_least_late_of_two_neighbours(
    neighbours: int, late_s: float
) -> None:
    link = opened()
    topics = ["/gps", "/odom"][:neighbours]
    for topic in [*topics, "/vel"]:
        link.subscribe(topic, 0)
    ping(link, 1.0, 1.01)
    link.clock.answered(1.0, 1.0, 101.0)
    for topic in topics:
        link.receive(topic, 1.02, stamp_s=101.02)
    link.receive("/vel", 1.02)
    ping(link, 5.0, 5.01)
    for topic, behind_s in zip(topics, (0.82, 2.0), strict=False):
        link.receive(topic, 5.02, stamp_s=105.02 - behind_s)
    assert link.receive("/vel", 5.02) == pytest.approx(late_s, abs=0.025)


def test_a_small_excess_of_the_neighbours_is_jitter() -> None:
    link = opened()
    for topic in ("/gps", "/odom", "/vel"):
        link.subscribe(topic, 0)
    ping(link, 1.0, 1.01)
    link.clock.answered(1.0, 1.0, 101.0)
    for topic in ("/gps", "/odom"):
        link.receive(topic, 1.02, stamp_s=101.02)
    link.receive("/vel", 1.02)
    ping(link, 5.0, 5.0)
    for topic in ("/gps", "/odom"):
        link.receive(topic, 5.0, stamp_s=105.0 - EXCESS_S)
    assert link.receive("/vel", 5.0) == pytest.approx(0.0)


def test_the_link_is_as_late_as_the_latest_of_the_frequent_topics() -> None:
    link = opened()
    for topic in ("/vel", "/map"):
        link.subscribe(topic, 0)
    for n in range(21):
        ping(link, n * FAST_S, n * FAST_S + 0.01)
        link.receive("/vel", n * FAST_S + 0.02)  # at the limit of what is frequent
    link.receive("/map", 10.4)
    assert link.delays() == pytest.approx({"/vel": 0.02, "/map": 0.4})
    assert link.late_s(10.5) == pytest.approx(0.015)
    assert link.late_s(10.02 + RECENT_S) == pytest.approx(0.015)
    assert link.late_s(10.1 + RECENT_S) == pytest.approx(0.395)  # no frequent one came of late: the others tell


def test_a_topic_that_came_late_and_is_throttled_since_is_not_how_late_the_link_is_now() -> None:
    link = opened()
    for topic in ("/vel", "/cmd"):
        link.subscribe(topic, 0)
    for n in range(20):
        ping(link, n / 20, n / 20 + 0.01)
        for topic in ("/vel", "/cmd"):
            link.receive(topic, n / 20 + 0.01)
    link.receive("/cmd", 2.0)  # nothing came for a second, then both
    link.receive("/vel", 2.0)
    late_s = link.late_s(2.0)
    assert late_s > 1.0
    ping(link, 2.0, 2.02)
    link.receive("/vel", 2.0 + TOGETHER_S)
    assert link.late_s(2.31) == late_s
    ping(link, 2.3, 2.32)
    link.receive("/vel", 2.33)
    assert link.late_s(2.33) == pytest.approx(link.delays()["/vel"], abs=0.01)
    assert link.delays()["/vel"] < 0.1
    assert link.delays()["/cmd"] == pytest.approx(late_s, abs=0.01)


def test_a_topic_that_comes_late_and_rarely_makes_the_link_late_between_its_messages() -> None:
    """Its bridge holds it back: a neighbour that comes often is in time."""
    link = opened()
    for topic, length in (("/vel", 1), ("/odom", 10)):
        link.subscribe(topic, length)
    stated = []
    for n in range(400):
        at_s = n / 20
        ping(link, at_s - 0.01, at_s)
        link.clock.answered(at_s, at_s, 100.0 + at_s)
        link.receive("/vel", at_s)
        if n % 8 == 0:
            link.receive("/odom", at_s, stamp_s=100.0 + at_s - min(3.0, max(0.0, at_s - 5.0)))
        if at_s > 10.0:
            stated.append(link.late_s(at_s))
    assert link.delays()["/vel"] < 0.2
    assert min(stated) > 2.5


def test_a_long_queue_makes_its_own_messages_old_and_the_link_only_where_no_other_topic_comes_often() -> None:
    def late_s(lengths: dict[str, int]) -> tuple[float, dict[str, float]]:
        link = opened()
        for topic, length in lengths.items():
            link.subscribe(topic, length)
        for n in range(100):
            if n % 5 == 0:
                ping(link, n / 20 - (0.2 if n == 95 else 0.01), n / 20)
            for topic in lengths:
                link.receive(topic, n / 20)
        return link.late_s(4.95), link.delays()

    late, delays = late_s({"/vel": 2, "/mode": LONG_QUEUE + 1})
    assert late == pytest.approx(delays["/vel"], abs=0.01)
    assert late < 0.7
    assert delays["/mode"] > late + 0.1
    assert late_s({"/mode": LONG_QUEUE + 1})[0] == pytest.approx(delays["/mode"], abs=0.01)
    assert late_s({"/vel": 2, "/mode": LONG_QUEUE})[0] > late + 0.1


def test_a_message_from_a_long_queue_makes_its_own_topic_old_also_after_the_queue_is_shortened() -> None:
    link = opened()
    lengths = {"/vel": 2, "/mode": 2 * LONG_QUEUE}
    for topic, length in lengths.items():
        link.subscribe(topic, length)
    for n in range(100):
        if n % 5 == 0:
            ping(link, n / 20 - (0.2 if n == 95 else 0.01), n / 20)
        for topic in lengths:
            link.receive(topic, n / 20)
    link.subscribe("/mode", 1, throttle_s=0.2)
    assert link.delays()["/mode"] > link.delays()["/vel"] + 0.1
    assert link.late_s(4.96) == pytest.approx(link.delays()["/vel"], abs=0.01)
    link.receive("/mode", 5.0)
    link.receive("/vel", 5.0)
    assert link.late_s(5.0) == pytest.approx(max(link.delays().values()), abs=0.01)  # it came through the short one


def test_without_messages_the_round_trip_tells() -> None:
    link = opened()
    assert link.late_s(5.0) == 0.0
    ping(link, 1.0, 1.3)
    assert link.late_s(5.0) == pytest.approx(0.15)


@pytest.mark.parametrize("trip_s", [0.1, 2 * MIDDLE_AT_MOST_S, 1.0])
def test_the_link_is_stated_as_late_as_the_middle_of_a_round_trip_but_little_below_the_bound(trip_s: float) -> None:
    link = opened()
    for n in range(40):
        ping(link, n / 4, n / 4 + trip_s)
        link.receive("/vel", n / 4 + trip_s)
    assert link.late_s(10.0) == pytest.approx(link.delays()["/vel"] - min(trip_s / 2, MIDDLE_AT_MOST_S))


def test_what_the_link_always_needs_does_not_wait() -> None:
    link = opened()
    for n in range(10):
        ping(link, float(n), n + 0.4)
    ping(link, 10.0, 10.9)
    assert link.queued_s(11.0) == pytest.approx(0.5)


def test_the_usual_trip_is_of_the_last_minute() -> None:
    link = opened()
    ping(link, 1.0, 1.1)
    for at_s in (1.2 + USUAL_S, 1.4 + 2 * USUAL_S):
        ping(link, at_s, at_s + 0.6)
    ping(link, 100.0, 100.9)
    assert link.queued_s(101.0) == pytest.approx(0.3)


def test_a_link_that_is_slow_from_the_beginning_is_not_usual() -> None:
    link = opened()
    ping(link, 0.0, 3.0)
    assert link.queued_s(3.0) == pytest.approx(2.0)  # a second is the most that counts as usual


def test_an_unanswered_ping_is_waited_for() -> None:
    link = opened()
    assert link.waiting_s(5.0) == 0.0
    link.sent(1.0)
    link.sent(2.0)
    assert link.waiting_s(5.0) == pytest.approx(4.0)
    link.answered(1.0, 5.0)
    assert link.waiting_s(5.0) == pytest.approx(3.0)


def test_a_new_connection_knows_nothing_of_the_old_one() -> None:
    link = opened()
    link.subscribe("/vel", 0)
    ping(link, 1.0, 3.0)
    link.sent(3.0)
    link.receive("/vel", 3.0, stamp_s=50.0)
    link.open(100.0)
    assert (link.delays(), link.waiting_s(105.0), link.late_s(105.0), link.clock.ahead_s) == ({}, 0.0, 0.0, None)
    assert link.receive("/vel", 100.2, stamp_s=60.0) == pytest.approx(0.2)


def test_what_was_sent_has_been_read_once_a_ping_behind_it_is_answered() -> None:
    """Also where it lay on the way with the pings behind it."""
    link = opened(10.0)
    for sent_s in (9.9, 10.4, 10.9, 11.4):
        link.sent(sent_s)
    link.answered(9.9, 11.0)
    assert link.read_s(10.0) is None
    link.answered(10.4, 13.5)
    link.answered(10.9, 13.5)
    assert link.read_s(10.0) == 13.5
    assert link.read_s(11.0) is None
    for n in range(5000):
        ping(link, 14.0 + n / 2, 14.1 + n / 2)
    assert (link.read_s(10.0) or 0.0) < 2400.0, "long ago"
    link.open(3000.0)
    assert link.read_s(3000.0) is None

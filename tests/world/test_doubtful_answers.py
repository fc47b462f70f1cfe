"""Which messages in doubt are recorded, by the moments at which they and the answers to our subscriptions come."""

from __future__ import annotations

import pytest

from server.vehicle.doubtful import ANSWERED_WITHIN_S, MOST_HELD, SILENCES, Doubtful, Held, Verdict, may_be_kept

pytestmark = pytest.mark.world(n=27)


def held(at_s: float) -> Held:
    return Held({"data": True}, 10, at_s, at_s)


def test_a_fast_topic_is_recorded_at_once_and_a_quiet_one_may_keep_its_sample() -> None:
    assert may_be_kept(None, 1.0)
    assert may_be_kept(0.2, 20.0)
    assert may_be_kept(1.0, 1.0)
    assert may_be_kept(0.0, 0.0), "two at once are no period"
    assert not may_be_kept(0.2, 0.1)
    assert not may_be_kept(1.0, 1.0, 1.5), "an answer may need longer than the next message"
    assert not may_be_kept(0.05, 0.3), "a hiccup of the link"
    doubtful = Doubtful()
    assert doubtful.came("/a", held(1.0), may_be_kept=False).record == (held(1.0),)


def is_same(one: object, other: object) -> bool:
    return one == other


def came(doubtful: Doubtful, at_s: float, within_s: float = ANSWERED_WITHIN_S) -> Verdict:
    verdict = doubtful.came("/a", held(at_s), may_be_kept=True, within_s=within_s)
    if verdict.probes:
        doubtful.subscribed("/a", at_s)
    return verdict


def probe(doubtful: Doubtful, at_s: float) -> None:
    assert not doubtful.to_probe(at_s - 0.02)
    assert doubtful.to_probe(at_s + 0.01) == ["/a"]
    doubtful.subscribed("/a", at_s + 0.01)
    assert not doubtful.to_probe(at_s + 0.02)


def test_without_an_answer_in_time_all_are_recorded() -> None:
    doubtful = Doubtful()
    assert came(doubtful, 1.0).probes
    assert not list(doubtful.overdue(1.2, is_heard=True))
    assert list(doubtful.overdue(1.4, is_heard=True)) == [("/a", (held(1.0),))], "a kill loses no more than that"
    assert not list(doubtful.overdue(20.0, is_heard=True))
    assert came(doubtful, 21.0).probes
    assert came(doubtful, 22.0).record == (held(21.0), held(22.0))


def test_an_answer_that_comes_too_late_is_recorded_and_begins_no_other_doubt() -> None:
    doubtful = Doubtful()
    came(doubtful, 1.0)
    assert list(doubtful.overdue(1.4, is_heard=True)) == [("/a", (held(1.0),))]
    assert came(doubtful, 1.6) == Verdict(record=(held(1.6),))
    assert not list(doubtful.all())
    assert doubtful._bytes == 0


def test_a_message_in_the_silence_before_a_probe_is_no_answer() -> None:
    for count in range(1, len(SILENCES)):
        doubtful, at_s = Doubtful(), 1.0
        came(doubtful, at_s)
        for silence in SILENCES[1:count]:
            at_s += 0.1
            came(doubtful, at_s)
            at_s += silence * ANSWERED_WITHIN_S
            probe(doubtful, at_s)
        assert not came(doubtful, at_s + 0.1).record
        assert len(doubtful.came_new("/a", held(at_s + 0.3), is_same)) == count + 1
        assert doubtful._bytes == 0


def test_a_probe_after_a_silence_without_an_answer_shows_that_all_were_new() -> None:
    doubtful = Doubtful()
    came(doubtful, 1.0)
    came(doubtful, 1.1)
    assert not list(doubtful.overdue(1.65, is_heard=True)), "the silence is not over"
    probe(doubtful, 1.7)
    assert not list(doubtful.overdue(1.9, is_heard=True))
    assert list(doubtful.overdue(2.1, is_heard=True)) == [("/a", (held(1.0), held(1.1)))]


@pytest.mark.parametrize("period_s", [number / 100 for number in range(1, 200)])
def test_no_interval_gives_all_answers(period_s: float) -> None:
    """A topic that continues, of which nothing is known yet."""
    doubtful, at_s, sent, recorded_count, expected = Doubtful(), 0.0, 0, 0, 2  # two renewals of ours
    for tick in range(1, 100):
        while at_s + period_s <= tick / 10:
            at_s += period_s
            sent += 1
            if expected:
                expected -= 1
                verdict = came(doubtful, at_s)
                expected += verdict.probes
                recorded_count += len(verdict.record)
            else:
                recorded_count += len(doubtful.came_new("/a", held(at_s), is_same)) + 1
        for topic in doubtful.to_probe(tick / 10):
            doubtful.subscribed(topic, tick / 10)
            expected += 1
        recorded_count += sum(len(each) for _, each in doubtful.overdue(tick / 10, is_heard=True))
    recorded_count += len(list(doubtful.all()))
    assert recorded_count == sent


def kept() -> Doubtful:
    """It had its answers."""
    doubtful = Doubtful()
    assert came(doubtful, 1.0).probes
    assert not came(doubtful, 1.1).probes
    probe(doubtful, 1.7)
    came(doubtful, 1.8)
    probe(doubtful, 3.0)
    assert came(doubtful, 3.1) == Verdict()
    assert not doubtful.to_probe(20.0)
    return doubtful


HELD = tuple(held(at_s) for at_s in (1.0, 1.1, 1.8, 3.1))


def test_what_had_its_answers_is_dropped_only_if_nothing_new_comes() -> None:
    assert kept().settled("/a") == HELD
    assert list(kept().overdue(8.2, is_heard=True)) == [("/a", ())]
    assert not list(kept().all())
    later = kept()
    assert came(later, 6.0) == Verdict(), "another renewal"
    assert not list(later.overdue(10.9, is_heard=True))
    assert later.settled("/a")[-1] == held(6.0)


def test_the_same_once_more_after_the_answers_shows_a_topic_that_goes_on() -> None:
    assert kept().came_new("/a", held(6.0), is_same) == HELD
    other = Held({"data": False}, 10, 6.0, 6.0)
    assert kept().came_new("/a", other, is_same) == ()
    assert kept().came_new("/a", Held({"data": False}, 10, 3.2, 3.2), is_same) == HELD, "so soon after them"


def test_without_a_link_it_is_not_known_that_nothing_new_came() -> None:
    doubtful = kept()
    assert list(doubtful.overdue(5.0, is_heard=False)) == [("/a", HELD)]
    assert not list(doubtful.overdue(8.2, is_heard=True))
    assert doubtful._bytes == 0
    waiting = Doubtful()
    came(waiting, 1.0)
    came(waiting, 1.1)
    assert list(waiting.overdue(1.5, is_heard=False)) == [("/a", HELD[:2])], "it cannot be probed"


def test_an_answer_may_need_a_round_trip_from_when_the_subscription_was_sent() -> None:
    doubtful = Doubtful()
    came(doubtful, 1.0, 1.0)
    assert not came(doubtful, 1.9, 1.0).record
    probe(doubtful, 3.9)
    assert not came(doubtful, 4.8, 1.0).record
    probe(doubtful, 8.8)
    assert came(doubtful, 9.9, 1.0).record


def test_the_answer_to_a_subscription_of_another_reason_is_held_and_proves_nothing() -> None:
    doubtful = Doubtful()
    came(doubtful, 1.0)
    at_s = 1.0
    for answers in (1, 2):
        assert came(doubtful, at_s + 0.1) == Verdict()
        doubtful.subscribed("/a", at_s + 0.2)
        assert came(doubtful, at_s + 0.3) == Verdict()
        at_s += 0.3 + SILENCES[answers] * ANSWERED_WITHIN_S
        assert not list(doubtful.overdue(at_s, is_heard=True))
        probe(doubtful, at_s)
    assert came(doubtful, at_s + 0.1) == Verdict()
    assert list(doubtful.overdue(at_s + 6.0, is_heard=True)) == [("/a", ())]


def test_what_is_held_is_bounded() -> None:
    doubtful = Doubtful()
    names = [f"/{number}" for number in range(MOST_HELD + 100)]
    at_once = sum(bool(doubtful.came(name, held(1.0), may_be_kept=True).record) for name in names)
    assert at_once == 100
    large = Held({"data": True}, 5_000_000, 1.0, 1.0)
    doubtful = Doubtful()
    assert [bool(doubtful.came(name, large, may_be_kept=True).record) for name in ("/a", "/b")] == [False, True]
    assert list(doubtful.all()) == [("/a", large)]
    assert not doubtful.came("/b", large, may_be_kept=True).record

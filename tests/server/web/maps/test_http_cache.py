"""How long a tile is fresh by its server's headers, and when that server may be requested again."""

from __future__ import annotations

import pytest

from server.web.maps.tile_fetcher import DEFAULT_FRESH_S, LONGEST_S, MOST, WITHIN_S, Pace, fresh_for_s, retry_after_s

NOW_S = 1_790_000_000.0  # Mon, 21 Sep 2026 14:13:20 GMT
DATE = "Mon, 21 Sep 2026 14:13:20 GMT"
LATER = "Mon, 21 Sep 2026 15:13:20 GMT"


@pytest.mark.parametrize(
    ("headers", "seconds"),
    [
        ({}, DEFAULT_FRESH_S),
        ({"Cache-Control": "max-age=600"}, 600),
        ({"cache-control": "public, MAX-AGE=600 , immutable"}, 600),
        ({"Cache-Control": 'max-age="600"'}, 600),
        ({"Cache-Control": "max-age=600", "Age": "100"}, 500),
        ({"Cache-Control": "max-age=600", "Age": "700"}, 0),
        ({"Cache-Control": "max-age=600, s-maxage=60"}, 60),
        ({"Cache-Control": "max-age=600", "Expires": "0"}, 600),
        ({"Cache-Control": "max-age=99999999999"}, LONGEST_S),
        ({"Cache-Control": "max-age=-5"}, 0),
        ({"Cache-Control": "max-age=nan"}, 0),
        ({"Cache-Control": "max-age=" + "9" * 5000}, 0),
        ({"Cache-Control": "no-store, max-age=600"}, None),
        ({"Cache-Control": "no-cache"}, 0),
        ({"Cache-Control": "public"}, DEFAULT_FRESH_S),
        ({"Expires": LATER, "Date": DATE}, 3600),
        ({"Expires": LATER}, 3600),
        ({"Expires": DATE, "Date": LATER}, 0),
        ({"Expires": "0"}, 0),
        ({"Expires": "soon"}, 0),
        ({"Expires": LATER, "Date": "never"}, 3600),
    ],
)
def test_how_long_an_answer_holds(headers: dict[str, str], seconds: float | None) -> None:
    assert fresh_for_s(headers, NOW_S) == seconds


@pytest.mark.parametrize(
    ("value", "seconds"),
    [
        (None, None), ("", None), ("120", 120), (" 120 ", 120), ("0", 1), ("999999999", 86_400), (LATER, 3600),
        ("Mon, 21 Sep 2026 14:00:00 GMT", 1), ("-5", None), ("nan", None), ("soon", None), ("1e3", None), ("٣", None),
    ],
)  # fmt: skip
def test_the_pause_that_is_requested(value: str | None, seconds: float | None) -> None:
    assert retry_after_s(value, NOW_S) == seconds


def test_pauses_grow_with_each_failure_and_end_with_an_answer() -> None:
    pace, now_s, pauses = Pace(), 100.0, []
    for _ in range(9):
        pace.failed("It does not answer.", now_s)
        began_s = now_s
        while not pace.may_ask(now_s):
            now_s += 1.0
        pauses.append(now_s - began_s)
    assert pauses == [5, 10, 20, 40, 80, 160, 300, 300, 300]
    assert pace.problem_now(now_s) == "It does not answer."
    pace.well()
    assert pace.problem_now(now_s) is None
    pace.failed("It does not answer.", now_s)
    assert pace.may_ask(now_s + 5)


def test_two_failures_at_a_time_are_one_and_a_longer_pause_stands() -> None:
    pace = Pace()
    pace.failed("a", 100.0, 120.0)
    pace.failed("b", 100.5)
    assert not pace.may_ask(219.9)
    assert pace.may_ask(220.0)
    pace.failed("c", 220.0)
    assert not pace.may_ask(229.9)
    assert pace.may_ask(230.0), "the second of those at a time did not count"


def test_so_many_within_so_long_and_no_more() -> None:
    pace = Pace()
    for i in range(MOST):
        assert pace.may_ask(float(i) / 10)
        pace.note_request(float(i) / 10)
    assert not pace.may_ask(WITHIN_S - 0.1)
    assert "more come later" in str(pace.problem_now(WITHIN_S - 0.1))
    assert pace.may_ask(WITHIN_S)
    pace.note_request(WITHIN_S)
    assert not pace.may_ask(WITHIN_S + 0.05)
    assert pace.may_ask(WITHIN_S + 0.1)

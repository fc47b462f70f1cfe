"""How far the car may have driven: a bound that holds for every drive, and what is not known is not 0."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.catalog import AllLimits, flat, schema
from monitor.unseen import unseen_m, unseen_words

TABLE = json.loads(Path(__file__).with_name("unseen.json").read_text(encoding="utf-8"))
SPEEDS = st.floats(-60.0, 60.0)
AGES = st.floats(0.0, 600.0)
LIMITS = st.floats(0.5, 15.0)


@given(SPEEDS, AGES, LIMITS, st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=12))
def test_no_drive_within_the_limit_is_longer(speed_mps: float, age_s: float, limit: float, pushes: list[float]) -> None:
    bound_m = unseen_m(speed_mps, age_s, limit)
    assert bound_m is not None
    x_m, step_s = 0.0, age_s / len(pushes)
    for push in pushes:
        x_m += speed_mps * step_s + limit * push * step_s**2 / 2
        speed_mps += limit * push * step_s
        assert abs(x_m) <= bound_m * (1 + 1e-9) + 1e-9


@given(SPEEDS, AGES, AGES, LIMITS)
def test_it_grows_with_time_and_is_reached_at_the_limit(speed_mps: float, a_s: float, b_s: float, limit: float) -> None:
    earlier, later = unseen_m(speed_mps, min(a_s, b_s), limit), unseen_m(speed_mps, max(a_s, b_s), limit)
    assert earlier is not None
    assert later is not None
    assert earlier <= later
    assert later == pytest.approx(abs(speed_mps) * max(a_s, b_s) + limit * max(a_s, b_s) ** 2 / 2)


@pytest.mark.parametrize("odd", [None, math.nan, math.inf, -math.inf])
def test_what_is_not_known_is_not_zero(odd: float | None) -> None:
    assert unseen_m(odd, 1.0, 3.0) is None
    assert unseen_m(1.0, odd, 3.0) is None
    assert unseen_m(1.0, 1.0, odd) is None
    assert unseen_m(odd, 0.0, 3.0) is None
    assert unseen_words(None) == "distance driven unknown"


@given(st.floats(0.0, 1e6))
def test_words_are_never_less_than_the_bound(metres: float) -> None:
    sign, number, unit, end = unseen_words(metres).split(" ")
    assert (sign, end) == ("≤", "unseen")
    shown_m = float(number) * {"m": 1.0, "km": 1000.0}[unit]
    assert metres <= shown_m <= metres + {"m": 1.0, "km": 100.1}[unit]


def test_the_page_counts_as_the_server_does() -> None:
    """tests/page/unseen.test.js reads the same table."""
    for speed_mps, age_s, limit, metres, text in TABLE["ways"]:
        assert unseen_m(speed_mps, age_s, limit) == metres
        assert unseen_words(metres) == text


def test_the_proposal_is_a_setting_that_is_off_by_default() -> None:
    limits = flat(AllLimits())
    assert limits["unseen.proposes_speed"] == 0.0
    assert limits["unseen.acceleration_mps2"] == 3.0
    assert schema()["unseen.proposes_speed"]["heading"] == "Metres unseen"

"""A value beside its limit."""

from __future__ import annotations

import math

import pytest

from monitor.check import beside


@pytest.mark.parametrize(
    ("value", "limit", "digits", "text"),
    [
        (12.64, 11.0, 1, "12.6"),
        (4.2, 5.0, 1, "4.2"),
        (4.97, 5.0, 1, "4.97"),
        (4.998, 5.0, 1, "4.998"),
        (4.9999, 5.0, 1, "5.0"),
        (5.0, 5.0, 1, "5.0"),
        (11.02, 11.0, 1, "11.02"),
        (9.7, 10.0, 0, "9.7"),
        (2.4, 2.0, 0, "2.4"),
        (31.0, 2.0, 0, "31"),
        (math.nan, 5.0, 1, "nan"),
        (math.inf, 5.0, 1, "inf"),
        (5.0, math.inf, 1, "5.0"),
        (-0.01, 0.0, 1, "-0.01"),
    ],
)
def test_it_reads_apart_from_the_limit(value: float, limit: float, digits: int, text: str) -> None:
    assert beside(value, limit, digits) == text

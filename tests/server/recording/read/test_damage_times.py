"""The time of damaged parts is only reported where the times that they declare can be right."""

from __future__ import annotations

import pytest

from server.recording.read.source import Damage

S = 10**9
START_S, LENGTH_S = 1_790_000_000, 100


def damage_of(first_s: float, last_s: float, start_s: float = START_S) -> str:
    damage = Damage(parts=5)
    damage.leave_out(round(first_s * S), round(last_s * S), ValueError())
    [sentence] = damage.sentences("a.mcap", round(start_s * S), round((start_s + LENGTH_S) * S))
    return sentence


def test_likely_times_are_reported() -> None:
    expected = "a.mcap is damaged: 1 part of 5, between 10.0 s and 12.5 s, is left out"
    assert damage_of(START_S + 10.0, START_S + 12.5) == expected
    assert damage_of(20.0, 22.5, start_s=10.0) == expected  # a clock that was never set


@pytest.mark.parametrize(
    ("first_s", "last_s"),
    [
        (0.0, START_S + 5.0),
        (START_S + 5.0, 18_446_744_073.0),
        (START_S + 9.0, START_S + 2.0),
        (START_S - 86_400.0, START_S - 86_399.0),
    ],
)
def test_others_are_not(first_s: float, last_s: float) -> None:
    assert damage_of(first_s, last_s) == "a.mcap is damaged: 1 part of 5 is left out"

"""The reading that an object's closing speed is measured from."""

from __future__ import annotations

import pytest

from monitor.reading import AT_MOST_S, BEFORE_S, Reading, ReadingHistory


def after(*received_s: float) -> float | None:
    """When the reading to compare with came, after readings at these moments."""
    history = ReadingHistory()
    for at_s in received_s:
        history.add(Reading(value=at_s, received_s=at_s, horizon_s=1.0))
    return None if history.before is None else history.before.received_s


@pytest.mark.parametrize(
    ("received_s", "before_s"),
    [
        ((5.0,), None),
        ((5.0, 5.25), None),
        ((5.0, 5.0 + BEFORE_S), 5.0),
        ((4.0, 4.25, 4.5, 4.75, 5.0), 4.5),  # the newest that is old enough
        ((4.0, 4.5, 5.0), 4.5),
        ((0.0, AT_MOST_S), 0.0),
        ((4.0, 4.0 + AT_MOST_S + 0.01), None),
        ((4.0, 6.0, 6.25), None),  # what came before the gap is too old
        ((4.0, 6.0, 6.5), 6.0),
        ((4.0, 4.0, 4.5), 4.0),
        ((9.0, 5.0, 5.25), None),  # the clock went back
        ((9.0, 5.0, 5.5), 5.0),
    ],
)
def test_the_reading_to_compare_with(received_s: tuple[float, ...], before_s: float | None) -> None:
    assert after(*received_s) == before_s


def test_of_two_at_one_moment_the_later_one_counts() -> None:
    history = ReadingHistory()
    for value, at_s in ((1, 4.0), (2, 4.0), (3, 4.5)):
        history.add(Reading(value=value, received_s=at_s, horizon_s=1.0))
    assert history.before is not None
    assert history.before.value == 2


def test_a_flood_is_bounded() -> None:
    """A thousand readings in 0.1 s, of which 256 are kept: those that would be old enough at 4.42 are gone."""
    flood = [4.0 + n * 1e-4 for n in range(1000)]
    assert after(*flood, 4.42) is None
    assert after(*flood, 4.48) == pytest.approx(4.08)

"""The checks of a history find what they are for."""

from __future__ import annotations

import pytest

from tests.server.bus.histories import Shown, check_ages, check_events

JOURNAL = [{"n": n, "at_ms": 1000 * n, "change": "connected" if n == 1 else "raised"} for n in range(1, 6)]


def page(*numbers: int) -> Shown:
    return Shown(events=[dict(JOURNAL[n - 1]) for n in numbers])


def test_a_page_that_came_later_has_all_from_then_on() -> None:
    check_events(JOURNAL, {"whole": page(1, 2, 3, 4, 5), "later": page(4, 5)})
    check_events(JOURNAL[:3], {"newer": page(2, 3, 4)})


@pytest.mark.parametrize("numbers", [(1, 2, 4, 5), (1, 2, 2, 3, 4, 5), (1, 3, 2, 4, 5), (1, 2, 3, 4)])
def test_an_event_that_is_lost_doubled_or_swapped_is_found(numbers: tuple[int, ...]) -> None:
    with pytest.raises(AssertionError, match="lost, doubled or out of order"):
        check_events(JOURNAL, {"page": page(*numbers)})


def test_a_hole_in_the_log_and_another_event_of_the_same_number_are_found() -> None:
    with pytest.raises(AssertionError, match="hole"):
        check_events([*JOURNAL[:2], *JOURNAL[3:]], {})
    other = page(4, 5)
    other.events[0]["at_ms"] += 1
    with pytest.raises(AssertionError, match="page"):
        check_events(JOURNAL, {"page": other})


def test_an_old_state_that_is_shown_as_new_is_found() -> None:
    check_ages(JOURNAL, [Shown(states=[("run", 3000, 1950.0), ("run", 4000, 3050.0)])])
    with pytest.raises(AssertionError, match="1000 ms younger"):
        check_ages(JOURNAL, [Shown(states=[("run", 3000, 2000.0), ("run", 4000, 2000.0)])])

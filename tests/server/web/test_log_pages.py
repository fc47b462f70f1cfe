"""Paging through the alarm log with filters that leave little: nothing is skipped, nothing comes twice."""

from __future__ import annotations

from typing import Any

import pytest

from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.web.routes.log import Which, _page

EVENTS = 5200


def event(i: int) -> dict[str, Any]:
    alarm = {"alarm": "gps_jump", "title": "GPS jump", "priority": "warning"}
    if i % 400 == 7:
        alarm = {"alarm": "speed_limit", "title": "Speed above limit", "priority": "critical"}
    if i % 1000 == 0:
        return {"at_ms": i, "alarm": None, "change": "paused", "by": "Éva", "text": ""}
    return {"at_ms": i, "change": "raised", "text": f"number {i}", "by": None, **alarm}


@pytest.fixture(scope="module")
def bus() -> LocalBus:
    journal = Journal(None)
    for start in range(0, EVENTS, 1000):
        journal.append("car", [event(i) for i in range(start, min(start + 1000, EVENTS))])
    return LocalBus(journal, now=lambda: 0.0)


@pytest.mark.parametrize(
    ("which", "count"),
    [
        (Which(), EVENTS),
        (Which(priority="critical"), 13),
        (Which(priority="advisory"), 0),
        (Which(alarm=""), 6),
        (Which(text="ÉVA"), 6),
        (Which(text="number 123"), 11),
        (Which(text="SPEED above", priority="critical", since_ms=2000, until_ms=2500), 2),
        (Which(text="title"), 0),
        (Which(text="%"), 0),
    ],
    ids=repr,
)
@pytest.mark.parametrize("limit", [1, 3, 500])
async def test_page_by_page_every_event_that_fits_comes_once(
    bus: LocalBus, which: Which, count: int, limit: int
) -> None:
    if count > 100 * limit:
        pytest.skip("too many pages to be worth the time")
    before: int | None = None
    seen: list[int] = []
    for _ in range(count // limit + EVENTS // 2000 + 2):
        events, more = await _page(bus, "car", which, before, limit)
        assert len(events) <= limit
        assert all(which.has(one) for one in events)
        seen += [one["n"] for one in events]
        if more is None:
            break
        assert before is None or more < before, "no page without progress"
        before = more
    else:
        pytest.fail("it never ends")
    assert seen == sorted(set(seen), reverse=True)
    assert len(seen) == count


@pytest.mark.parametrize(
    ("about", "is_critical"),
    [
        ({"alarm": "x", "priority": "extreme"}, True),  # of another version
        ({"alarm": "x"}, True),
        ({"alarm": "x", "priority": "advisory"}, False),
        ({"alarm": None}, False),
    ],
)
def test_a_priority_that_is_not_known_is_found_among_the_most_urgent(about: dict[str, Any], is_critical: bool) -> None:
    assert Which(priority="critical").has({"at_ms": 1, "change": "raised", **about}) is is_critical
